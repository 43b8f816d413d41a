/* Dry friction of bristles that bend before they slide: LuGre (Canudas de Wit, Olsson, Astrom and Lischinsky
 * 1995, IEEE Trans. Automatic Control 40, (1) to (3)),
 *
 *     dz/dt = v - s0 |v| z / g(v),   F = s0 z + s1 dz/dt
 *
 * with the rational falling curve of friction.c for g. The bristle's own equation is taken implicitly, so
 * that it cannot overshoot at any speed. s1 damps the bending to about half of critical on a wheel of the
 * inertia that small robots have.
 */
#include "bristle.h"

#include <math.h>

/* Damping torque per bending torque and 1/s: s1 = this times s0. */
static const double damping_s = 0.012;

double bristle_torque_nm(const struct plant_bristle_effects *params, int wheel, double speed_radps,
                         double span_s, double *bend_rad)
{
    const double coulomb_nm = params->coulomb_nm[wheel];
    const double breakaway_nm = fmax(params->breakaway_nm[wheel], coulomb_nm);
    const double stiffness = fmax(coulomb_nm, breakaway_nm) / params->bend_rad;
    const double ratio = speed_radps / params->stribeck_radps;
    const double slide_nm = coulomb_nm + (breakaway_nm - coulomb_nm) / (1.0 + ratio * ratio);
    const double before = *bend_rad;
    *bend_rad = (before + span_s * speed_radps) / (1.0 + span_s * stiffness * fabs(speed_radps) / slide_nm);
    /* Damping fades once the bristles slide, or it would look like viscous friction. */
    const double share = slide_nm / (slide_nm + stiffness * fabs(speed_radps) * damping_s);
    return stiffness * *bend_rad + share * stiffness * damping_s * (*bend_rad - before) / span_s;
}
