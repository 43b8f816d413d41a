/* Outputs of a plant: its sensors, and the true state that no sensor measures. */
#ifndef PLANT_READINGS_H
#define PLANT_READINGS_H

#include <stdint.h>

#include "plant_params.h"

#ifdef __cplusplus
extern "C" {
#endif

struct plant;

/* The true state, which no sensor of the robot measures. */
struct plant_state {
    uint64_t steps; /* taken since creation */
    double time_s;
    double wheel_angle_rad[PLANT_WHEELS];
    double wheel_speed_radps[PLANT_WHEELS];
    double motor_current_a[PLANT_WHEELS]; /* at the end of the last step */
    double x_m, y_m, theta_rad;           /* middle of the axle; theta not wrapped, left turn positive */
    double speed_mps, yaw_rate_radps;
    double battery_open_v;    /* open circuit at the present charge */
    double battery_v;         /* at the terminals */
    double battery_current_a; /* mean over the last step, discharge positive */
    double battery_charge;    /* 0..1 */
    double kinetic_energy_j;  /* of everything that moves */
    double magnetic_energy_j; /* of the windings */
};

void plant_state(const struct plant *plant, struct plant_state *out);

/* Quadrature counts (x4) since creation, with the sensor's errors. */
int64_t plant_encoder_position(const struct plant *plant, int wheel);

/* The same at this fraction (0..1) of the last step, assuming constant speed within it. */
int64_t plant_encoder_within(const struct plant *plant, int wheel, double share);

/* How long from there, in steps, that count is guaranteed to last: up to the next edge within the last step,
 * or else to the end of a step before which no edge can come, however the bridges are driven. */
double plant_encoder_quiet_steps(const struct plant *plant, int wheel, double share);

/* Terminal voltage with the sense line's noise. */
double plant_battery_v(const struct plant *plant);

#ifdef __cplusplus
}
#endif

#endif
