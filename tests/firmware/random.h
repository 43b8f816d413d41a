/* A small generator of random numbers, the same on every machine (xorshift, Marsaglia 2003). */
#ifndef RANDOM_H
#define RANDOM_H

#include <stdint.h>

static uint64_t random_state = 88172645463325252u;

static inline void random_seed(uint64_t seed)
{
    random_state = seed * 2 + 1;
}

static inline uint32_t random_u32(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return (uint32_t)(random_state >> 32);
}

/* 0 to limit - 1. */
static inline uint32_t random_below(uint32_t limit)
{
    return (uint32_t)(((uint64_t)random_u32() * limit) >> 32);
}

#endif
