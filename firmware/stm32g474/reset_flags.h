/* Why the chip was reset, as the core reads it. */
#ifndef RESET_FLAGS_H
#define RESET_FLAGS_H

#include <stdint.h>

/* hal_identity.reset_cause, whose bits are those of the STM32F405's RCC_CSR, from this chip's: the upper six
 * are the same, with one flag (BORRSTF) for power-on and brown-out. Bit 1 is no brown-out here but a reset
 * that loads the option bytes, which software asks for. */
static inline uint8_t reset_flags(uint32_t csr)
{
    enum { OPTIONS_LOADED = 1 << 1, SOFTWARE = 1 << 4 };
    const uint32_t flags = csr >> 24;
    return (uint8_t)((flags & 0xFCu) | ((flags & OPTIONS_LOADED) != 0u ? SOFTWARE : 0u));
}

#endif
