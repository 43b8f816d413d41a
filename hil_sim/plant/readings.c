/* Outputs of a plant: its sensors, and the true state that no sensor measures. */
#include "readings.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

#include "extended_robot.h"
#include "plant_internal.h"
#include "sensor.h"

static const double step_s = PLANT_STEP_US * 1e-6;

static bool is_wheel(int wheel)
{
    return wheel >= 0 && wheel < PLANT_WHEELS;
}

int64_t plant_encoder_position(const struct plant *plant, int wheel)
{
    if (!is_wheel(wheel)) {
        return 0;
    }
    if (plant->extended != NULL) {
        return extended_count(plant, wheel, 1.0);
    }
    return sensor_count(&plant->params.wheel[wheel].encoder, plant->seed, wheel, plant->angle_rad[wheel]);
}

int64_t plant_encoder_within(const struct plant *plant, int wheel, double share)
{
    if (!is_wheel(wheel)) {
        return 0;
    }
    if (plant->extended != NULL) {
        return extended_count(plant, wheel, share);
    }
    const double before = plant->angle_before_rad[wheel];
    const double angle = before + (plant->angle_rad[wheel] - before) * share;
    return sensor_count(&plant->params.wheel[wheel].encoder, plant->seed, wheel, angle);
}

double plant_encoder_quiet_steps(const struct plant *plant, int wheel, double share)
{
    if (!is_wheel(wheel)) {
        return INFINITY;
    }
    const struct plant_encoder_params *encoder = &plant->params.wheel[wheel].encoder;
    struct extended_disc disc = {.before_rad = plant->angle_before_rad[wheel],
                                 .after_rad = plant->angle_rad[wheel],
                                 .acceleration_radps2 = plant->acceleration_radps2[wheel]};
    if (plant->extended != NULL) {
        disc = extended_disc(plant, wheel);
    }
    const double before = disc.before_rad;
    const double moved = disc.after_rad - before;
    const double angle = before + moved * share;
    struct sensor_edges edges;
    sensor_edges(encoder, plant->seed, wheel, angle, &edges);

    /* Within the step that has been taken the wheel's motion is known. */
    const double ahead = moved > 0.0 ? edges.above_rad - angle : edges.below_rad - angle;
    if (moved != 0.0 && ahead / moved <= 1.0 - share) {
        return ahead / moved > 0.0 ? ahead / moved : 0.0;
    }
    /* Beyond its end: s = v t + a t^2 / 2 must not reach the nearer edge, whichever way the wheel turns. */
    const double end = disc.after_rad;
    const double room = fmin(edges.above_rad - end, end - edges.below_rad);
    const double acceleration = disc.acceleration_radps2;
    const double speed = fabs(moved) / step_s + acceleration * step_s; /* at the step's end, not its middle */
    const double quiet_s = acceleration < INFINITY && room > 0.0
                               ? 2.0 * room / (speed + sqrt(speed * speed + 2.0 * acceleration * room))
                               : 0.0;
    return 1.0 - share + floor(quiet_s / step_s);
}

double plant_battery_v(const struct plant *plant)
{
    const double noise = sensor_noise(plant->seed, plant->steps, plant->params.battery.sense_noise_v);
    const double volts = battery_terminal_v(&plant->battery) + noise;
    return volts > 0.0 ? volts : 0.0;
}

static double kinetic_energy_j(const struct plant *plant)
{
    const struct friction_mass *mass = &plant->chassis.mass;
    const struct friction_speeds *rims = &plant->rims;
    return 0.5 * mass->left * rims->left * rims->left + 0.5 * mass->right * rims->right * rims->right +
           mass->cross * rims->left * rims->right;
}

void plant_state(const struct plant *plant, struct plant_state *out)
{
    const struct friction_speeds *rims = &plant->rims;
    *out = (struct plant_state){
        .steps = plant->steps,
        .time_s = (double)plant->steps * PLANT_STEP_US / 1e6,
        .wheel_speed_radps = {rims->left / plant->params.wheel[0].radius_m,
                              rims->right / plant->params.wheel[1].radius_m},
        .x_m = plant->chassis.x_m,
        .y_m = plant->chassis.y_m,
        .theta_rad = plant->chassis.theta_rad,
        .speed_mps = 0.5 * (rims->left + rims->right),
        .yaw_rate_radps = (rims->right - rims->left) / plant->params.chassis.wheelbase_m,
        .battery_open_v = battery_open_v(&plant->battery),
        .battery_v = battery_terminal_v(&plant->battery),
        .battery_current_a = plant->battery.current_a,
        .battery_charge = battery_charge(&plant->battery),
        .kinetic_energy_j = kinetic_energy_j(plant),
    };
    for (int i = 0; i < PLANT_WHEELS; i++) {
        const double current_a = plant->motor[i].current_a;
        out->wheel_angle_rad[i] = plant->angle_rad[i];
        out->motor_current_a[i] = current_a;
        out->magnetic_energy_j += 0.5 * plant->params.wheel[i].motor.inductance_h * current_a * current_a;
    }
}
