/* What the control loop reads in every tick, worked out from the parameters when one changes. */
#ifndef TUNING_H
#define TUNING_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"
#include "motor_heat.h"
#include "odometry.h"
#include "parameters.h"
#include "velocity_control.h"

struct tuning {
    float metres_per_count;
    float half_wheelbase_m;
    struct odometry_geometry geometry;
    struct velocity_gains gains[HAL_WHEELS];
    bool speed_from_edges;
    bool encoder_reversed[HAL_WHEELS];
    bool motor_reversed[HAL_WHEELS];
    float effort_limit;
    float effort_slew_per_s; /* of effort mode */
    float speed_limit_mps;
    float encoder_speed_max_mps;
    uint32_t command_timeout_ms;
    uint32_t heartbeat_timeout_ms;
    uint16_t log_rate_hz;
    uint16_t battery_low_mv;
    uint16_t battery_recovered_mv;
    uint16_t battery_high_mv;
    struct motor_thermal thermal;
    float overspeed_mps;
    float stall_effort;
    uint16_t encoder_start_ms;   /* under stall_effort a wheel at rest makes counts within this time */
    uint16_t stall_ms;           /* and one that has turned goes on within this time */
    float creep_mps[HAL_WHEELS]; /* per effort: a slower wheel creeps; 0: not known */
    float watch_kv[HAL_WHEELS];  /* effort per speed */
    float watch_ka[HAL_WHEELS];  /* effort per acceleration, with a lower bound against false faults */
};

/* Whether all limits and scales that the supervisor judges by are numbers. Comparisons with NaN are false, so
 * that a limit that is none would allow everything. */
bool tuning_is_finite(const struct tuning *tuning);

void tuning_from_parameters(struct tuning *tuning, const struct parameters *parameters);

#endif
