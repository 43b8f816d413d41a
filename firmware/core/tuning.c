/* What the control loop reads in every tick, worked out from the parameters when one changes. */
#include "tuning.h"

#include "rounding.h"
#include "wheel_watch_limits.h"

static uint16_t millivolts(float volts)
{
    return (uint16_t)clampf(volts * 1000.0f + 0.5f, 0.0f, 65535.0f);
}

/* Coarse encoders give few counts: adds the time for enough of them at the slowest speed under
 * stall_effort. */
static uint16_t watch_ms(uint16_t min_ms, float metres_per_count)
{
    const float creep_mps = 0.05f;
    const float counts = (float)(WHEEL_WATCH_DITHER_COUNTS + 1);
    const float wait_ms = 1000.0f * counts * metres_per_count / creep_mps;
    return (uint16_t)((float)min_ms + clampf(wait_ms, 0.0f, 5000.0f));
}

/* A twentieth of the speed at which back-EMF balances the effort, which a feedforward without kv does not
 * tell. */
static float creep_mps(float kv)
{
    const float min_kv = 0.05f;
    return kv > min_kv ? 0.05f / kv : 0.0f;
}

/* A feedforward set to zero or nearly so carries no information about the robot's mass. */
static float watch_ka(float ka)
{
    const float min_ka = 0.1f;
    return ka > min_ka ? ka : min_ka;
}

bool tuning_is_finite(const struct tuning *tuning)
{
    float sum = tuning->metres_per_count + tuning->half_wheelbase_m + tuning->effort_limit +
                tuning->effort_slew_per_s + tuning->thermal.resistance_ohm + tuning->thermal.emf_vs_per_m +
                tuning->thermal.limit_a2 + tuning->thermal.share + tuning->speed_limit_mps +
                tuning->encoder_speed_max_mps + tuning->overspeed_mps + tuning->stall_effort;
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        sum += tuning->watch_kv[wheel] + tuning->watch_ka[wheel] + tuning->creep_mps[wheel];
    }
    return is_finite(sum);
}

