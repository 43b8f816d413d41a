/* Heating of a winding by its current, and cooling through its case: two nodes. */
#include "winding.h"

static const double step_s = PLANT_STEP_US * 1e-6;
static const double update_s = 0.01; /* small motors' windings take seconds */

void winding_step(struct winding *winding, const struct plant_thermal_effects *params, double current_a,
                  double resistance_ohm)
{
    if (params->resistance_per_k > 0.0) {
        winding->heat_j += current_a * current_a * resistance_ohm * step_s;
        winding->elapsed_s += step_s;
    }
}

bool winding_update(struct winding *winding, const struct plant_thermal_effects *params)
{
    if (winding->elapsed_s < update_s) {
        return false;
    }
    const double to_case_j =
        params->winding_w_per_k * (winding->winding_k - winding->case_k) * winding->elapsed_s;
    const double to_air_j = params->case_w_per_k * winding->case_k * winding->elapsed_s;
    winding->winding_k += (winding->heat_j - to_case_j) / params->winding_j_per_k;
    winding->case_k += (to_case_j - to_air_j) / params->case_j_per_k;
    winding->heat_j = 0.0;
    winding->elapsed_s = 0.0;
    return true;
}
