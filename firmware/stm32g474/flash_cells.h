/* Erasing the flash. */
#ifndef FLASH_CELLS_H
#define FLASH_CELLS_H

#include <stdbool.h>
#include <stdint.h>

/* The pages of a parameter slot; 0.4 s. False: the flash reported an error. */
bool flash_erase_sector(uint32_t sector);

#endif
