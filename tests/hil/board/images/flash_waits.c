/* Times stretches of code and of loads from flash in CPU cycles, at the FLASH_ACR that the test asks for. */
#include "chip.h"

enum { KINDS = 8, LINES = 32 };
volatile uint32_t command, acr, done;
volatile uint32_t cycles[KINDS];

/* 32 lines of 16 bytes each, the last of which returns. */
#define STRAIGHT(name, filler, count)                                                                        \
    __attribute__((naked, noinline, aligned(16))) static void name(void)                                     \
    {                                                                                                        \
        __asm volatile(".rept " #count "\n " filler "\n .endr\n bx lr");                                     \
    }
STRAIGHT(narrow, "nop", 255)
STRAIGHT(wide, "nop.w", 127)
STRAIGHT(longer, "nop", 575) /* 72 lines */

/* A loop within one line. */
__attribute__((naked, noinline, aligned(16))) static void small_loop(void)
{
    __asm volatile("movs r0, #100\n 1: subs r0, #1\n bne 1b\n bx lr");
}

/* Each entry lies in a line of its own; so many of them are read over and over. */
static const uint32_t table[LINES][4] __attribute__((aligned(16))) = {{1}};
static void loads_of(uint32_t lines)
{
    __asm volatile("movs r4, #20\n 1: mov r2, %0\n mov r3, %1\n"
                   "2: ldr r12, [r2]\n adds r2, #16\n subs r3, #1\n bne 2b\n subs r4, #1\n bne 1b\n"
                   :
                   : "r"(table), "r"(lines)
                   : "r2", "r3", "r4", "r12", "cc", "memory");
}

__attribute__((noinline)) static void eight_lines(void)
{
    loads_of(8);
}

__attribute__((noinline)) static void nine_lines(void)
{
    loads_of(9);
}

int main(void)
{
    static void (*const kind[KINDS])(void) = {narrow, narrow,     wide,        longer,
                                              longer, small_loop, eight_lines, nine_lines};
    DEMCR |= 1u << 24;
    DWT_CTRL |= 1u;
    clock_168mhz();
    for (;;) {
        while (command == 0) {
        }
        FLASH_ACR = 0x1805; /* caches off and emptied */
        FLASH_ACR = acr;
        for (uint32_t i = 0; i < KINDS; i++) {
            const uint32_t from = DWT_CYCCNT;
            kind[i]();
            cycles[i] = DWT_CYCCNT - from;
        }
        command = 0;
        done++;
    }
}
