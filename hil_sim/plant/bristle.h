/* Dry friction of bristles that bend before they slide. */
#ifndef PLANT_BRISTLE_H
#define PLANT_BRISTLE_H

#include "unmodelled_effects.h"

/* Friction torque at a wheel, N m, against positive speed; `bend_rad` is the bristles' state, which moves on
 * by `span_s`. */
double bristle_torque_nm(const struct plant_bristle_effects *params, int wheel, double speed_radps,
                         double span_s, double *bend_rad);

#endif
