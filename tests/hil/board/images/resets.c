/* Resets and their causes; boots counts them in SRAM that start-up leaves alone. */
#include "chip.h"

__attribute__((section(".noinit"))) volatile uint32_t boots, magic;
volatile uint32_t cause, command, ready;

int main(void)
{
    if (magic != 0xB007B007u) {
        magic = 0xB007B007u;
        boots = 0;
    }
    boots++;
    cause = RCC_CSR;
    RCC_CSR |= 1u << 24;
    ready = 1;
    while (command == 0) {
    }
    if (command == 1) {
        SCB_AIRCR = 0x05FA0004u;
    } else {
        IWDG_KR = 0x5555;
        IWDG_PR = 1;    /* 8 / 32 kHz = 250 us */
        IWDG_RLR = 399; /* 100 ms */
        IWDG_KR = 0xCCCC;
        while (command == 2) {
            IWDG_KR = 0xAAAA;
        }
    }
    for (;;) {
    }
}
