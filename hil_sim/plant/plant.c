/* One step of the whole robot: battery, bridges and motors, friction and ground, pose. */
#include "plant.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "hidden_robot.h"
#include "interior.h"
#include "recorder.h"
#include "sensor.h"

static const double step_s = PLANT_STEP_US * 1e-6;

double plant_viscous_kg(const struct plant_wheel_params *wheel)
{
    return step_s * wheel->friction.viscous_nms_per_rad / (wheel->radius_m * wheel->radius_m);
}

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
    plant->mass.left += plant_viscous_kg(&params->wheel[0]);
    plant->mass.right += plant_viscous_kg(&params->wheel[1]);
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
        hidden_destroy(plant->hidden);
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
    if (plant->hidden != NULL) {
        hidden_set_bridge(plant, wheel, in1_duty, in2_duty);
    } else {
        motor_set_bridge(&plant->motor[wheel], in1_duty, in2_duty);
    }
}

void plant_hold_wheel(struct plant *plant, int wheel, double torque_nm)
{
    if (is_wheel(wheel) && torque_nm >= 0.0) {
        plant->hold_nm[wheel] = torque_nm;
    }
}

void plant_turn_wheel(struct plant *plant, int wheel, double angle_rad)
{
    if (is_wheel(wheel)) {
        plant->angle_rad[wheel] += angle_rad;
        plant->angle_before_rad[wheel] += angle_rad;
        if (plant->hidden != NULL) {
            hidden_turn_wheel(plant, wheel, angle_rad);
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

double plant_dry_impulse(const struct plant_wheel_params *wheel, double rim_speed, double hold_nm)
{
    const double torque = friction_limit_nm(&wheel->friction, rim_speed / wheel->radius_m) + hold_nm;
    return step_s * torque / wheel->radius_m;
}

static void step(struct plant *plant)
{
    const struct plant_wheel_params *wheel = plant->params.wheel;
    const struct friction_speeds before = plant->rims;
    const double supply_v = battery_terminal_v(&plant->battery);

    const struct motor_flow left =
        motor_step(&plant->motor[0], plant->emf_per_speed[0] * before.left, supply_v);
    const struct motor_flow right =
        motor_step(&plant->motor[1], plant->emf_per_speed[1] * before.right, supply_v);
    battery_step(&plant->battery, left.supply_charge_as + right.supply_charge_as);

    const struct friction_mass *mass = &plant->chassis.mass;
    const double momentum_left = mass->left * before.left + mass->cross * before.right +
                                 plant->emf_per_speed[0] * left.motor_charge_as;
    const double momentum_right = mass->cross * before.left + mass->right * before.right +
                                  plant->emf_per_speed[1] * right.motor_charge_as;
    const struct friction_limits limits = {
        .left = plant_dry_impulse(&wheel[0], before.left, plant->hold_nm[0]),
        .right = plant_dry_impulse(&wheel[1], before.right, plant->hold_nm[1]),
        .twist = step_s * chassis_scrub_n(&plant->chassis, &before),
    };
    plant->rims = friction_solve(&plant->mass, momentum_left, momentum_right, &limits);

    const double left_m = 0.5 * step_s * (before.left + plant->rims.left);
    const double right_m = 0.5 * step_s * (before.right + plant->rims.right);
    plant->angle_before_rad[0] = plant->angle_rad[0];
    plant->angle_before_rad[1] = plant->angle_rad[1];
    plant->angle_rad[0] += left_m / wheel[0].radius_m;
    plant->angle_rad[1] += right_m / wheel[1].radius_m;
    chassis_roll(&plant->chassis, left_m, right_m);
    plant->steps++;
}

void plant_advance(struct plant *plant, uint64_t steps)
{
    if (plant->hidden == NULL && plant->recorder == NULL) {
        for (uint64_t i = 0; i < steps; i++) {
            step(plant);
        }
        return;
    }
    for (uint64_t i = 0; i < steps; i++) {
        if (plant->hidden != NULL) {
            hidden_step(plant);
        } else {
            step(plant);
        }
        if (plant->recorder != NULL) {
            recorder_look(plant);
        }
    }
}

int64_t plant_encoder_position(const struct plant *plant, int wheel)
{
    if (!is_wheel(wheel)) {
        return 0;
    }
    if (plant->hidden != NULL) {
        return hidden_count(plant, wheel, 1.0);
    }
    return sensor_count(&plant->params.wheel[wheel].encoder, plant->seed, wheel, plant->angle_rad[wheel]);
}

int64_t plant_encoder_within(const struct plant *plant, int wheel, double share)
{
    if (!is_wheel(wheel)) {
        return 0;
    }
    if (plant->hidden != NULL) {
        return hidden_count(plant, wheel, share);
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
    struct hidden_disc disc = {.before_rad = plant->angle_before_rad[wheel],
                               .after_rad = plant->angle_rad[wheel],
                               .acceleration_radps2 = plant->acceleration_radps2[wheel]};
    if (plant->hidden != NULL) {
        disc = hidden_disc(plant, wheel);
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
