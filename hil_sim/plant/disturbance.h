/* Torque that nobody commanded: coloured noise at the wheels. */
#ifndef PLANT_DISTURBANCE_H
#define PLANT_DISTURBANCE_H

#include "hidden.h"

struct disturbance {
    double value[PLANT_WHEELS]; /* of variance 1 */
};

/* Torque at a wheel during plant step `step`, N m. To be asked step by step. */
double disturbance_nm(struct disturbance *disturbance, const struct plant_hidden_disturbance *params,
                      int wheel, uint64_t seed, uint64_t step);

#endif
