/* Random numbers as a function of seed and index: draws elsewhere do not affect them. */
#ifndef PLANT_NOISE_H
#define PLANT_NOISE_H

#include <stdint.h>

/* Streams of one seed, far apart from each other and from those of sensor.c. */
enum noise_stream {
    NOISE_DISTURBANCE_LEFT = 1,
    NOISE_DISTURBANCE_RIGHT,
    NOISE_DRIVER_LEFT,
    NOISE_DRIVER_RIGHT,
    NOISE_COUNTS_LEFT,
    NOISE_COUNTS_RIGHT,
    NOISE_CARPET,
    NOISE_PUSH,
    NOISE_BIND,
    NOISE_KNOCK,
    NOISE_KNOCK_SIGN,
};

/* A well mixed word: the finaliser of splitmix64 (Steele, Lea and Flood 2014), twice. */
static inline uint64_t noise_word(uint64_t seed, enum noise_stream stream, uint64_t index)
{
    uint64_t word = seed * UINT64_C(0xD1342543DE82EF95) + (uint64_t)stream * UINT64_C(0x2545F4914F6CDD1D);
    word += index * UINT64_C(0x9E3779B97F4A7C15);
    for (int round = 0; round < 2; round++) {
        word = (word ^ (word >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
        word = (word ^ (word >> 27)) * UINT64_C(0x94D049BB133111EB);
        word ^= word >> 31;
    }
    return word;
}

/* 0 up to 1. */
static inline double noise_uniform(uint64_t seed, enum noise_stream stream, uint64_t index)
{
    return (double)(noise_word(seed, stream, index) >> 11) * 0x1p-53;
}

/* Mean 0, variance 1: four uniform draws, close enough to normal once it is filtered to coloured noise. */
static inline double noise_normal(uint64_t seed, enum noise_stream stream, uint64_t index)
{
    double sum = -2.0;
    for (uint64_t i = 0; i < 4; i++) {
        sum += noise_uniform(seed, stream, 4 * index + i);
    }
    return sum * 1.7320508075688772; /* four uniform draws have the variance 1/3 */
}

#endif
