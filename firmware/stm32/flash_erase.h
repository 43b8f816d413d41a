/* Erasing a sector beside a running controller: bridges off, a longer watchdog, missed ticks counted. */
#ifndef FLASH_ERASE_H
#define FLASH_ERASE_H

#include <stdbool.h>
#include <stdint.h>

#include "watchdog.h"

/* False: the flash reported an error. */
bool flash_erase(uint32_t sector, enum watchdog_period period, uint32_t *missed_ticks);

#endif
