/* Erasing and programming the flash, by the plain steps of RM0090 section 3.6; the CPU is stalled meanwhile.
 */
#ifndef FLASH_CELLS_H
#define FLASH_CELLS_H

#include <stdbool.h>
#include <stdint.h>

/* Up to 0.1 ms. False: the flash reported an error, or does not hold the word. */
bool flash_program(volatile uint32_t *at, uint32_t word);

/* Up to 2 s. False: the flash reported an error. */
bool flash_erase_sector(uint32_t sector);

#endif
