/* A motor driver with delay, lag, dead band, limits and direction-dependent gain. */
#ifndef PLANT_DRIVER_H
#define PLANT_DRIVER_H

#include <stdbool.h>
#include <stdint.h>

#include "unmodelled_effects.h"

enum { DRIVER_LINE_STEPS = 400000 / PLANT_STEP_US + 1 };

struct driver {
    double asked; /* effort, -1..1 */
    bool asked_to_float;
    float line[DRIVER_LINE_STEPS]; /* delay line, a ring */
    uint32_t line_at;
    double lagged;
    double speed_mps; /* the governor's filtered speed */
    double given;     /* effort that the bridge applies now; NAN: it floats */
};

void driver_init(struct driver *driver);

/* Takes the duties of the bridge inputs. */
void driver_ask(struct driver *driver, double in1_duty, double in2_duty);

/* One step: the effort that the bridge applies; NAN when it floats. */
double driver_step(struct driver *driver, const struct plant_driver_effects *params, int wheel, uint64_t seed,
                   uint64_t step, double rim_mps);

#endif
