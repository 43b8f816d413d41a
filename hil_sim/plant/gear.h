/* A gearbox with a gap and a spring between motor and wheel, or a hub that slips on its shaft. */
#ifndef PLANT_GEAR_H
#define PLANT_GEAR_H

#include <stdbool.h>

#include "unmodelled_effects.h"

/* Motor and wheel are two bodies. */
bool gear_is_elastic(const struct plant_gear_effects *params);

/* Torque at the wheel, N m, that turns the wheel forward and the motor back. `twist_rad` is how far the motor
 * is ahead, `rate_radps` how fast that grows, `motor_kgm2` the motor's inertia as the wheel feels it;
 * `slipped_rad` is how far the hub has turned on its shaft. */
double gear_torque_nm(const struct plant_gear_effects *params, int wheel, double motor_kgm2, double twist_rad,
                      double rate_radps, double *slipped_rad);

#endif
