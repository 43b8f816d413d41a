/* The body between the wheels: mass referred to each rim, resistance to yaw, and the true pose. */
#ifndef PLANT_CHASSIS_H
#define PLANT_CHASSIS_H

#include "friction.h"
#include "plant_params.h"

struct chassis {
    struct plant_chassis_params params;
    struct friction_mass mass; /* at the rims, without viscous friction */
    double x_m, y_m, theta_rad;
    double cos_theta, sin_theta;
};

void chassis_init(struct chassis *chassis, const struct plant_params *params);

/* Largest force at the rims, N, with which tyres and caster resist yaw at these rim speeds. */
double chassis_scrub_n(const struct chassis *chassis, const struct friction_speeds *rims);

/* Moves the pose by what the rims rolled. */
void chassis_roll(struct chassis *chassis, double left_m, double right_m);

#endif
