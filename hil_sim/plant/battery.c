/* The battery: an open-circuit voltage that falls with the charge drawn, behind a resistance.
 *
 * The terminal voltage of a step follows the mean current of the step before it: a lag of 50 us, which stands
 * for the bulk capacitor that every bridge has (0.12 ohm times 470 uF is 56 us). It couples the wheels
 * electrically: one motor's current lowers the other's supply. */
#include "battery.h"

static const double step_s = PLANT_STEP_US * 1e-6;
static const double capacitor_f = 470e-6;

void battery_init(struct battery *battery, const struct plant_battery_params *params)
{
    *battery = (struct battery){.params = *params, .drawn_as = 0.0, .current_a = params->electronics_a};
}

double battery_charge(const struct battery *battery)
{
    const double capacity_as = battery->params.capacity_ah * 3600.0;
    const double charge = battery->params.initial_charge - battery->drawn_as / capacity_as;
    if (charge < 0.0) {
        return 0.0;
    }
    return charge < 1.0 ? charge : 1.0;
}

double battery_open_v(const struct battery *battery)
{
    const struct plant_battery_params *params = &battery->params;
    return params->empty_v + (params->full_v - params->empty_v) * battery_charge(battery);
}

void battery_cut_off(struct battery *battery, bool cut_off)
{
    battery->capacitor_v = battery_terminal_v(battery);
    battery->cut_off = cut_off;
}

double battery_terminal_v(const struct battery *battery)
{
    if (battery->cut_off) {
        return battery->capacitor_v;
    }
    const double volts = battery_open_v(battery) - battery->params.resistance_ohm * battery->current_a;
    return volts > 0.0 ? volts : 0.0;
}

void battery_step(struct battery *battery, double bridges_as)
{
    const double charge_as = bridges_as + battery->params.electronics_a * step_s;
    battery->current_a = charge_as / step_s;
    if (battery->cut_off) {
        const double volts = battery->capacitor_v - charge_as / capacitor_f;
        battery->capacitor_v = volts > 0.0 ? volts : 0.0;
        return;
    }
    battery->drawn_as += charge_as;
}
