/* The data cache in front of the flash. */
#ifndef FLASH_CACHE_H
#define FLASH_CACHE_H

#include "registers.h"

/* After an erase or a write: the data cache is not updated (RM0090 section 3.5.2), and may be reset only
 * while it is off. */
static inline void flash_forget_cached(void)
{
    const uint32_t acr = FLASH_ACR;
    FLASH_ACR = acr & ~FLASH_ACR_DCEN;
    FLASH_ACR = (acr & ~FLASH_ACR_DCEN) | FLASH_ACR_DCRST;
    FLASH_ACR = acr & ~FLASH_ACR_DCEN;
    FLASH_ACR = acr;
}

#endif
