/* The battery: an open-circuit voltage that falls with the charge drawn, behind a resistance. */
#ifndef PLANT_BATTERY_H
#define PLANT_BATTERY_H

#include <stdbool.h>

#include "plant_params.h"

struct battery {
    struct plant_battery_params params;
    double drawn_as;    /* since creation; the charge below is what is left */
    double current_a;   /* mean over the last step */
    bool cut_off;       /* its plug is out, or its protection has opened */
    double capacitor_v; /* then the bridges' own capacitor is the supply */
};

void battery_init(struct battery *battery, const struct plant_battery_params *params);
double battery_charge(const struct battery *battery);
double battery_open_v(const struct battery *battery);
double battery_terminal_v(const struct battery *battery);

/* Cuts the battery off, or connects it again. */
void battery_cut_off(struct battery *battery, bool cut_off);

/* Takes what the bridges drew during one step, A s, and the electronics' own. */
void battery_step(struct battery *battery, double bridges_as);

#endif
