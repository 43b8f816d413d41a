/* Erases and programs sector 1 on command, and times it in CPU cycles. */
#include "chip.h"

volatile uint32_t command, state, erase_cycles, program_cycles, status, refused;
#define CELL REG(0x08004000)

static void wait(void)
{
    while ((REG(0x40023C0C) & 1u << 16) != 0) {
    }
}

int main(void)
{
    DEMCR |= 1u << 24;
    DWT_CTRL |= 1u;
    CELL = 0x11111111; /* locked: nothing may happen */
    refused = CELL;
    status = REG(0x40023C0C);
    REG(0x40023C0C) = 0xF0;
    while (command == 0) {
    }
    REG(0x40023C04) = 0x45670123;
    REG(0x40023C04) = 0xCDEF89AB;
    uint32_t from = DWT_CYCCNT;
    REG(0x40023C10) = 2u << 8 | 1u << 3 | 2u;
    REG(0x40023C10) |= 1u << 16;
    wait();
    erase_cycles = DWT_CYCCNT - from;
    state = 1;
    while (command == 1) {
    }
    REG(0x40023C10) = 2u << 8 | 1u;
    from = DWT_CYCCNT;
    CELL = 0xCAFE0FF0;
    wait();
    program_cycles = DWT_CYCCNT - from;
    REG(0x08004004) = 0x12345678;
    wait();
    state = 2;
    while (command == 2) {
    }
    CELL = 0x0000FFFF; /* only clears bits */
    wait();
    REG(0x40023C10) = 1u << 31;
    state = 3;
    return 0;
}
