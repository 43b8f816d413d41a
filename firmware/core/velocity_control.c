/* One wheel's speed loop: PI with feedforward kS sign(v) + kV v + kA a, 1 kHz. */
#include "velocity_control.h"

#include "rounding.h"

static const float tick_s = 0.001f;

static float sign(float value)
{
    if (value > 0.0f) {
        return 1.0f;
    }
    return value < 0.0f ? -1.0f : 0.0f;
}

void velocity_control_reset(struct velocity_control *control, float speed_mps, float effort)
{
    control->tracked_mps = speed_mps;
    for (int i = 0; i < VELOCITY_CONTROL_MEMORY_MS; i++) {
        control->earlier_mps[i] = speed_mps;
    }
    control->next = 0;
    control->integral = 0.0f;
    control->effort = effort;
    control->kicked_ms = 0;
    control->turning = speed_mps != 0.0f;
}

/* The reference at the time that the measured speed belongs to. Against the present reference, the
 * measurement delay would look like a tracking error during a ramp, and the integral would overshoot. */
static float meant_before(struct velocity_control *control, float age_s)
{
    const float max_s = tick_s * (float)VELOCITY_CONTROL_MEMORY_MS;
    const int32_t ticks = round_to_i32(clampf(age_s, tick_s, max_s) / tick_s);
    return control->earlier_mps[(control->next + VELOCITY_CONTROL_MEMORY_MS - (uint32_t)ticks) %
                                VELOCITY_CONTROL_MEMORY_MS];
}

static void remember(struct velocity_control *control)
{
    control->earlier_mps[control->next] = control->tracked_mps;
    control->next = (uint8_t)((control->next + 1u) % VELOCITY_CONTROL_MEMORY_MS);
}

/* The loop is limited by its measurement rate: one count in the time that a count takes at the reference
 * speed, or at half the measured speed when the wheel is much faster. The measured speed itself would weight
 * a short interval between misplaced edges more than the long one next to it. */
static float share_of_gain(const struct velocity_gains *gains, float meant_mps, float measured_mps)
{
    const float full_s = tick_s * (float)VELOCITY_CONTROL_FULL_GAIN_MS;
    const float meant = absf(meant_mps);
    const float half = 0.5f * absf(measured_mps);
    const float travel_m = full_s * (meant > half ? meant : half);
    return travel_m < gains->metres_per_count ? travel_m / gains->metres_per_count : 1.0f;
}

/* No count for twice the expected time: the wheel stands. The integral may then grow at its full rate, since
 * a standing wheel cannot oscillate. */
static bool stalled(const struct velocity_gains *gains, float meant_mps, const struct wheel_measure *measured)
{
    return measured->span_s * absf(meant_mps) > 2.0f * gains->metres_per_count;
}

static float feed_forward(const struct velocity_gains *gains, float speed_mps, float acceleration_mps2)
{
    /* From standstill, and back to it, the direction is that of the motion that begins or ends. */
    const float direction = speed_mps != 0.0f ? speed_mps : acceleration_mps2;
    const struct feedforward *const known = direction < 0.0f ? &gains->reverse : &gains->forward;
    return known->ks * sign(speed_mps) + known->kv * speed_mps + known->ka * acceleration_mps2;
}

/* Breakaway friction exceeds running friction: an extra effort until the wheel turns, within limits. */
static float kick(struct velocity_control *control, const struct velocity_gains *gains, float measured_mps)
{
    const float speed = control->tracked_mps;
    if (measured_mps != 0.0f) {
        control->turning = true;
    }
    if (control->turning || speed == 0.0f || control->kicked_ms >= gains->kick_ms) {
        return 0.0f;
    }
    control->kicked_ms++;
    return gains->kick_effort * sign(speed);
}

/* Not finite when any of the numbers is not that a comparison below would swallow: limits and rates decide
 * nothing when they are NaN, and let everything pass. */
static float all_finite(const struct velocity_control *control, const struct velocity_gains *gains,
                        float command_mps, const struct wheel_measure *measured)
{
    return control->tracked_mps + control->effort + control->integral + gains->ki + gains->accel_limit_mps2 +
           gains->effort_slew_per_s + gains->effort_limit + gains->metres_per_count + gains->kick_effort +
           command_mps + measured->mps + measured->span_s + measured->age_s + measured->moved_m;
}

float velocity_control_step(struct velocity_control *control, const struct velocity_gains *gains,
                            float command_mps, const struct wheel_measure *measured, bool still)
{
    const float all = all_finite(control, gains, command_mps, measured);
    if (!is_finite(all)) {
        return all;
    }
    const float before = control->tracked_mps;
    control->tracked_mps = slew(before, command_mps, gains->accel_limit_mps2 * tick_s);
    const float speed = control->tracked_mps;

    /* A wheel at rest with a zero command needs no effort: a residual integral would heat the motor. */
    if (speed == 0.0f && command_mps == 0.0f && still) {
        velocity_control_reset(control, 0.0f, 0.0f);
        return 0.0f;
    }

    const float feedforward =
        feed_forward(gains, speed, (speed - before) / tick_s) + kick(control, gains, measured->mps);
    const float error = meant_before(control, measured->age_s) - measured->mps;
    remember(control);
    /* Integrates travel, not speed: errors of successive edge intervals cancel. */
    const float meant_m = speed * tick_s;
    const float share = share_of_gain(gains, speed, measured->mps);
    const float integral_share = stalled(gains, speed, measured) ? 1.0f : share * share;
    const float wanted = feedforward + share * gains->kp * error + control->integral;
    if (!is_finite(wanted)) {
        return wanted;
    }
    const float limited = clampf(wanted, -gains->effort_limit, gains->effort_limit);
    const float output = slew(control->effort, limited, gains->effort_slew_per_s * tick_s);

    /* Conditional integration: while an output limit holds, only an error that leads away from it counts. */
    const float excess = wanted - output;
    if (excess == 0.0f || excess * error < 0.0f) {
        control->integral += integral_share * gains->ki * (meant_m - measured->moved_m);
    }
    control->effort = output;
    return output;
}
