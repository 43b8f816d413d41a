/* Midpoint odometry from encoder counts, equation (24) of Bakirci 2023. */
#include "odometry.h"

#include "rounding.h"
#include "trig.h"

static const float pi = 3.14159265358979f;
static const float q24 = 16777216.0f;   /* 2^24 */
static const float q16 = 65536.0f;      /* 2^16 */
static const float q32 = 4294967296.0f; /* 2^32 */

/* A tick's travel beyond this (400 m/s) is no wheel's; the bound keeps the step inside its integer. */
static const float longest_step_m = 0.4f;

/* value * 2^40 for 0 <= value < 128, in two exact halves: a cast from float to 64 bits would bring in a
 * library of double precision. */
static int64_t to_q40(float value)
{
    const float scaled = value * q24;
    const int32_t high = (int32_t)scaled;
    const int32_t low = (int32_t)((scaled - (float)high) * q16);
    return (int64_t)high * 65536 + low;
}

struct odometry_geometry odometry_geometry(float wheel_radius_m, float wheelbase_m, float counts_per_rev)
{
    /* (2 pi r / n) / W radians is r / (n W) turns. */
    const float turns_per_count = wheel_radius_m / (counts_per_rev * wheelbase_m);
    const struct odometry_geometry geometry = {
        .turns_per_count = turns_per_count,
        .half_metres_per_count = pi * wheel_radius_m / counts_per_rev,
        .turn_q40_per_count = to_q40(turns_per_count),
    };
    return geometry;
}

void odometry_step(struct odometry *odometry, const struct odometry_geometry *geometry, int32_t left_counts,
                   int32_t right_counts)
{
    const int64_t difference = (int64_t)right_counts - left_counts;
    const int64_t sum = (int64_t)right_counts + left_counts;
    const uint64_t turn = (uint64_t)difference * (uint64_t)geometry->turn_q40_per_count;
    if (sum != 0) {
        /* Shifting an unsigned half would lose the sign of a right turn. */
        const uint64_t half_turn = (uint64_t)((int64_t)turn / 2);
        const uint32_t midpoint = (uint32_t)((odometry->theta_q40 + half_turn) >> 8);
        float sine;
        float cosine;
        trig_sine_cosine(midpoint, &sine, &cosine);
        const float counts = (float)saturate_i32(sum);
        const float step_m =
            clampf(counts * geometry->half_metres_per_count, -longest_step_m, longest_step_m);
        odometry->x_q32 += round_to_i32(step_m * cosine * q32);
        odometry->y_q32 += round_to_i32(step_m * sine * q32);
    }
    odometry->theta_q40 += turn;
}

static int32_t q32_to_mm(int64_t metres_q32)
{
    /* 2^-22 m is far below the millimetre and leaves the product room beyond 10^9 m. */
    const int64_t thousand = (metres_q32 >> 10) * 1000;
    return saturate_i32((thousand + (INT64_C(1) << 21)) >> 22);
}

int32_t odometry_x_mm(const struct odometry *odometry)
{
    return q32_to_mm(odometry->x_q32);
}

int32_t odometry_y_mm(const struct odometry *odometry)
{
    return q32_to_mm(odometry->y_q32);
}

int32_t odometry_theta_e4(const struct odometry *odometry)
{
    /* Turns * 2^20, held to 2^36 so that the product with 2 pi * 10^7 stays inside 63 bits. */
    const int64_t limit = INT64_C(1) << 36;
    int64_t turns_q20 = (int64_t)odometry->theta_q40 >> 20;
    if (turns_q20 > limit) {
        turns_q20 = limit;
    } else if (turns_q20 < -limit) {
        turns_q20 = -limit;
    }
    const int64_t rad_e7_q20 = turns_q20 * 62831853;
    const int64_t divisor = INT64_C(1000) << 20;
    const int64_t half = rad_e7_q20 >= 0 ? divisor / 2 : -divisor / 2;
    return saturate_i32((rad_e7_q20 + half) / divisor);
}
