/* The parameters of the paper's robot, and the bounds on every robot's. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "plant_params.h"

/* Where the numbers come from is in README.md; calibrate.py finds those marked "fitted". */
static const struct plant_wheel_params msrp_wheel = {
    .radius_m = 0.0635,   /* Stingray kit, 5 inch wheels */
    .inertia_kgm2 = 8e-4, /* 0.4 kg of tyre and rim, mass towards the rim */
    .motor = {.resistance_ohm = 6.0,
              .inductance_h = 2.0e-3,
              .emf_v_per_radps = 0.01494,
              .rotor_inertia_kgm2 = 4.59e-6,
              .gear_ratio = 30.0},
    .friction = {.coulomb_nm = 0.0100,
                 .breakaway_nm = 0.0847,
                 .stribeck_radps = 1.33,
                 .viscous_nms_per_rad = 0.006},
    .encoder = {.counts_per_rev = 2400.0, .edge_error_count = 0.15},
};

static const struct plant_params msrp = {
    .chassis = {.mass_kg = 5.0,
                .yaw_inertia_kgm2 = 0.06,
                .wheelbase_m = 0.283,
                .scrub_nm = 0.0871,
                .scrub_curvature_per_m = 0.5},
    .battery = {.full_v = 12.6,
                .empty_v = 10.8,
                .capacity_ah = 5.0,
                .initial_charge = 1.0,
                .resistance_ohm = 0.12,
                .electronics_a = 0.25,
                .sense_noise_v = 0.01},
    .bridge = {.diode_drop_v = 0.8},
};

void plant_params_msrp(struct plant_params *out)
{
    *out = msrp;
    out->wheel[0] = msrp_wheel;
    out->wheel[1] = msrp_wheel;
}

struct range {
    const char *name;
    size_t offset;
    double low, high;
};

#define WHEEL(field, low, high)                                                                              \
    {                                                                                                        \
#field, offsetof(struct plant_wheel_params, field), low, high                                        \
    }
#define ROBOT(field, low, high)                                                                              \
    {                                                                                                        \
#field, offsetof(struct plant_params, field), low, high                                              \
    }

/* Bounds for robots that one person can carry; the lower ones keep the step stable. */
static const struct range wheel_ranges[] = {
    WHEEL(radius_m, 0.005, 0.5),
    WHEEL(inertia_kgm2, 0.0, 1.0),
    WHEEL(motor.resistance_ohm, 0.02, 1000.0),
    WHEEL(motor.inductance_h, 1e-6, 0.1),
    WHEEL(motor.emf_v_per_radps, 1e-4, 10.0),
    WHEEL(motor.rotor_inertia_kgm2, 0.0, 0.01),
    WHEEL(motor.gear_ratio, 0.1, 2000.0),
    WHEEL(friction.coulomb_nm, 0.0, 100.0),
    WHEEL(friction.breakaway_nm, 0.0, 100.0),
    WHEEL(friction.stribeck_radps, 0.01, 1000.0),
    WHEEL(friction.viscous_nms_per_rad, 0.0, 100.0),
    WHEEL(encoder.counts_per_rev, 4.0, 1e7),
    WHEEL(encoder.edge_error_count, 0.0, 0.45),
};

static const struct range robot_ranges[] = {
    ROBOT(chassis.mass_kg, 0.05, 200.0),
    ROBOT(chassis.yaw_inertia_kgm2, 1e-6, 100.0),
    ROBOT(chassis.wheelbase_m, 0.02, 3.0),
    ROBOT(chassis.scrub_nm, 0.0, 100.0),
    ROBOT(chassis.scrub_curvature_per_m, 0.0, 100.0),
    ROBOT(battery.full_v, 1.0, 100.0),
    ROBOT(battery.empty_v, 0.0, 100.0),
    ROBOT(battery.capacity_ah, 0.01, 1000.0),
    ROBOT(battery.initial_charge, 0.0, 1.0),
    ROBOT(battery.resistance_ohm, 0.0, 10.0),
    ROBOT(battery.electronics_a, 0.0, 20.0),
    ROBOT(battery.sense_noise_v, 0.0, 1.0),
    ROBOT(bridge.diode_drop_v, 0.0, 3.0),
};

/* One line per thread; a caller prints it before it asks again. */
static _Thread_local char problem[160];

