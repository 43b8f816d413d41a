/* Bounds on the numbers of the unmodelled effects. */
#include "unmodelled_effects.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

struct bound {
    const char *name;
    size_t offset;
    size_t count;
    double low, high;
};

#define ONE(field, low, high)                                                                                \
    {                                                                                                        \
#field, offsetof(struct plant_unmodelled_effects, field), 1, low, high                               \
    }
#define TWO(field, low, high)                                                                                \
    {                                                                                                        \
#field, offsetof(struct plant_unmodelled_effects, field), PLANT_WHEELS, low, high                    \
    }

/* Upper bounds keep the step stable; a quantity that others are divided by has a lower one where it is used.
 */
static const struct bound bounds[] = {
    ONE(driver.delay_s, 0.0, 0.4),
    ONE(driver.lag_s, 0.0, 2.0),
    ONE(driver.deadband, 0.0, 0.9),
    ONE(driver.current_limit_a, 0.0, 1000.0),
    ONE(driver.speed_limit_mps, 0.0, 100.0),
    TWO(driver.reverse_gain, 0.0, 2.0),
    ONE(driver.floats_at_zero, 0.0, 1.0),
    ONE(driver.square_law, 0.0, 1.0),
    ONE(driver.dropout_every_s, 0.0, 1000.0),
    ONE(driver.dropout_s, 0.0, 100.0),
    TWO(driver.dropout_wheels, 0.0, 1.0),
    ONE(supply.polarisation_ohm, 0.0, 10.0),
    ONE(supply.polarisation_s, 0.0, 1e4),
    ONE(thermal.resistance_per_k, 0.0, 0.1),
    ONE(thermal.winding_j_per_k, 0.0, 1e6),
    ONE(thermal.winding_w_per_k, 0.0, 1e3),
    ONE(thermal.case_j_per_k, 0.0, 1e6),
    ONE(thermal.case_w_per_k, 0.0, 1e3),
    ONE(thermal.emf_per_k, 0.0, 0.01),
    TWO(bristle.coulomb_nm, 0.0, 100.0),
    TWO(bristle.breakaway_nm, 0.0, 100.0),
    ONE(bristle.stribeck_radps, 0.0, 1000.0),
    ONE(bristle.bend_rad, 0.0, 0.1),
    TWO(gear.lash_rad, 0.0, 2.0),
    ONE(gear.stiffness_nm_per_rad, 0.0, 2000.0),
    ONE(gear.damping, 0.0, 2.0),
    TWO(gear.slip_nm, 0.0, 100.0),
    TWO(gear.forward_flywheel_kgm2, 0.0, 1.0),
    ONE(tyre.grip, 0.0, 3.0),
    ONE(tyre.slip_at_peak, 0.0, 1.0),
    ONE(tyre.load_on_wheels, 0.0, 1.0),
    TWO(load.quadratic_nms2, 0.0, 1.0),
    TWO(load.ripple_nm, 0.0, 100.0),
    ONE(load.ripple_per_turn, 0.0, 1000.0),
    TWO(load.ripple_phase_rad, -10.0, 10.0),
    ONE(load.slope_rad, 0.0, 1.5),
    ONE(load.uphill_rad, -10.0, 10.0),
    ONE(load.patch_n, 0.0, 1000.0),
    ONE(load.patch_pitch_m, 0.0, 100.0),
    ONE(load.spring_n_per_m, 0.0, 1000.0),
    ONE(load.swing_kg, 0.0, 100.0),
    ONE(load.swing_hz, 0.0, 50.0),
    ONE(load.swing_damping, 0.0, 10.0),
    TWO(encoder.eccentricity_rad, 0.0, 0.5),
    TWO(encoder.eccentricity_phase_rad, -10.0, 10.0),
    TWO(encoder.dropout, 0.0, 1.0),
    ONE(encoder.dropout_at_radps, 0.0, 1e4),
    ONE(creep.drift_rad_per_m, -10.0, 10.0),
    ONE(creep.distance_scale, -0.9, 10.0),
    ONE(payload.mass_kg, 0.0, 200.0),
    ONE(payload.yaw_inertia_kgm2, 0.0, 100.0),
    ONE(payload.at_s, 0.0, 1e9),
    TWO(disturbance.torque_nm, 0.0, 100.0),
    ONE(disturbance.correlation_s, 0.0, 1000.0),
    ONE(disturbance.resting_mps, 0.0, 10.0),
    TWO(intermittent.carpet_nm, 0.0, 100.0),
    ONE(intermittent.carpet_from_s, 0.0, 1000.0),
    ONE(intermittent.carpet_room_s, 0.0, 1000.0),
    ONE(intermittent.carpet_for_s, 0.0, 1000.0),
    ONE(intermittent.carpet_from_m, -1000.0, 1000.0),
    ONE(intermittent.carpet_for_m, 0.0, 1000.0),
    TWO(intermittent.push_n, 0.0, 1000.0),
    ONE(intermittent.push_share, 0.0, 1.0),
    ONE(intermittent.push_from_s, 0.0, 1000.0),
    ONE(intermittent.push_room_s, 0.0, 1000.0),
    ONE(intermittent.push_for_s, 0.0, 1000.0),
    TWO(intermittent.bind_nm, 0.0, 100.0),
    ONE(intermittent.bind_every_s, 0.0, 1000.0),
    ONE(intermittent.bind_for_s, 0.0, 1000.0),
    TWO(intermittent.knock_n, 0.0, 10000.0),
    ONE(intermittent.knock_every_s, 0.0, 1000.0),
    ONE(intermittent.knock_for_s, 0.0, 1000.0),
};

