/* Runs from the crystal with or without the clock security system; main counts so that a standstill shows. */
#include "chip.h"

volatile uint32_t count, nmis, security = 1, hse_started, cfgr;

void nmi(void)
{
    nmis++;
    REG(0x4002380C) = 1u << 23;
}

int main(void)
{
    RCC_CR |= 1u << 16;
    for (uint32_t i = 0; i < 100000 && (RCC_CR & 1u << 17) == 0; i++) {
    }
    hse_started = RCC_CR >> 17 & 1u;
    if (hse_started) {
        RCC_CFGR = 1;
        RCC_CR |= security << 19;
    }
    for (;;) {
        count++;
        cfgr = RCC_CFGR;
    }
}
