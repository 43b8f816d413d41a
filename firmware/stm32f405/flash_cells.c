/* Erasing and programming the flash, by the plain steps of RM0090 section 3.6; the CPU is stalled meanwhile.
 */
#include "flash_cells.h"

#include "cortex.h"
#include "flash_cache.h"
#include "registers.h"

static void unlock(void)
{
    if ((FLASH_CR & FLASH_CR_LOCK) != 0) {
        FLASH_KEYR = FLASH_KEY1;
        FLASH_KEYR = FLASH_KEY2;
    }
    FLASH_SR = FLASH_SR_ERRORS; /* an old error would forbid the next operation */
}

/* Nothing limits the wait but the watchdog; an operation always ends (RM0090 section 3.6.3). */
static bool finish(void)
{
    while ((FLASH_SR & FLASH_SR_BSY) != 0) {
    }
    const bool good = (FLASH_SR & FLASH_SR_ERRORS) == 0;
    FLASH_CR = FLASH_CR_LOCK;
    flash_forget_cached();
    return good;
}

bool flash_program(volatile uint32_t *at, uint32_t word)
{
    unlock();
    FLASH_CR = FLASH_CR_PSIZE_32 | FLASH_CR_PG;
    *at = word;
    cpu_barrier();
    const bool good = finish();
    return good && *at == word;
}

bool flash_erase_sector(uint32_t sector)
{
    unlock();
    FLASH_CR = FLASH_CR_PSIZE_32 | FLASH_CR_SER | FLASH_CR_SNB(sector);
    FLASH_CR = FLASH_CR_PSIZE_32 | FLASH_CR_SER | FLASH_CR_SNB(sector) | FLASH_CR_STRT;
    cpu_barrier();
    return finish();
}
