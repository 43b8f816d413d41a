/* IT blocks of all lengths while an interrupt, whose period changes at each tick, overwrites every flag. */
#include "chip.h"

volatile uint32_t wrong, rounds, ticks, pages_wrong;

void systick(void)
{
    ticks++;
    SYST_RVR = 60 + ticks * 7 % 61;
    __asm volatile("movs r3, #0\n cmp r3, #1\n" ::: "r3", "cc");
}

/* An IT block whose first instruction is the last of a page of 1 KiB: engines that translate code page by
   page may stop in the middle of it. */
__attribute__((naked, noinline, aligned(1024))) static uint32_t across_pages(uint32_t argument
                                                                             __attribute__((unused)))
{
    __asm volatile("mov r1, r0\n movs r0, #0\n .rept 507\n nop\n .endr\n"
                   "cmp r1, #5\n itttt eq\n addeq r0, #1\n addeq r0, #2\n addeq r0, #4\n addeq r0, #8\n"
                   "bx lr");
}

/* An IT block that reads a page for the first time, left through a register: what comes next is under no
   condition. */
__attribute__((naked, noinline)) static uint32_t first_look(const uint8_t *page __attribute__((unused)))
{
    __asm volatile("mov r2, r0\n movs r0, #0\n adr r3, 1f\n adds r3, #1\n"
                   "cmp r0, #0\n ittt eq\n ldrbeq r1, [r2]\n moveq r1, #0\n moveq r1, #0\n"
                   "cmp r0, #1\n bx r3\n .balign 4\n"
                   "1: add r0, #1\n add r0, #1\n add r0, #1\n add r0, #1\n bx lr");
}

/* The same, left by a plain branch, which an engine may tie to what it branched to the first time. */
__attribute__((naked, noinline)) static uint32_t second_look(const uint8_t *page __attribute__((unused)))
{
    __asm volatile("mov r2, r0\n movs r0, #0\n"
                   "cmp r0, #0\n ittt eq\n ldrbeq r1, [r2]\n moveq r1, #0\n moveq r1, #0\n"
                   "cmp r0, #1\n b 1f\n nop\n"
                   "1: add r0, #1\n add r0, #1\n add r0, #1\n add r0, #1\n bx lr");
}

int main(void)
{
    for (uint32_t page = 0x08000000; page < 0x08100000; page += 1024) {
        pages_wrong += first_look((const uint8_t *)page) != 4;
    }
    for (uint32_t page = 0x20004000; page < 0x20008000; page += 1024) {
        pages_wrong += second_look((const uint8_t *)page) != 4;
        pages_wrong += second_look((const uint8_t *)page) != 4;
    }
    SYST_RVR = 100;
    SYST_CVR = 0;
    SYST_CSR = 7;
    for (;;) {
        uint32_t a, b, c, d;
        __asm volatile("movs r0, #0\n movs r1, #0\n movs r2, #0\n movs r3, #0\n movs r4, #5\n"
                       "cmp r4, #5\n itttt eq\n addeq r0, #1\n addeq r0, #2\n addeq r0, #4\n addeq r0, #8\n"
                       "cmp r4, #6\n itete eq\n addeq r1, #1\n addne r1, #2\n addeq r1, #4\n addne r1, #8\n"
                       "cmp r4, #4\n ite gt\n addgt r2, #1\n addle r2, #2\n"
                       "cmp r4, #9\n itet lo\n addlo r3, #1\n addhs r3, #2\n addlo r3, #4\n"
                       "mov %0, r0\n mov %1, r1\n mov %2, r2\n mov %3, r3\n"
                       : "=r"(a), "=r"(b), "=r"(c), "=r"(d)
                       :
                       : "r0", "r1", "r2", "r3", "r4", "cc");
        wrong += across_pages(5) != 15 || across_pages(6) != 0;
        wrong += a != 15 || b != 10 || c != 1 || d != 5;
        rounds++;
    }
}
