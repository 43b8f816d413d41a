/* Erases a word that lies in the data cache, and reads it again in every state of that cache. */
#include "chip.h"

enum { DCEN = 1 << 10, DCRST = 1 << 12 };
#define CELL     REG(0x08004000)
#define OTHER    REG(0x08004010)
#define FLASH_SR REG(0x40023C0C)
#define FLASH_CR REG(0x40023C10)
volatile uint32_t command, state, stale, off, on_again, reset_while_on, emptied, rewritten, beside;

static void wait(void)
{
    while ((FLASH_SR & 1u << 16) != 0) {
    }
}

static void erase(void)
{
    FLASH_CR = 2u << 8 | 1u << 3 | 2u;
    FLASH_CR |= 1u << 16;
    wait();
}

static void program(void)
{
    FLASH_CR = 2u << 8 | 1u;
    CELL = 0xCAFE0FF0;
    wait();
    OTHER = 0x12345678;
    wait();
}

int main(void)
{
    clock_168mhz(); /* with both caches */
    REG(0x40023C04) = 0x45670123;
    REG(0x40023C04) = 0xCDEF89AB;
    program();
    erase();
    stale = CELL;
    while (command == 2) {
    }
    FLASH_ACR &= ~(uint32_t)DCEN;
    off = CELL;
    FLASH_ACR |= DCEN;
    on_again = CELL;
    if (command == 1) {
        FLASH_ACR |= DCRST;
        reset_while_on = CELL;
        FLASH_ACR &= ~(uint32_t)DCRST;
    }
    FLASH_ACR &= ~(uint32_t)DCEN;
    FLASH_ACR |= DCRST;
    FLASH_ACR &= ~(uint32_t)DCRST;
    FLASH_ACR |= DCEN;
    emptied = CELL;
    program();
    erase();
    FLASH_CR = 2u << 8 | 1u;
    CELL = 0x5555AAAA;
    wait();
    rewritten = CELL;
    beside = OTHER;
    state = 1;
    return 0;
}
