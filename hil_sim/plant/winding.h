/* Copper that warms with its current and cools through its case. */
#ifndef PLANT_WINDING_H
#define PLANT_WINDING_H

#include "hidden.h"

struct winding {
    double winding_k, case_k; /* above the air */
    double heat_j;            /* since the temperatures were brought up to date */
    double elapsed_s;
};

/* Takes one step's mean current at the present resistance. */
void winding_step(struct winding *winding, const struct plant_hidden_thermal *params, double current_a,
                  double resistance_ohm);

/* True when the temperatures have moved on; now and then only, they are slow. */
bool winding_update(struct winding *winding, const struct plant_hidden_thermal *params);

#endif
