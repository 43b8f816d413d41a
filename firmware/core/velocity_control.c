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

/* `from` moved towards `to` by at most `step`; exactly `to` when that is within reach. */
static float slew(float from, float to, float step)
{
    if (to - from > step) {
        return from + step;
    }
    return to - from < -step ? from - step : to;
}

void velocity_control_reset(struct velocity_control *control, float speed_mps, float effort)
{
    control->tracked_mps = speed_mps;
    for (int i = 0; i < VELOCITY_CONTROL_DELAY_MS; i++) {
        control->earlier_mps[i] = speed_mps;
    }
    control->next = 0;
    control->integral = 0.0f;
    control->effort = effort;
}

/* What the wheel was meant to do when it did what is measured now. Compared with the speed of this moment, a
 * ramp would look like an error that the feedforward has left behind, and the integral would overshoot it. */
static float delayed(struct velocity_control *control, float speed_mps)
{
    const float then = control->earlier_mps[control->next];
    control->earlier_mps[control->next] = speed_mps;
    control->next = (uint8_t)((control->next + 1u) % VELOCITY_CONTROL_DELAY_MS);
    return then;
}

float velocity_control_step(struct velocity_control *control, const struct velocity_gains *gains,
                            float command_mps, float measured_mps, bool still)
{
    const float before = control->tracked_mps;
    control->tracked_mps = slew(before, command_mps, gains->accel_limit_mps2 * tick_s);
    const float speed = control->tracked_mps;

    /* A wheel that shall stand and stands needs no effort: a left-over integral would heat the motor. */
    if (speed == 0.0f && command_mps == 0.0f && still) {
        velocity_control_reset(control, 0.0f, 0.0f);
        return 0.0f;
    }

    const float acceleration = (speed - before) / tick_s;
    const float feedforward = gains->ks * sign(speed) + gains->kv * speed + gains->ka * acceleration;
    const float error = delayed(control, speed) - measured_mps;
    const float wanted = feedforward + gains->kp * error + control->integral;
    const float limited = clampf(wanted, -gains->effort_limit, gains->effort_limit);
    const float output = slew(control->effort, limited, gains->effort_slew_per_s * tick_s);

    /* Conditional integration: while an output limit holds, only an error that leads away from it counts. */
    const float excess = wanted - output;
    if (excess == 0.0f || excess * error < 0.0f) {
        control->integral += gains->ki * error * tick_s;
    }
    control->effort = output;
    return output;
}