static _Thread_local char problem[160];

static double value_at(const struct plant_unmodelled_effects *effects, const struct bound *bound, size_t i)
{
    double value = 0.0;
    memcpy(&value, (const char *)effects + bound->offset + i * sizeof value, sizeof value);
    return value;
}

static const char *zero_below(const char *name, double value)
{
    if (value > 0.0) {
        return NULL;
    }
    (void)snprintf(problem, sizeof problem, "%s is %g, and what is switched on divides by it", name, value);
    return problem;
}

/* Divisors of the effects that are switched on. */
static const char *division_by_zero(const struct plant_unmodelled_effects *effects)
{
    const struct plant_bristle_effects *bristle = &effects->bristle;
    const char *found = NULL;
    if (bristle->coulomb_nm[0] + bristle->coulomb_nm[1] + bristle->breakaway_nm[0] +
            bristle->breakaway_nm[1] >
        0.0) {
        found = zero_below("bristle.bend_rad", bristle->bend_rad);
        found = found != NULL ? found : zero_below("bristle.stribeck_radps", bristle->stribeck_radps);
    }
    if (found == NULL && effects->supply.polarisation_ohm > 0.0) {
        found = zero_below("supply.polarisation_s", effects->supply.polarisation_s);
    }
    if (found == NULL && effects->thermal.resistance_per_k > 0.0) {
        found = zero_below("thermal.winding_j_per_k", effects->thermal.winding_j_per_k);
        found = found != NULL ? found : zero_below("thermal.case_j_per_k", effects->thermal.case_j_per_k);
    }
    if (found == NULL && effects->tyre.grip > 0.0) {
        found = zero_below("tyre.slip_at_peak", effects->tyre.slip_at_peak);
    }
    if (found == NULL && effects->load.patch_n > 0.0) {
        found = zero_below("load.patch_pitch_m", effects->load.patch_pitch_m);
    }
    if (found == NULL && effects->encoder.dropout[0] + effects->encoder.dropout[1] > 0.0) {
        found = zero_below("encoder.dropout_at_radps", effects->encoder.dropout_at_radps);
    }
    const struct plant_intermittent_effects *intermittent = &effects->intermittent;
    if (found == NULL && intermittent->bind_nm[0] + intermittent->bind_nm[1] > 0.0) {
        found = zero_below("intermittent.bind_every_s", intermittent->bind_every_s);
    }
    if (found == NULL && intermittent->knock_n[0] + intermittent->knock_n[1] > 0.0) {
        found = zero_below("intermittent.knock_every_s", intermittent->knock_every_s);
    }
    return found;
}

const char *plant_unmodelled_effects_problem(const struct plant_unmodelled_effects *effects)
{
    if (effects == NULL) {
        return "no effects";
    }
    for (size_t k = 0; k < sizeof bounds / sizeof bounds[0]; k++) {
        for (size_t i = 0; i < bounds[k].count; i++) {
            const double value = value_at(effects, &bounds[k], i);
            if (!(value >= bounds[k].low && value <= bounds[k].high)) {
                (void)snprintf(problem, sizeof problem, "%s is %g, outside %g..%g", bounds[k].name, value,
                               bounds[k].low, bounds[k].high);
                return problem;
            }
        }
    }
    return division_by_zero(effects);
}
