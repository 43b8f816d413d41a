/* Torque disturbance at the wheels: coloured noise, a first-order process drawn anew each millisecond. */
#include "disturbance.h"

#include <math.h>

#include "noise.h"

enum { DRAW_STEPS = 1000 / PLANT_STEP_US };
static const double draw_s = 1e-3;

double disturbance_nm(struct disturbance *disturbance, const struct plant_disturbance_effects *params,
                      int wheel, uint64_t seed, uint64_t step)
{
    if (step % DRAW_STEPS == 0) {
        const double kept = params->correlation_s / (params->correlation_s + draw_s);
        const double fresh = sqrt(1.0 - kept * kept);
        const enum noise_stream stream = wheel == 0 ? NOISE_DISTURBANCE_LEFT : NOISE_DISTURBANCE_RIGHT;
        disturbance->value[wheel] =
            kept * disturbance->value[wheel] + fresh * noise_normal(seed, stream, step / DRAW_STEPS);
    }
    return params->torque_nm[wheel] * disturbance->value[wheel];
}
