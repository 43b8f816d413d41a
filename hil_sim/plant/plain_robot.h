/* The robot that plant_params describes, without unmodelled effects: its step, and friction referred to the
 * rims. */
#ifndef PLANT_PLAIN_ROBOT_H
#define PLANT_PLAIN_ROBOT_H

#include "plant_internal.h"

/* One step's viscous friction referred to the rim. */
double rim_viscous_kg(const struct plant_wheel_params *wheel);

/* Largest impulse of dry friction in one step, with that of a hand that holds the wheel. */
double rim_dry_impulse(const struct plant_wheel_params *wheel, double rim_speed, double hold_nm);

/* One step of a plant without unmodelled effects. */
void plain_step(struct plant *plant);

#endif
