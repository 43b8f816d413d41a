/* Words of the parameter store in a flash that takes 64 bits at a time.
 *
 * The core programs words of 32 bits, one after the other, and retires a set by clearing a word. This flash
 * has a checksum (ECC) for each double word, so that it takes each double word once, and zeros alone over
 * what it holds. Hence each word has a double word to itself, and stands in both its halves: erased ones read
 * as erased, cleared ones as cleared, and neither is a special case. */
#ifndef DOUBLE_WORD_H
#define DOUBLE_WORD_H

#include <stdbool.h>
#include <stdint.h>

enum { DOUBLE_WORD_SIZE = 8 };

/* Where the byte at `offset` of a slot lies, from the slot's beginning in flash. */
static inline uint32_t double_word_place(uint32_t offset)
{
    return offset / 4u * (uint32_t)DOUBLE_WORD_SIZE + offset % 4u;
}

/* Whether flash that holds `held` takes `word`. */
static inline bool double_word_takes(const uint32_t held[2], uint32_t word)
{
    return word == 0u || (held[0] == UINT32_MAX && held[1] == UINT32_MAX);
}

#endif
