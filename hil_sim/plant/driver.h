/* A motor driver that does not pass on the effort it is given: late, lagging, dead, limited, uneven. */
#ifndef PLANT_DRIVER_H
#define PLANT_DRIVER_H

#include <stdbool.h>
#include <stdint.h>

#include "hidden.h"

enum { DRIVER_LINE_STEPS = 400000 / PLANT_STEP_US + 1 };

struct driver {
    double asked; /* effort, -1..1 */
    bool asked_to_float;
    float line[DRIVER_LINE_STEPS]; /* efforts on their way, a ring */
    uint32_t line_at;
    double lagged;
    double speed_mps; /* as the governor has it */
    double given;     /* effort that the bridge makes now; NAN: it floats */
};

void driver_init(struct driver *driver);

/* What the bridge inputs ask for. */
void driver_ask(struct driver *driver, double in1_duty, double in2_duty);

/* One step on: the effort that the bridge makes; NAN when it floats. */
double driver_step(struct driver *driver, const struct plant_hidden_driver *params, int wheel, uint64_t seed,
                   uint64_t step, double rim_mps);

#endif
