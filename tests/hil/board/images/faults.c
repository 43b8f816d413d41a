/* Faults with handlers that correct the cause and return; what they observed is kept for the test. */
#include "chip.h"

struct seen {
    uint32_t count, cfsr, bfar, pc, xpsr, hfsr;
};
volatile struct seen bus, usage, hard;
volatile uint32_t value, in_it, after_udf, done, command, fp_off_pc_good;
extern uint8_t bad_load[], bad_load_in_it[], bad_opcode[], fp_opcode[];
static uint32_t target = 0x12345678;

static void note(volatile struct seen *s, uint32_t *frame)
{
    s->count++;
    s->cfsr = SCB_CFSR;
    s->hfsr = SCB_HFSR;
    s->bfar = SCB_BFAR;
    s->pc = frame[6];
    s->xpsr = frame[7];
    SCB_CFSR = SCB_CFSR;
    SCB_HFSR = SCB_HFSR;
}

__attribute__((naked)) void bus_fault(void)
{
    __asm volatile("mov r0, sp\n b bus_body");
}

/* The load is done again, from an address that exists. */
__attribute__((used)) static void bus_body(uint32_t *frame)
{
    note(&bus, frame);
    frame[0] = (uint32_t)&target;
}

__attribute__((naked)) void usage_fault(void)
{
    __asm volatile("mov r0, sp\n b usage_body");
}

__attribute__((used)) static void usage_body(uint32_t *frame)
{
    note(&usage, frame);
    if ((usage.cfsr & 1u << 19) != 0) {
        fp_off_pc_good = usage.pc == (uint32_t)fp_opcode;
        enable_fpu();
    } else {
        frame[6] += 2;
    }
}

__attribute__((naked)) void hard_fault(void)
{
    __asm volatile("mov r0, sp\n b hard_body");
}

__attribute__((used)) static void hard_body(uint32_t *frame)
{
    note(&hard, frame);
    if (command == 2) {
        (void)REG(0x60000000); /* a fault in the hard fault handler */
    }
    frame[0] = (uint32_t)&target;
}

static uint32_t load(uint32_t address)
{
    register uint32_t r0 __asm("r0") = address;
    __asm volatile("bad_load: ldr r0, [r0]" : "+r"(r0)::"memory");
    return r0;
}

int main(void)
{
    while (command == 0) {
    }
    if (command == 1) {
        SCB_SHCSR = 7u << 16;
    }
    value = load(0x60000000);
    if (command == 1) {
        uint32_t sum;
        __asm volatile("mov r0, #0x60000000\n movs r1, #0\n cmp r1, #0\n ittt eq\n addeq r1, #1\n"
                       "bad_load_in_it: ldreq r2, [r0]\n addeq r1, #2\n"
                       "it ne\n addne r1, #8\n mov %0, r1\n"
                       : "=r"(sum)::"r0", "r1", "r2", "cc", "memory");
        in_it = sum;
        __asm volatile("bad_opcode: udf #7" ::: "memory");
        after_udf = 1;
        __asm volatile("movs r1, #3\n nop\n fp_opcode: vmov s0, r1" ::: "r1", "s0");
    }
    done = 1;
    return 0;
}
