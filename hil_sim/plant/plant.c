/* A plant from its creation to its end: driven at its bridges, advanced step by step. */
#include "plant.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "extended_robot.h"
#include "plain_robot.h"
#include "plant_internal.h"

/* A bound on a wheel's acceleration, rad/s^2: twice the supply across the winding (a reversal at full speed)
 * on wheel and rotor alone, as if the robot weighed nothing, and twice that for what the other wheel adds. */
static double fastest_change(const struct plant_params *params, const struct plant_wheel_params *wheel)
{
    const struct plant_motor_params *motor = &wheel->motor;
    const double torque_nm =
        motor->emf_v_per_radps * motor->gear_ratio * 2.0 * params->battery.full_v / motor->resistance_ohm +
        wheel->friction.breakaway_nm;
    const double inertia_kgm2 =
        wheel->inertia_kgm2 + motor->rotor_inertia_kgm2 * motor->gear_ratio * motor->gear_ratio;
    return inertia_kgm2 > 0.0 ? 2.0 * torque_nm / inertia_kgm2 : INFINITY;
}

struct plant *plant_create(const struct plant_params *params, uint64_t seed)
{
    if (plant_params_problem(params) != NULL) {
        return NULL;
    }
    struct plant *plant = calloc(1, sizeof *plant);
    if (plant == NULL) {
        return NULL;
    }
    plant->params = *params;
    plant->seed = seed;
    battery_init(&plant->battery, &params->battery);
    chassis_init(&plant->chassis, params);
    plant->mass = plant->chassis.mass;
    plant->mass.left += rim_viscous_kg(&params->wheel[0]);
    plant->mass.right += rim_viscous_kg(&params->wheel[1]);
    for (int i = 0; i < PLANT_WHEELS; i++) {
        const struct plant_wheel_params *wheel = &params->wheel[i];
        motor_init(&plant->motor[i], &wheel->motor, &params->bridge);
        plant->emf_per_speed[i] = wheel->motor.emf_v_per_radps * wheel->motor.gear_ratio / wheel->radius_m;
        plant->acceleration_radps2[i] = fastest_change(params, wheel);
    }
    return plant;
}

void plant_destroy(struct plant *plant)
{
    if (plant != NULL) {
        extended_destroy(plant->extended);
        free(plant->recorder);
    }
    free(plant);
}

static bool is_wheel(int wheel)
{
    return wheel >= 0 && wheel < PLANT_WHEELS;
}

void plant_set_bridge(struct plant *plant, int wheel, double in1_duty, double in2_duty)
{
    if (!is_wheel(wheel)) {
        return;
    }
    plant->asked_duty[wheel][0] = in1_duty;
    plant->asked_duty[wheel][1] = in2_duty;
    if (plant->extended != NULL) {
        extended_set_bridge(plant, wheel, in1_duty, in2_duty);
    } else {
        motor_set_bridge(&plant->motor[wheel], in1_duty, in2_duty);
    }
}

void plant_hold_wheel(struct plant *plant, int wheel, double torque_nm)
{
    if (is_wheel(wheel) && torque_nm >= 0.0) {
        plant->hold_nm[wheel] = torque_nm;
        if (plant->extended != NULL) {
            extended_hold(plant);
        }
    }
}

void plant_cut_off_battery(struct plant *plant, bool cut_off)
{
    battery_cut_off(&plant->battery, cut_off);
}

void plant_turn_wheel(struct plant *plant, int wheel, double angle_rad)
{
    if (is_wheel(wheel)) {
        plant->angle_rad[wheel] += angle_rad;
        plant->angle_before_rad[wheel] += angle_rad;
        if (plant->extended != NULL) {
            extended_turn_wheel(plant, wheel, angle_rad);
        }
    }
}

void plant_place(struct plant *plant, double x_m, double y_m, double theta_rad)
{
    struct chassis *chassis = &plant->chassis;
    chassis->x_m = x_m;
    chassis->y_m = y_m;
    chassis->theta_rad = theta_rad;
    chassis->cos_theta = cos(theta_rad);
    chassis->sin_theta = sin(theta_rad);
}

bool plant_set_unmodelled_effects(struct plant *plant, const struct plant_unmodelled_effects *effects)
{
    return extended_set_effects(plant, effects);
}

void plant_advance(struct plant *plant, uint64_t steps)
{
    if (plant->extended == NULL && plant->recorder == NULL) {
        for (uint64_t i = 0; i < steps; i++) {
            plain_step(plant);
        }
        return;
    }
    for (uint64_t i = 0; i < steps; i++) {
        if (plant->extended != NULL) {
            extended_step(plant);
        } else {
            plain_step(plant);
        }
        if (plant->recorder != NULL) {
            recorder_step(plant);
        }
    }
}

void plant_replay(struct plant *plant, const double (*efforts)[PLANT_WHEELS], size_t count,
                  uint64_t steps_each)
{
    for (size_t k = 0; k < count; k++) {
        for (int i = 0; i < PLANT_WHEELS; i++) {
            const double low = 1.0 - fabs(efforts[k][i]);
            plant_set_bridge(plant, i, efforts[k][i] >= 0.0 ? 1.0 : low, efforts[k][i] >= 0.0 ? low : 1.0);
        }
        plant_advance(plant, steps_each);
    }
}
