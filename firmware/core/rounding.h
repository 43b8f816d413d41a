/* Rounding, clamping, slewing and finiteness that stay defined for every float, NaN included. */
#ifndef ROUNDING_H
#define ROUNDING_H

#include <stdbool.h>
#include <stdint.h>

/* Neither NaN nor infinite. */
static inline bool is_finite(float value)
{
    return value - value == 0.0f;
}

/* NaN gives the lower limit. */
static inline float clampf(float value, float low, float high)
{
    if (!(value > low)) {
        return low;
    }
    return value < high ? value : high;
}

static inline float absf(float value)
{
    return value < 0.0f ? -value : value;
}

/* `from` moved towards `to` by at most `step`; exactly `to` when that is within reach. */
static inline float slew(float from, float to, float step)
{
    if (to - from > step) {
        return from + step;
    }
    return to - from < -step ? from - step : to;
}

/* Half away from zero; the caller keeps |value| below 2^31. */
static inline int32_t round_to_i32(float value)
{
    return (int32_t)(value >= 0.0f ? value + 0.5f : value - 0.5f);
}

static inline int16_t saturate_i16(int32_t value)
{
    if (value < INT16_MIN) {
        return INT16_MIN;
    }
    return (int16_t)(value > INT16_MAX ? INT16_MAX : value);
}

static inline int32_t saturate_i32(int64_t value)
{
    if (value < INT32_MIN) {
        return INT32_MIN;
    }
    return (int32_t)(value > INT32_MAX ? INT32_MAX : value);
}

/* a - b of two wrapping counters. */
static inline int32_t wrapped_difference(int32_t a, int32_t b)
{
    return (int32_t)((uint32_t)a - (uint32_t)b);
}

static inline int32_t wrapped_sum(int32_t a, int32_t b)
{
    return (int32_t)((uint32_t)a + (uint32_t)b);
}

#endif
