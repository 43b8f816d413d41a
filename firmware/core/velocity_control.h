/* One wheel's speed loop: PI with feedforward kS sign(v) + kV v + kA a, 1 kHz. */
#ifndef VELOCITY_CONTROL_H
#define VELOCITY_CONTROL_H

#include <stdbool.h>
#include <stdint.h>

#include "wheel_speed.h"

/* Feedforward of one wheel in one direction. */
struct feedforward {
    float ks; /* effort */
    float kv; /* effort per m/s */
    float ka; /* effort per m/s^2 */
};

struct velocity_gains {
    float kp; /* effort per m/s */
    float ki; /* effort per m */
    struct feedforward forward;
    struct feedforward reverse;
    float kick_effort;       /* added from standstill until the wheel turns */
    uint32_t kick_ms;        /* at most this long */
    float metres_per_count;  /* 0: speed is known at all times */
    float effort_limit;      /* 0..1 */
    float effort_slew_per_s; /* effort/s */
    float accel_limit_mps2;  /* slew of the tracked speed */
};

enum {
    /* Length of the reference history. */
    VELOCITY_CONTROL_MEMORY_MS = 64,
    /* Gains hold while a count takes no longer than this, and fall with the rate of counts beyond. With the
     * default parameters a wheel gains 3.8 m/s a second per unit effort: the loop crosses at 7.6 rad/s. At 64
     * counts a turn and 0.02 to 0.1 m/s, 50 ms let the loop oscillate at 0.1 m/s and 25 ms settled too slowly
     * at 0.02 m/s. */
    VELOCITY_CONTROL_FULL_GAIN_MS = 30,
};

struct velocity_control {
    float tracked_mps; /* the command after its slew limit: what the loop follows */
    float earlier_mps[VELOCITY_CONTROL_MEMORY_MS]; /* tracked_mps of the ticks before, oldest at `next` */
    uint8_t next;
    float integral;     /* effort */
    float effort;       /* last output */
    uint32_t kicked_ms; /* of the kick that is under way */
    bool turning;       /* it has moved since it stood: no more kick */
};

/* Takes over a wheel that turns at `speed_mps` under `effort`, without a jump of the command. */
void velocity_control_reset(struct velocity_control *control, float speed_mps, float effort);

/* One tick; returns the effort, or what is not finite when any number that it rests on is not. `still`: the
 * wheel has not moved for a while. */
float velocity_control_step(struct velocity_control *control, const struct velocity_gains *gains,
                            float command_mps, const struct wheel_measure *measured, bool still);

#endif
