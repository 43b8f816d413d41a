/* Runs whatever the test writes into `code`, with the registers that it writes into `seeds`, and keeps what
 * becomes of them: on the stack, where the code leaves it, and in a handler's frame after a fault. */
#include "chip.h"

enum { CODE_BYTES = 2048, WORDS = 48 };

__attribute__((aligned(1024), used)) const uint8_t code[CODE_BYTES] = {0xFE, 0xE7};
__attribute__((aligned(4), used)) const uint32_t seeds[WORDS] = {1};

__attribute__((naked)) static void keep(void)
{
    __asm volatile("push {r0-r12, lr}\n vpush {s0-s31}\n mrs r0, apsr\n vmrs r1, fpscr\n mrs r2, control\n"
                   "push {r0-r2}\n b .");
}

void hard_fault(void) __attribute__((alias("fault")));
void bus_fault(void) __attribute__((alias("fault")));
void usage_fault(void) __attribute__((alias("fault")));
void svc(void) __attribute__((alias("fault")));

__attribute__((naked, used)) void fault(void)
{
    __asm volatile("push {r4-r11}\n ldr r0, =0x20010000\n mov sp, r0\n b keep");
}

/* r12 is where to begin in `code`; what follows there branches to `keep` by itself. */
int main(void)
{
    SCB_SHCSR = 7u << 16;
    enable_fpu();
    __asm volatile("ldr lr, =seeds\n vldmia lr!, {s0-s31}\n ldr r0, [lr], #4\n msr apsr_nzcvqg, r0\n"
                   "ldm lr, {r0-r12}\n ldr lr, =code + 1\n add lr, r12\n bx lr" ::
                       : "memory");
    keep();
    return 0;
}