static bool out_of_range(const void *base, const char *prefix, const struct range *range)
{
    double value = 0.0;
    memcpy(&value, (const char *)base + range->offset, sizeof value);
    if (value >= range->low && value <= range->high) {
        return false;
    }
    (void)snprintf(problem, sizeof problem, "%s%s is %g, outside %g..%g", prefix, range->name, value,
                   range->low, range->high);
    return true;
}

static const char *wheel_problem(const struct plant_wheel_params *wheel, const char *prefix)
{
    for (size_t i = 0; i < sizeof wheel_ranges / sizeof wheel_ranges[0]; i++) {
        if (out_of_range(wheel, prefix, &wheel_ranges[i])) {
            return problem;
        }
    }
    if (wheel->friction.breakaway_nm < wheel->friction.coulomb_nm) {
        (void)snprintf(problem, sizeof problem, "%sfriction.breakaway_nm is %g, below friction.coulomb_nm %g",
                       prefix, wheel->friction.breakaway_nm, wheel->friction.coulomb_nm);
        return problem;
    }
    if (wheel->encoder.counts_per_rev != floor(wheel->encoder.counts_per_rev)) {
        (void)snprintf(problem, sizeof problem, "%sencoder.counts_per_rev is %g, not a whole number", prefix,
                       wheel->encoder.counts_per_rev);
        return problem;
    }
    return NULL;
}

/* The supply's lag of one step (battery.c) is stable while the battery is stiffer than both motors. */
static bool battery_too_soft(const struct plant_params *params, int wheel, const char *prefix)
{
    const double limit_ohm = 0.4 * params->wheel[wheel].motor.resistance_ohm;
    if (params->battery.resistance_ohm <= limit_ohm) {
        return false;
    }
    (void)snprintf(problem, sizeof problem,
                   "battery.resistance_ohm is %g, above 0.4 times %smotor.resistance_ohm %g",
                   params->battery.resistance_ohm, prefix, params->wheel[wheel].motor.resistance_ohm);
    return true;
}

/* The back-EMF of a step is that of its beginning (plant.c). That is stable and creates no energy as long as
 * a wheel's back-EMF takes less than half of its speed within one step, whether resistance or inductance
 * limits the current that does it. The smallest mass referred to a rim is that of driving straight or of
 * turning on the spot. */
static bool motor_too_strong(const struct plant_params *params, int wheel, const char *prefix)
{
    const double step_s = PLANT_STEP_US * 1e-6;
    const struct plant_wheel_params *part = &params->wheel[wheel];
    const struct plant_motor_params *motor = &part->motor;
    const double radius_m = part->radius_m;
    const double turning =
        part->inertia_kgm2 + motor->gear_ratio * motor->gear_ratio * motor->rotor_inertia_kgm2;
    const double wheelbase_m = params->chassis.wheelbase_m;
    const double forward_kg = params->chassis.mass_kg / 2.0;
    const double yaw_kg = 2.0 * params->chassis.yaw_inertia_kgm2 / (wheelbase_m * wheelbase_m);
    const double min_kg = fmin(forward_kg, yaw_kg) + turning / (radius_m * radius_m);
    const double emf_per_speed = motor->emf_v_per_radps * motor->gear_ratio / radius_m;
    const double admittance = fmin(1.0 / motor->resistance_ohm, step_s / motor->inductance_h);

    if (emf_per_speed * emf_per_speed * admittance * step_s < 0.5 * min_kg) {
        return false;
    }
    (void)snprintf(problem, sizeof problem,
                   "%smotor.emf_v_per_radps is %g, too strong for the inertia behind gear_ratio %g", prefix,
                   motor->emf_v_per_radps, motor->gear_ratio);
    return true;
}

const char *plant_params_problem(const struct plant_params *params)
{
    static const char *const prefixes[PLANT_WHEELS] = {"wheel[0].", "wheel[1]."};

    if (params == NULL) {
        return "no parameters";
    }
    for (size_t i = 0; i < sizeof robot_ranges / sizeof robot_ranges[0]; i++) {
        if (out_of_range(params, "", &robot_ranges[i])) {
            return problem;
        }
    }
    for (int i = 0; i < PLANT_WHEELS; i++) {
        if (wheel_problem(&params->wheel[i], prefixes[i]) != NULL ||
            battery_too_soft(params, i, prefixes[i]) || motor_too_strong(params, i, prefixes[i])) {
            return problem;
        }
    }
    if (params->battery.empty_v > params->battery.full_v) {
        (void)snprintf(problem, sizeof problem, "battery.empty_v is %g, above battery.full_v %g",
                       params->battery.empty_v, params->battery.full_v);
        return problem;
    }
    return NULL;
}
