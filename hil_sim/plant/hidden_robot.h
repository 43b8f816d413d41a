/* A robot with hidden effects: its own state and its own step. */
#ifndef PLANT_HIDDEN_ROBOT_H
#define PLANT_HIDDEN_ROBOT_H

#include "interior.h"

struct hidden;

/* One step of a plant that has `hidden`, in place of the plain one. */
void hidden_step(struct plant *plant);

/* What the bridge inputs ask for goes to the hidden driver. */
void hidden_set_bridge(struct plant *plant, int wheel, double in1_duty, double in2_duty);

/* Turned by hand. */
void hidden_turn_wheel(struct plant *plant, int wheel, double angle_rad);

/* The angle that the encoder's disc shows after the last step, and one step before. */
struct hidden_disc {
    double before_rad, after_rad;
    double acceleration_radps2; /* more than the disc ever has */
};
struct hidden_disc hidden_disc(const struct plant *plant, int wheel);

/* Counts at that share of the last step. */
int64_t hidden_count(const struct plant *plant, int wheel, double share);

/* Angle that the encoder means on average, without counting: counts lost are taken off as they are expected.
 */
double hidden_measured_rad(const struct plant *plant, int wheel);

void hidden_destroy(struct hidden *hidden);

#endif
