/* What a record's speeds and pose must be, worked out from its counts in integers. */
#include "log_replay.h"

#include <string.h>

#include "rounding.h"

static const int64_t longest_way_q32 = INT64_C(1) << 38; /* 64 m in one interval */
static const int64_t farthest_q32 = INT64_C(1) << 53;
static const int64_t max_turn_q40 = INT64_C(1) << 47;

static int64_t clamp_i64(int64_t value, int64_t limit)
{
    if (value > limit) {
        return limit;
    }
    return value < -limit ? -limit : value;
}

static int64_t shifted(int64_t value, int32_t by)
{
    return by >= 0 ? value * (INT64_C(1) << by) : value >> -by;
}

/* value = mantissa * 2^exponent, with 24 bits of mantissa. */
static uint32_t split(float value, int32_t *exponent)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    *exponent = (int32_t)(bits >> 23) - 150;
    return (bits & 0x7FFFFFu) | 0x800000u;
}

void log_replay_start(struct log_replay *replay, const struct log_geometry *geometry)
{
    int32_t exponent;
    const uint32_t turn = split(geometry->turns_per_count, &exponent);
    replay->mantissa = split(geometry->metres_per_count, &replay->exponent);
    replay->turn_q40 = exponent + 40 > 23 ? max_turn_q40 : shifted(turn, exponent + 40);
    replay->max_counts = replay->turn_q40 > 0 ? (INT64_C(1) << 62) / replay->turn_q40 : 0;
}

/* Half away from zero. */
static int64_t quotient(int64_t numerator, int64_t divisor)
{
    return (numerator + (numerator >= 0 ? divisor / 2 : -(divisor / 2))) / divisor;
}

int16_t log_replay_speed(const struct log_replay *replay, int32_t counts, uint32_t interval_ms)
{
    const int32_t shift = -(replay->exponent + 14);
    if (counts == 0 || interval_ms == 0 || interval_ms > UINT16_MAX || shift < 0 || shift >= 40) {
        return 0;
    }
    const int64_t scale = (int64_t)(((uint64_t)replay->mantissa * 1000000u) >> 14);
    const int64_t speed = quotient(counts * scale, shifted((int64_t)interval_ms, shift));
    return saturate_i16(saturate_i32(speed));
}

int64_t log_replay_heading(const struct log_replay *replay, int32_t difference)
{
    const int64_t size = difference >= 0 ? difference : -(int64_t)difference;
    return size <= replay->max_counts ? difference * replay->turn_q40 : 0;
}

int32_t log_replay_heading_e4(int64_t turns_q40)
{
    /* Turns * 2^20, held to 2^36 so that the product with 2 pi * 10^7 stays inside 63 bits. */
    const int64_t turns_q20 = clamp_i64(turns_q40 >> 20, INT64_C(1) << 36);
    return saturate_i32(quotient(turns_q20 * 62831853, INT64_C(1000) << 20));
}

/* a * b / 2^30 */
static int32_t product_q30(int32_t a, int32_t b)
{
    return (int32_t)(((int64_t)a * b) >> 30);
}

/* Sine and cosine times 2^24, from Taylor's series to the 7th and 6th power around the nearest quarter turn:
 * within 4e-6 and 3e-5, which is a thirtieth of a millimetre over one metre. */
static void sine_cosine(uint32_t phase, int32_t *sine, int32_t *cosine)
{
    const uint32_t quadrant = (phase + 0x20000000u) >> 30;
    const int32_t x = product_q30((int32_t)(phase - (quadrant << 30)), 1686629713); /* pi/2 * 2^30 */
    const int32_t z = product_q30(x, x);
    const int32_t s =
        (x +
         product_q30(x, product_q30(z, -178956971 + product_q30(z, 8947849 + product_q30(z, -213044))))) >>
        6;
    const int32_t c =
        ((1 << 30) + product_q30(z, -536870912 + product_q30(z, 44739243 + product_q30(z, -1491308)))) >> 6;
    switch (quadrant & 3u) {
    case 0:
        *sine = s;
        *cosine = c;
        break;
    case 1:
        *sine = c;
        *cosine = -s;
        break;
    case 2:
        *sine = -s;
        *cosine = -c;
        break;
    default:
        *sine = -c;
        *cosine = s;
        break;
    }
}

void log_replay_way(const struct log_replay *replay, int64_t counts, uint32_t phase, int64_t way_q32[2])
{
    int32_t sine;
    int32_t cosine;
    const int32_t shift = replay->exponent + 31;
    const int64_t product = counts * (int64_t)replay->mantissa;
    int64_t way = 0;
    if (shift > 0) {
        way = shifted(clamp_i64(product, longest_way_q32), shift < 20 ? shift : 20);
    } else {
        way = shifted(product, shift > -62 ? shift : -62);
    }
    way = clamp_i64(way, longest_way_q32);
    sine_cosine(phase, &sine, &cosine);
    way_q32[0] = (way * cosine) >> 24;
    way_q32[1] = (way * sine) >> 24;
}

void log_axis_step(struct log_axis *axis, int64_t way_q32)
{
    axis->at_q32 = clamp_i64(axis->at_q32 + way_q32, farthest_q32);
}

/* Thousandths of a metre, 2^-22. */
static int64_t mm_q22(const struct log_axis *axis)
{
    return (axis->at_q32 >> 10) * 1000;
}

int32_t log_axis_mm(const struct log_axis *axis)
{
    return (int32_t)((mm_q22(axis) + (INT64_C(1) << 21)) >> 22);
}

uint32_t log_axis_context(const struct log_axis *axis)
{
    const int64_t off = mm_q22(axis) - (int64_t)log_axis_mm(axis) * (INT64_C(1) << 22);
    const uint32_t eighths = (uint32_t)((off >= 0 ? off : -off) >> 19);
    return 1u + (eighths < 3u ? eighths : 3u);
}

void log_axis_correct(struct log_axis *axis, int32_t mm, int32_t residual)
{
    if (residual != 0) {
        const int64_t twice = 2 * (int64_t)mm + (residual > 0 ? -1 : 1);
        const int64_t edge =
            (twice * 1099511628) >> 9; /* half a millimetre is 2^40 / 1000 / 2^9 of 2^-32 m */
        axis->at_q32 = clamp_i64(edge + (residual > 0 ? 2048 : -2048), farthest_q32);
    }
}
