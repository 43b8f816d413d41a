/* Midpoint odometry from encoder counts, equation (24) of Bakirci 2023. */
#ifndef ODOMETRY_H
#define ODOMETRY_H

#include <stdint.h>

/* What the counts mean; derived from parameters by odometry_geometry. */
struct odometry_geometry {
    float turns_per_count;       /* heading per count of one wheel, turns */
    float half_metres_per_count; /* travel of the body per count of one wheel */
    int64_t turn_q40_per_count;  /* the same, 2^-40 turn */
};

/* Heading is a sum of integers: it is exact in the counts, and does not drift with time or distance. Position
 * is summed at 2^-32 m from single precision steps, whose rounding is relative to each step and not to the
 * sum. */
struct odometry {
    uint64_t theta_q40; /* turns * 2^40, two's complement */
    int64_t x_q32;      /* m * 2^32 */
    int64_t y_q32;
};

struct odometry_geometry odometry_geometry(float wheel_radius_m, float wheelbase_m, float counts_per_rev);

/* Advances by what both wheels turned in one control tick. */
void odometry_step(struct odometry *odometry, const struct odometry_geometry *geometry, int32_t left_counts,
                   int32_t right_counts);

int32_t odometry_x_mm(const struct odometry *odometry);
int32_t odometry_y_mm(const struct odometry *odometry);
int32_t odometry_theta_e4(const struct odometry *odometry); /* 1e-4 rad, not wrapped */

#endif
