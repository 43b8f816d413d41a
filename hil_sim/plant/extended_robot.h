/* The robot with unmodelled effects: its state beyond that of the plain robot, and its step. */
#ifndef PLANT_EXTENDED_ROBOT_H
#define PLANT_EXTENDED_ROBOT_H

#include <stdbool.h>

#include "plant_internal.h"
#include "unmodelled_effects.h"

struct extended_robot;

/* Gives the plant these effects, and the extended state they need when it has none yet. False: bad numbers or
 * no memory, and nothing has changed. */
bool extended_set_effects(struct plant *plant, const struct plant_unmodelled_effects *effects);

/* One step of a plant that has an extended robot, in place of the plain step. */
void extended_step(struct plant *plant);

/* The duties of the bridge inputs, as the driver model takes them. */
void extended_set_bridge(struct plant *plant, int wheel, double in1_duty, double in2_duty);

/* Takes with what dry friction the wheels are held. */
void extended_hold(struct plant *plant);

/* Turned by hand. */
void extended_turn_wheel(struct plant *plant, int wheel, double angle_rad);

/* The angle that the encoder's disc shows after the last step, and one step before. */
struct extended_disc {
    double before_rad, after_rad;
    double acceleration_radps2; /* upper bound */
};
struct extended_disc extended_disc(const struct plant *plant, int wheel);

/* Counts at that fraction of the last step. */
int64_t extended_count(const struct plant *plant, int wheel, double share);

/* Expected angle of the encoder before quantisation: lost counts are subtracted by their mean. */
double extended_measured_rad(const struct plant *plant, int wheel);

void extended_destroy(struct extended_robot *robot);

#endif
