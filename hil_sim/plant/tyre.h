/* Tyres of finite grip: force from slip. */
#ifndef PLANT_TYRE_H
#define PLANT_TYRE_H

#include "unmodelled_effects.h"

/* Force on the floor's contact, N, that drives the body forward, of a rim that runs at `rim_mps` over a floor
 * that passes at `floor_mps`, pressed down with `load_n`. */
double tyre_force_n(const struct plant_tyre_effects *params, double load_n, double rim_mps, double floor_mps);

#endif
