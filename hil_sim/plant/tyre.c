/* Tyres of finite grip: force from slip.
 *
 * The shape is the magic formula's (Pacejka, Tire and Vehicle Dynamics, chapter 4) with its shape factor at
 * 1.4, so that sliding tyres hold 0.8 of the peak. Slip is relative to the floor's speed and, near
 * standstill, to a creeping one: below that the tyre is a damper.
 */
#include "tyre.h"

#include <math.h>

static const double creep_mps = 0.05;
static const double shape = 1.4;

double tyre_force_n(const struct plant_tyre_effects *params, double load_n, double rim_mps, double floor_mps)
{
    const double slip = (rim_mps - floor_mps) / (fabs(floor_mps) + creep_mps);
    const double at_peak = tan(1.5707963267948966 / shape);
    return params->grip * load_n * sin(shape * atan(at_peak * slip / params->slip_at_peak));
}
