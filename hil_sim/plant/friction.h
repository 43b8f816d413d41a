/* Dry friction with exact standstill, for two rims that share a body. */
#ifndef PLANT_FRICTION_H
#define PLANT_FRICTION_H

#include "plant_params.h"

/* Largest dry friction torque at a wheel speed, N m. */
double friction_limit_nm(const struct plant_friction_params *params, double speed_radps);

/* Symmetric 2 x 2 mass matrix referred to the two rims, viscous friction of one step included, kg. */
struct friction_mass {
    double left, right, cross;
};

/* Impulses that dry friction may at most exert during one step, N s. */
struct friction_limits {
    double left, right;
    double twist; /* against the rims running at different speeds */
};

struct friction_speeds {
    double left, right; /* at the rims, m/s */
};

/* Rim speeds after one step, from the momentum that the step would end with without dry friction. */
struct friction_speeds friction_solve(const struct friction_mass *mass, double momentum_left,
                                      double momentum_right, const struct friction_limits *limits);

#endif
