/* The battery: an open-circuit voltage that falls with the charge drawn, behind a resistance. */
#ifndef PLANT_BATTERY_H
#define PLANT_BATTERY_H

#include "plant_params.h"

struct battery {
    struct plant_battery_params params;
    double drawn_as;  /* since creation; the charge below is what is left */
    double current_a; /* mean over the last step */
};

void battery_init(struct battery *battery, const struct plant_battery_params *params);
double battery_charge(const struct battery *battery);
double battery_open_v(const struct battery *battery);
double battery_terminal_v(const struct battery *battery);

/* Takes what the bridges drew during one step, A s, and the electronics' own. */
void battery_step(struct battery *battery, double bridges_as);

#endif