void tuning_from_parameters(struct tuning *tuning, const struct parameters *parameters)
{
    const float *const p = parameters->values;
    const float radius = p[PROTO_PARAMETER_WHEEL_RADIUS_M];
    const float wheelbase = p[PROTO_PARAMETER_WHEELBASE_M];
    const float counts_per_rev = p[PROTO_PARAMETER_COUNTS_PER_REV];

    tuning->geometry = odometry_geometry(radius, wheelbase, counts_per_rev);
    tuning->metres_per_count = 2.0f * tuning->geometry.half_metres_per_count;
    tuning->half_wheelbase_m = 0.5f * wheelbase;
    tuning->encoder_reversed[0] = p[PROTO_PARAMETER_ENCODER_LEFT_REVERSED] != 0.0f;
    tuning->encoder_reversed[1] = p[PROTO_PARAMETER_ENCODER_RIGHT_REVERSED] != 0.0f;
    tuning->motor_reversed[0] = p[PROTO_PARAMETER_MOTOR_LEFT_REVERSED] != 0.0f;
    tuning->motor_reversed[1] = p[PROTO_PARAMETER_MOTOR_RIGHT_REVERSED] != 0.0f;
    tuning->effort_limit = p[PROTO_PARAMETER_EFFORT_LIMIT];
    tuning->effort_slew_per_s = p[PROTO_PARAMETER_EFFORT_MODE_SLEW_PER_S];
    tuning->speed_limit_mps = p[PROTO_PARAMETER_SPEED_LIMIT_MPS];
    tuning->encoder_speed_max_mps = p[PROTO_PARAMETER_ENCODER_SPEED_MAX_MPS];
    tuning->command_timeout_ms = (uint32_t)round_to_i32(p[PROTO_PARAMETER_COMMAND_TIMEOUT_S] * 1000.0f);
    tuning->heartbeat_timeout_ms = (uint32_t)round_to_i32(p[PROTO_PARAMETER_HEARTBEAT_TIMEOUT_S] * 1000.0f);
    tuning->log_rate_hz = (uint16_t)p[PROTO_PARAMETER_LOG_RATE_HZ];
    tuning->battery_low_mv = millivolts(p[PROTO_PARAMETER_BATTERY_LOW_V]);
    tuning->battery_recovered_mv =
        millivolts(p[PROTO_PARAMETER_BATTERY_LOW_V] + p[PROTO_PARAMETER_BATTERY_HYSTERESIS_V]);
    tuning->battery_high_mv = millivolts(p[PROTO_PARAMETER_BATTERY_HIGH_V]);

    tuning->thermal =
        motor_thermal(p[PROTO_PARAMETER_MOTOR_RESISTANCE_OHM], p[PROTO_PARAMETER_MOTOR_EMF_VS_PER_M],
                      p[PROTO_PARAMETER_MOTOR_CONTINUOUS_A], p[PROTO_PARAMETER_MOTOR_THERMAL_S]);

    tuning->overspeed_mps = p[PROTO_PARAMETER_OVERSPEED_MPS];
    tuning->stall_effort = p[PROTO_PARAMETER_STALL_EFFORT];
    tuning->encoder_start_ms = watch_ms(WHEEL_WATCH_START_MS, tuning->metres_per_count);
    tuning->stall_ms = watch_ms(WHEEL_WATCH_STALL_MS, tuning->metres_per_count);

    tuning->speed_from_edges = p[PROTO_PARAMETER_SPEED_FROM_EDGES] != 0.0f;
    const struct feedforward forward[HAL_WHEELS] = {
        {p[PROTO_PARAMETER_FF_KS_LEFT], p[PROTO_PARAMETER_FF_KV_LEFT], p[PROTO_PARAMETER_FF_KA_LEFT]},
        {p[PROTO_PARAMETER_FF_KS_RIGHT], p[PROTO_PARAMETER_FF_KV_RIGHT], p[PROTO_PARAMETER_FF_KA_RIGHT]},
    };
    const struct feedforward reverse[HAL_WHEELS] = {
        {p[PROTO_PARAMETER_FF_KS_LEFT_REVERSE], p[PROTO_PARAMETER_FF_KV_LEFT_REVERSE],
         p[PROTO_PARAMETER_FF_KA_LEFT_REVERSE]},
        {p[PROTO_PARAMETER_FF_KS_RIGHT_REVERSE], p[PROTO_PARAMETER_FF_KV_RIGHT_REVERSE],
         p[PROTO_PARAMETER_FF_KA_RIGHT_REVERSE]},
    };
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        const struct velocity_gains gains = {
            .kp = p[PROTO_PARAMETER_VELOCITY_KP],
            .ki = p[PROTO_PARAMETER_VELOCITY_KI],
            .forward = forward[wheel],
            .reverse = reverse[wheel],
            .kick_effort = p[PROTO_PARAMETER_KICK_EFFORT],
            .kick_ms = (uint32_t)round_to_i32(p[PROTO_PARAMETER_KICK_LIMIT_S] * 1000.0f),
            .metres_per_count = tuning->speed_from_edges ? tuning->metres_per_count : 0.0f,
            .effort_limit = tuning->effort_limit,
            .effort_slew_per_s = p[PROTO_PARAMETER_EFFORT_SLEW_PER_S],
            .accel_limit_mps2 = p[PROTO_PARAMETER_ACCEL_LIMIT_MPS2],
        };
        tuning->gains[wheel] = gains;
        tuning->watch_kv[wheel] =
            forward[wheel].kv > reverse[wheel].kv ? forward[wheel].kv : reverse[wheel].kv;
        tuning->creep_mps[wheel] = creep_mps(tuning->watch_kv[wheel]);
        tuning->watch_ka[wheel] =
            watch_ka(forward[wheel].ka > reverse[wheel].ka ? forward[wheel].ka : reverse[wheel].ka);
    }
}
