/* Why the chip was reset, as the core reads it. */
#ifndef RESET_FLAGS_H
#define RESET_FLAGS_H

#include <stdint.h>

/* hal_identity.reset_cause, RM0090 section 7.3.21. */
static inline uint8_t reset_flags(uint32_t csr)
{
    return (uint8_t)(csr >> 24);
}

#endif
