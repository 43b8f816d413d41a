/* Sensor models: counted encoder edges and a noisy voltage. */
#ifndef PLANT_SENSOR_H
#define PLANT_SENSOR_H

#include <stdint.h>

#include "plant_params.h"

/* Quadrature count at a wheel angle, on a disc whose edges are misplaced according to the seed. */
int64_t sensor_count(const struct plant_encoder_params *params, uint64_t seed, int wheel, double angle_rad);

/* The wheel angles at which that count begins and at which the next one does. */
struct sensor_edges {
    double below_rad, above_rad;
};
void sensor_edges(const struct plant_encoder_params *params, uint64_t seed, int wheel, double angle_rad,
                  struct sensor_edges *out);

/* An error between -largest and largest that depends on seed and step alone. */
double sensor_noise(uint64_t seed, uint64_t step, double largest);

#endif
