/* The store that outlives power: flash sectors 1 and 2, erased and programmed while the CPU is stalled.
 *
 * Code is fetched from the same flash, so that the bus holds it up until an operation is over (RM0090 section
 * 3.6): 16 us, at most 100 us, for a word, and 0.25 s, at most 0.5 s, for a sector (datasheet DocID022152,
 * section 5.3.12). What runs on is hardware: the bridges brake, encoders are counted. Requests of the
 * host are lost. */
#include <string.h>

#include "cortex.h"
#include "hal.h"
#include "motors.h"
#include "registers.h"
#include "usart_link.h"
#include "watchdog.h"

enum { FIRST_SECTOR = 1 };

/* From the linker script; only its address means anything. */
extern const uint8_t __parameters_start[];

static volatile uint32_t *word_at(uint32_t slot, uint32_t offset)
{
    const uintptr_t start = (uintptr_t)__parameters_start;
    return (volatile uint32_t *)(start + slot * HAL_STORE_SLOT_SIZE + offset);
}

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
    /* The data cache is not updated (RM0090 section 3.5.2), and may be reset only while it is off. */
    const uint32_t acr = FLASH_ACR;
    FLASH_ACR = acr & ~FLASH_ACR_DCEN;
    FLASH_ACR = (acr & ~FLASH_ACR_DCEN) | FLASH_ACR_DCRST;
    FLASH_ACR = acr & ~FLASH_ACR_DCEN;
    FLASH_ACR = acr;
    return good;
}

/* Cycles since the last tick that ran was due. */
static uint32_t cycles_since_tick(void)
{
    for (;;) {
        const uint32_t before = SYSTICK->val;
        const bool waits = (SCB_ICSR & ICSR_PENDSTSET) != 0;
        const uint32_t after = SYSTICK->val;
        if (after <= before) { /* it did not wrap in between */
            return SYSTICK->load - after + (waits ? SYSTICK->load + 1u : 0u);
        }
    }
}

/* Ticks that came due `since` cycles before `began` and are not going to run: a late one would end after the
 * next is due, and count as an overrun. The phase of the ticks stays, and so does device time. */
static uint32_t drop_ticks(uint32_t since, uint32_t began)
{
    uint32_t missed;
    do { /* again, when one came due between the two steps */
        SCB_ICSR = ICSR_PENDSTCLR;
        missed = (since + (DWT_CYCCNT - began)) / (SYSTICK->load + 1u);
    } while ((SCB_ICSR & ICSR_PENDSTSET) != 0);
    return missed;
}

bool hal_store_erase(uint32_t slot, uint32_t *missed_ticks)
{
    SCB_DEMCR |= DEMCR_TRCENA;
    DWT_CTRL |= DWT_CTRL_CYCCNTENA;
    motors_stop(); /* nothing watches over them until the erase is over */
    watchdog_lengthen();
    const uint32_t state = hal_critical_enter();
    const uint32_t since = cycles_since_tick();
    const uint32_t began = DWT_CYCCNT;
    unlock();
    FLASH_CR = FLASH_CR_PSIZE_32 | FLASH_CR_SER | FLASH_CR_SNB(FIRST_SECTOR + slot);
    FLASH_CR = FLASH_CR_PSIZE_32 | FLASH_CR_SER | FLASH_CR_SNB(FIRST_SECTOR + slot) | FLASH_CR_STRT;
    cpu_barrier();
    const bool good = finish();
    *missed_ticks = drop_ticks(since, began);
    usart_link_forget();
    hal_critical_exit(state);
    watchdog_shorten();
    motors_go();
    return good;
}

bool hal_store_program(uint32_t slot, uint32_t offset, uint32_t word)
{
    unlock();
    FLASH_CR = FLASH_CR_PSIZE_32 | FLASH_CR_PG;
    *word_at(slot, offset) = word;
    cpu_barrier();
    const bool good = finish();
    return good && *word_at(slot, offset) == word;
}

void hal_store_read(uint32_t slot, uint32_t offset, uint8_t *out, size_t length)
{
    memcpy(out, (const uint8_t *)((uintptr_t)__parameters_start + slot * HAL_STORE_SLOT_SIZE + offset),
           length);
}
