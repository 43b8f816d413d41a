/* The memory that the log lies in: the SRAM that is left, and the core-coupled memory where there is any.
 *
 * Core-coupled memory (RM0090 section 2.3.1) is connected to the processor's data bus only: no peripheral
 * reaches it, which the log does not need. Parts of the family without it answer with a bus error. */
#include "log_memory.h"

#include <stdint.h>

#include "fault.h"
#include "hal.h"
#include "registers.h"

enum { WORDS = CCM_SIZE / sizeof(uint32_t) };

/* From the linker script. */
extern uint8_t __log_memory_start[], __log_memory_end[];

static uint32_t good_words;

/* Each word holds another value, so that lines that are stuck or tied together show. */
static uint32_t pattern(uint32_t word)
{
    return word * 0x9E3779B9u;
}

/* Words from the start on that keep `pattern`, or its complement. */
static uint32_t count_good(volatile uint32_t *memory, uint32_t words, uint32_t flip)
{
    for (uint32_t i = 0; i < words; i++) {
        memory[i] = pattern(i) ^ flip;
    }
    uint32_t good = 0;
    while (good < words && memory[good] == (pattern(good) ^ flip)) {
        good++;
    }
    return good;
}

void log_memory_start(void)
{
    uint32_t word;
    good_words = 0;
    if (guarded_read(CCM_ADDRESS, &word) && guarded_read(CCM_ADDRESS + CCM_SIZE - sizeof word, &word)) {
        volatile uint32_t *const memory = (volatile uint32_t *)CCM_ADDRESS;
        good_words = count_good(memory, count_good(memory, WORDS, 0), UINT32_MAX);
    }
}

void hal_log_memory(uint32_t piece, struct hal_memory *out)
{
    if (piece == 0) {
        *out = (struct hal_memory){.start = __log_memory_start,
                                   .size = (size_t)(__log_memory_end - __log_memory_start)};
    } else {
        *out = (struct hal_memory){.start = (uint8_t *)CCM_ADDRESS, .size = good_words * sizeof(uint32_t)};
    }
}
