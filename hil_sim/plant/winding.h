/* Heating of a winding by its current, and cooling through its case. */
#ifndef PLANT_WINDING_H
#define PLANT_WINDING_H

#include <stdbool.h>

#include "unmodelled_effects.h"

struct winding {
    double winding_k, case_k; /* above the air */
    double heat_j;            /* since the temperatures were brought up to date */
    double elapsed_s;
};

/* Takes one step's mean current at the present resistance. */
void winding_step(struct winding *winding, const struct plant_thermal_effects *params, double current_a,
                  double resistance_ohm);

/* True when the temperatures were updated; at long intervals, since they are slow. */
bool winding_update(struct winding *winding, const struct plant_thermal_effects *params);

#endif
