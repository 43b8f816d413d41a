/* The store that outlives power: 64 KiB at the beginning of flash bank 2.
 *
 * Code runs from bank 1, which can be read while bank 2 is written (RM0440, chapter FLASH, read-while-write):
 * the CPU is not stalled, but waits here, with the tick held off, for what the core expects to be over. A
 * page of 2 KiB takes 22 ms, the 16 of a slot 0.36 s (datasheet DS12288). What runs on is hardware: the
 * bridges brake, encoders are counted.
 *
 * Where the option bytes make one bank of both (DBANK cleared), nothing is erased or written: the pages would
 * be others. A save then fails and says so. */
#include "store.h"

#include "cortex.h"
#include "double_word.h"
#include "flash_cache.h"
#include "flash_cells.h"
#include "flash_erase.h"
#include "hal.h"
#include "registers.h"

enum { PAGE_SIZE = 2048, SLOT_SIZE = HAL_STORE_SLOT_SIZE / 4 * DOUBLE_WORD_SIZE };
enum { SLOT_PAGES = SLOT_SIZE / PAGE_SIZE };

volatile bool store_reads;

/* From the linker script; only its address means anything. */
extern const uint8_t __parameters_start[];

static volatile uint32_t *double_word_at(uint32_t slot, uint32_t offset)
{
    const uintptr_t start = (uintptr_t)__parameters_start;
    return (volatile uint32_t *)(start + slot * SLOT_SIZE + double_word_place(offset));
}

/* One half of a double word. Two wrong bits in it raise the NMI, which returns. */
static uint32_t read_half(const volatile uint32_t *at)
{
    store_reads = true;
    cpu_barrier();
    const uint32_t word = *at;
    cpu_barrier();
    store_reads = false;
    return word;
}

static bool has_two_banks(void)
{
    return (FLASH->optr & FLASH_OPTR_DBANK) != 0;
}

static void unlock(void)
{
    if ((FLASH->cr & FLASH_CR_LOCK) != 0) {
        FLASH->keyr = FLASH_KEY1;
        FLASH->keyr = FLASH_KEY2;
    }
    FLASH->sr = FLASH_SR_ERRORS;  /* an old error would forbid the next operation */
    FLASH_ACR &= ~FLASH_ACR_DCEN; /* ST's HAL: reads of the other bank may spoil it meanwhile */
}

/* Nothing limits the wait but the watchdog. */
static bool finish(void)
{
    while ((FLASH->sr & FLASH_SR_BSY) != 0) {
    }
    const bool good = (FLASH->sr & FLASH_SR_ERRORS) == 0;
    FLASH->cr = FLASH_CR_LOCK;
    flash_forget_cached();
    FLASH_ACR |= FLASH_ACR_DCEN;
    return good;
}

static bool erase_page(uint32_t page)
{
    unlock();
    FLASH->cr = FLASH_CR_PER | FLASH_CR_BKER | FLASH_CR_PNB(page);
    FLASH->cr = FLASH_CR_PER | FLASH_CR_BKER | FLASH_CR_PNB(page) | FLASH_CR_STRT;
    cpu_barrier();
    return finish();
}

/* What a slot lies in stands for one of the STM32F405's sectors. */
bool flash_erase_sector(uint32_t sector)
{
    bool good = has_two_banks();
    for (uint32_t page = 0; page < SLOT_PAGES && good; page++) {
        good = erase_page(sector * SLOT_PAGES + page);
    }
    return good;
}

bool hal_store_erase(uint32_t slot, uint32_t *missed_ticks)
{
    return flash_erase(slot, WATCHDOG_SMALL_SECTOR, missed_ticks);
}

bool hal_store_program(uint32_t slot, uint32_t offset, uint32_t word)
{
    volatile uint32_t *const at = double_word_at(slot, offset);
    const uint32_t held[2] = {read_half(&at[0]), read_half(&at[1])};
    if (!has_two_banks() || !double_word_takes(held, word)) {
        return false;
    }
    /* Erased reads so already; all ones that were written could not be cleared any more. */
    if (word == UINT32_MAX) {
        return true;
    }
    unlock();
    FLASH->cr = FLASH_CR_PG;
    at[0] = word;
    cpu_barrier(); /* the second half starts the writing */
    at[1] = word;
    cpu_barrier();
    const bool good = finish();
    return good && read_half(&at[0]) == word && read_half(&at[1]) == word;
}

void hal_store_read(uint32_t slot, uint32_t offset, uint8_t *out, size_t length)
{
    uint32_t word = 0;
    for (uint32_t i = 0; i < length; i++) {
        const uint32_t at = offset + i;
        if (i == 0 || at % 4u == 0) {
            word = read_half(double_word_at(slot, at & ~3u));
        }
        out[i] = (uint8_t)(word >> (8u * (at % 4u)));
    }
}
