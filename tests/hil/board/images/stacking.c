/* Takes exceptions with a stack pointer that leads out of SRAM, and keeps what the fault handlers see. */
#include "chip.h"

volatile uint32_t bottom[4] = {1, 2, 3, 4}; /* of SRAM: the upper half of a frame ends up here */
volatile uint32_t command, bus, hard, cfsr, hfsr, sp, nested;

__attribute__((used)) static void note(uint32_t at)
{
    sp = at;
    cfsr = SCB_CFSR;
    hfsr = SCB_HFSR;
    for (;;) {
    }
}

/* A handler that cannot use its stack takes another. */
#define HANDLER(name, count)                                                                                 \
    __attribute__((naked)) void name(void)                                                                   \
    {                                                                                                        \
        __asm volatile("mov r0, sp\n ldr r1, =stack_top\n mov sp, r1\n ldr r1, =" #count                     \
                       "\n ldr r2, [r1]\n adds r2, #1\n str r2, [r1]\n b note");                             \
    }
HANDLER(bus_fault, bus)
HANDLER(hard_fault, hard)

__attribute__((naked)) void svc(void)
{
    __asm volatile("ldr r0, =0x20020000\n mov sp, r0\n bx lr"); /* beyond the end of SRAM */
}

void irq0(void)
{
    nested++;
}

int main(void)
{
    enable_irq(0, 0x40);
    while (command == 0) {
    }
    if (command != 2 && command != 5) {
        SCB_SHCSR = 7u << 16;
    }
    if (command == 4) {
        __asm volatile("svc 0");
    }
    __asm volatile("ldr r0, =0x20000010\n mov sp, r0" ::: "r0", "memory"); /* half a frame of room */
    if (command == 3 || command == 5) {
        (void)REG(0x60000000);
    }
    pend(0);
    for (;;) {
    }
}
