/* The robot that stands in for reality: made from its numbers, driven at its bridges, advanced in time. */
#ifndef PLANT_H
#define PLANT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "plant_params.h"
#include "readings.h"
#include "recorder.h"
#include "unmodelled_effects.h"

#ifdef __cplusplus
extern "C" {
#endif

/* NULL when plant_params_problem finds one, or memory is out. */
struct plant *plant_create(const struct plant_params *params, uint64_t seed);
void plant_destroy(struct plant *plant);

/* Fraction of the PWM period for which each input of the wheel's bridge is high, from the period's
   beginning: both high brakes, both low leaves the motor to the diodes. Clamped to 0..1; holds from the next
   step. */
void plant_set_bridge(struct plant *plant, int wheel, double in1_duty, double in2_duty);

/* Steps of PLANT_STEP_US each; the result does not depend on how a span is split into calls. */
void plant_advance(struct plant *plant, uint64_t steps);

/* Drives with one pair of efforts after the other (drive and brake, 0 brakes), each for so many steps. */
void plant_replay(struct plant *plant, const double (*efforts)[PLANT_WHEELS], size_t count,
                  uint64_t steps_each);

/* Holds a wheel by dry friction of this torque at its axle, as a hand or a kerb does; 0 lets go. */
void plant_hold_wheel(struct plant *plant, int wheel, double torque_nm);

/* Cuts the battery off, as a fuse or a protection circuit does: the bridges' capacitor is then the supply. */
void plant_cut_off_battery(struct plant *plant, bool cut_off);

/* Turns a lifted wheel by hand; the robot stays where it is. */
void plant_turn_wheel(struct plant *plant, int wheel, double angle_rad);

/* Moves the robot to another pose; wheels and all other state are unchanged. */
void plant_place(struct plant *plant, double x_m, double y_m, double theta_rad);

/* Gives a robot these effects from now on; what they have done so far (heat, charge, phase) goes on. False:
   bad numbers or no memory, and nothing has changed. */
bool plant_set_unmodelled_effects(struct plant *plant, const struct plant_unmodelled_effects *effects);

#ifdef __cplusplus
}
#endif

#endif
