/* A gearbox with a gap and a spring between motor and wheel, or a hub that slips on its shaft.
 *
 * Within the gap nothing is passed on; beyond it a spring and a damper that can only push, so that teeth
 * part freely. A hub slips where the torque would exceed what its screw holds, and while it slips it holds
 * seven tenths of that. */
#include "gear.h"

#include <math.h>

static const double slipping_share = 0.7;

bool gear_is_elastic(const struct plant_gear_effects *params)
{
    return params->stiffness_nm_per_rad > 0.0;
}

double gear_torque_nm(const struct plant_gear_effects *params, int wheel, double motor_kgm2, double twist_rad,
                      double rate_radps, double *slipped_rad)
{
    const double half_gap = 0.5 * params->lash_rad[wheel];
    const double twist = twist_rad - *slipped_rad;
    const double pressed = twist > half_gap ? twist - half_gap : twist < -half_gap ? twist + half_gap : 0.0;
    if (half_gap > 0.0 && pressed == 0.0) {
        return 0.0;
    }
    const double stiffness = params->stiffness_nm_per_rad;
    const double damper = 2.0 * params->damping * sqrt(stiffness * motor_kgm2);
    const double torque = stiffness * pressed + damper * rate_radps;
    if (half_gap > 0.0 && torque * pressed < 0.0) {
        return 0.0;
    }
    const double limit_nm = params->slip_nm[wheel];
    if (limit_nm > 0.0 && fabs(torque) > limit_nm) {
        const double held = copysign(slipping_share * limit_nm, torque);
        *slipped_rad = twist_rad - held / stiffness;
        return held;
    }
    return torque;
}
