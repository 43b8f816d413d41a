/* The store that outlives power: flash sectors 1 and 2, erased and programmed while the CPU is stalled: 16
 * us, at most 100 us, for a word, and 0.25 s, at most 0.5 s, for a sector (datasheet DocID022152,
 * section 5.3.12). */
#include <string.h>

#include "flash_cells.h"
#include "flash_erase.h"
#include "hal.h"

enum { FIRST_SECTOR = 1 };

/* From the linker script; only its address means anything. */
extern const uint8_t __parameters_start[];

static volatile uint32_t *word_at(uint32_t slot, uint32_t offset)
{
    const uintptr_t start = (uintptr_t)__parameters_start;
    return (volatile uint32_t *)(start + slot * HAL_STORE_SLOT_SIZE + offset);
}

bool hal_store_erase(uint32_t slot, uint32_t *missed_ticks)
{
    return flash_erase(FIRST_SECTOR + slot, WATCHDOG_SMALL_SECTOR, missed_ticks);
}

bool hal_store_program(uint32_t slot, uint32_t offset, uint32_t word)
{
    return flash_program(word_at(slot, offset), word);
}

void hal_store_read(uint32_t slot, uint32_t offset, uint8_t *out, size_t length)
{
    memcpy(out, (const uint8_t *)((uintptr_t)__parameters_start + slot * HAL_STORE_SLOT_SIZE + offset),
           length);
}
