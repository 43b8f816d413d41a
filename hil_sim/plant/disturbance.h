/* Torque disturbance at the wheels: coloured noise. */
#ifndef PLANT_DISTURBANCE_H
#define PLANT_DISTURBANCE_H

#include <stdint.h>

#include "unmodelled_effects.h"

struct disturbance {
    double value[PLANT_WHEELS]; /* of variance 1 */
};

/* Torque at a wheel during plant step `step`, N m. To be called for each step in order. */
double disturbance_nm(struct disturbance *disturbance, const struct plant_disturbance_effects *params,
                      int wheel, uint64_t seed, uint64_t step);

#endif
