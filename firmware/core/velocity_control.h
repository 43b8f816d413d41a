/* One wheel's speed loop: PI with feedforward kS sign(v) + kV v + kA a, 1 kHz. */
#ifndef VELOCITY_CONTROL_H
#define VELOCITY_CONTROL_H

#include <stdbool.h>
#include <stdint.h>

#include "wheel_speed.h"

struct velocity_gains {
    float kp;                /* effort per m/s */
    float ki;                /* effort per m */
    float ks;                /* effort */
    float kv;                /* effort per m/s */
    float ka;                /* effort per m/s^2 */
    float effort_limit;      /* 0..1 */
    float effort_slew_per_s; /* effort/s */
    float accel_limit_mps2;  /* slew of the tracked speed */
};

/* A speed from counts is a mean over the window before it: it tells of the middle of that window. */
enum { VELOCITY_CONTROL_DELAY_MS = WHEEL_SPEED_WINDOW_MS / 2 };

struct velocity_control {
    float tracked_mps; /* the command after its slew limit: what the loop follows */
    float earlier_mps[VELOCITY_CONTROL_DELAY_MS]; /* tracked_mps of the ticks before, oldest at `next` */
    uint8_t next;
    float integral; /* effort */
    float effort;   /* last output */
};

/* Takes over a wheel that turns at `speed_mps` under `effort`, without a jump of the command. */
void velocity_control_reset(struct velocity_control *control, float speed_mps, float effort);

/* One tick; returns the effort. `still`: the wheel has not moved for a while. */
float velocity_control_step(struct velocity_control *control, const struct velocity_gains *gains,
                            float command_mps, float measured_mps, bool still);

#endif
