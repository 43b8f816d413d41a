/* From commands to the effort that the bridges apply: effort mode, velocity mode, braked. */
#ifndef DRIVE_H
#define DRIVE_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"
#include "tuning.h"
#include "velocity_control.h"

struct drive {
    uint8_t mode;              /* enum proto_mode */
    float command[HAL_WHEELS]; /* effort or m/s, by mode */
    struct velocity_control control[HAL_WHEELS];
    bool take_over;                 /* velocity mode begins with the next tick */
    int16_t applied_e4[HAL_WHEELS]; /* what the bridges apply now, forward positive */
    bool not_finite;                /* the last step had no effort to apply, and braked */
};

/* Braked and at rest. */
void drive_init(struct drive *drive);

/* A new command; the bridges follow at the next tick. */
void drive_command(struct drive *drive, uint8_t mode, float left, float right);

/* Brakes both wheels at once. */
void drive_brake(struct drive *drive);

/* One tick: works out the efforts and hands them to the bridges. Where an effort is not a number, brakes both
 * wheels instead. */
void drive_step(struct drive *drive, const struct tuning *tuning,
                const struct wheel_measure speed[HAL_WHEELS], const bool still[HAL_WHEELS]);

/* The command as it is logged: 1e-4 effort or mm/s. */
int16_t drive_logged_command(const struct drive *drive, int wheel);

#endif
