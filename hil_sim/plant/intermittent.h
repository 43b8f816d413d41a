/* What acts on the robot for some time only: a carpet, a push, a bearing that binds, knocks. */
#ifndef PLANT_INTERMITTENT_H
#define PLANT_INTERMITTENT_H

#include <stdbool.h>
#include <stdint.h>

#include "chassis.h"
#include "unmodelled_effects.h"

/* The run that is under way: one begins whenever both wheels are let go. */
struct intermittent {
    uint64_t run;
    uint64_t begin_step;
    bool held;
};

/* On what these effects depend. */
struct intermittent_view {
    const struct chassis *chassis;
    uint64_t seed, step;
};

/* Takes the dry friction with which each wheel is held from plant step `step` on. */
void intermittent_hold(struct intermittent *state, const double hold_nm[PLANT_WHEELS], uint64_t step);

/* Dry friction at a wheel's axle, N m. */
double intermittent_dry_nm(const struct intermittent *state, const struct plant_intermittent_effects *params,
                           const struct intermittent_view *view, int wheel);

/* Force on one side of the body, N, forward positive. */
double intermittent_side_n(const struct intermittent *state, const struct plant_intermittent_effects *params,
                           const struct intermittent_view *view, int wheel);

#endif
