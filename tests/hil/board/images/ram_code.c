/* Code in SRAM that is changed between calls, by thread code and by an interrupt; and bits through their
 * alias. */
#include "chip.h"

volatile uint32_t results[4], bits[3], faulted;
static uint16_t code[2] __attribute__((aligned(4)));
static uint16_t wanted;
static volatile uint32_t flags = 0x10;

void bus_fault(void)
{
    faulted = SCB_CFSR;
    for (;;) {
    }
}

void irq0(void)
{
    code[0] = wanted;
}

static uint32_t call(const uint16_t *function)
{
    uint32_t (*entry)(void) = (uint32_t(*)(void))((uint32_t)function | 1u);
    return entry();
}

int main(void)
{
    SCB_SHCSR = 7u << 16;
    enable_irq(0, 0x40);
    wanted = 0x2063; /* movs r0, #99: the handler has written here before it becomes code */
    pend(0);
    code[1] = 0x4770; /* bx lr */
    for (uint32_t i = 0; i < 4; i++) {
        wanted = (uint16_t)(0x2001 + i); /* movs r0, #i + 1 */
        if ((i & 1u) != 0) {
            pend(0);
        } else {
            *(volatile uint16_t *)code = wanted;
        }
        __asm volatile("dsb\n isb" ::: "memory");
        results[i] = call(code);
    }
    uint32_t alias = 0x22000000u + ((uint32_t)&flags - 0x20000000u) * 32;
    bits[0] = REG(alias + 4 * 4);
    REG(alias + 4 * 9) = 1;
    REG(alias + 4 * 4) = 0;
    bits[1] = flags;
    uint16_t *ccm = (uint16_t *)0x10000000;
    ccm[0] = 0x2001;
    ccm[1] = 0x4770;
    bits[2] = *(volatile uint32_t *)ccm;
    (void)call(ccm); /* CCM hangs on the data bus only */
    return 0;
}
