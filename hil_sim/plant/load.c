/* External forces: drag, torque ripple, slope, rough patches, a tether, a swinging load. */
#include "load.h"

#include <math.h>

static const double gravity_mps2 = 9.81;
static const double turn_rad = 6.283185307179586;

void load_rims_n(const struct plant_load_effects *params, const struct load_view *view,
                 double out[PLANT_WHEELS])
{
    for (int i = 0; i < PLANT_WHEELS; i++) {
        const double radius_m = view->wheel[i].radius_m;
        double torque_nm = 0.0;
        if (params->quadratic_nms2[i] != 0.0) {
            const double speed = view->rim_mps[i] / radius_m;
            torque_nm -= params->quadratic_nms2[i] * speed * fabs(speed);
        }
        if (params->ripple_nm[i] != 0.0) {
            /* Real cogging has a second harmonic: a sixth of the amplitude at twice the frequency. */
            const double phase = params->ripple_per_turn * view->motor_rad[i] + params->ripple_phase_rad[i];
            torque_nm += params->ripple_nm[i] * (sin(phase) + sin(2.0 * phase + 1.0) / 6.0);
        }
        out[i] = torque_nm / radius_m;
    }
}

/* Rough patches are as long as the gaps between them. */
static double roughness(const struct plant_load_effects *params, const struct chassis *chassis)
{
    const double across = turn_rad / params->patch_pitch_m;
    const double bump = 0.5 + 0.25 * (sin(across * chassis->x_m) + sin(across * chassis->y_m + 1.0));
    return bump * bump * (3.0 - 2.0 * bump);
}

double load_body_n(struct load *load, const struct plant_load_effects *params, const struct load_view *view,
                   double span_s)
{
    const struct chassis *chassis = view->chassis;
    const double speed = 0.5 * (view->rim_mps[0] + view->rim_mps[1]);
    double force_n = 0.0;
    if (params->slope_rad != 0.0) {
        const double along = cos(chassis->theta_rad - params->uphill_rad);
        force_n -= view->mass_kg * gravity_mps2 * sin(params->slope_rad) * along;
    }
    if (params->patch_n != 0.0) {
        /* Rolling resistance vanishes below creeping speed, as the tyre's hysteresis does. */
        force_n -= 2.0 * params->patch_n * roughness(params, chassis) * speed / sqrt(speed * speed + 4e-4);
    }
    if (params->spring_n_per_m != 0.0) {
        const double back = chassis->x_m * chassis->cos_theta + chassis->y_m * chassis->sin_theta;
        force_n -= params->spring_n_per_m * back;
    }
    if (params->swing_kg > 0.0) {
        const double omega = turn_rad * params->swing_hz;
        const double relative = load->swing_mps - speed;
        const double pull = params->swing_kg *
                            (omega * omega * load->swing_m + 2.0 * params->swing_damping * omega * relative);
        load->swing_mps -= pull / params->swing_kg * span_s;
        load->swing_m += (load->swing_mps - speed) * span_s;
        force_n += pull;
    }
    return force_n;
}
