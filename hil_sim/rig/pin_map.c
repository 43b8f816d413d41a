/* The boards' wiring, by the words of firmware/README.md and the drivers' datasheets, not by firmware
 * headers. */
#include "pin_map.h"

#define H405_PINS                                                                                            \
    .bridge = {{{'A', 8}, {'A', 9}}, {{'A', 10}, {'A', 11}}},                                                \
    .encoder = {{{'B', 4}, {'B', 5}}, {{'B', 6}, {'B', 7}}}, .battery = {'A', 4}, .led = {'C', 12},          \
    .enable = {'C', 6}, .stop = {{'B', 12}, {'A', 6}}, .crystal_hz = 8000000,                                \
    .divider = 1.0 / 11.0 /* 10 kOhm over 1 kOhm */

static const struct pin_map maps[RIG_TARGETS] = {
    [RIG_TARGET_OLIMEX_H405] = {H405_PINS, .driver = DRIVER_INPUTS},
    [RIG_TARGET_PWM_DIR] = {H405_PINS, .driver = DRIVER_MAGNITUDE_DIR},
    [RIG_TARGET_PHASE_ENABLE] = {H405_PINS, .driver = DRIVER_ENABLE_PHASE},
    [RIG_TARGET_F405_USB] = {.bridge = {{{'A', 8}, {'A', 9}}, {{'C', 6}, {'C', 7}}},
                             .encoder = {{{'B', 6}, {'B', 7}}, {{'B', 4}, {'B', 5}}},
                             .battery = {'C', 0},
                             .led = {'C', 13},
                             .enable = {'C', 8},
                             .stop = {{'B', 12}, {'A', 6}},
                             .crystal_hz = 12000000,
                             .divider = 1.5 / (15.0 + 1.5), /* 15 kOhm over 1.5 kOhm */
                             .driver = DRIVER_INPUTS},
};

const struct pin_map *pin_map_of(enum rig_target target)
{
    return (unsigned)target < RIG_TARGETS ? &maps[target] : NULL;
}

/* An undriven pin is held low by the driver's own pull-down. */
static double high_fraction(double duty)
{
    return duty < 0 ? 0 : duty;
}

void driver_to_bridge(enum driver_kind kind, const double duty[2], double in_in[2])
{
    const double first = high_fraction(duty[0]);
    const double second = high_fraction(duty[1]);
    if (kind == DRIVER_INPUTS) {
        in_in[0] = first;
        in_in[1] = second;
        return;
    }
    /* Driven for the first input's share of the period, braked for the rest: both inputs of IN/IN high. */
    const bool forward = (second > 0.5) == (kind == DRIVER_ENABLE_PHASE);
    in_in[0] = forward ? 1 : 1 - first;
    in_in[1] = forward ? 1 - first : 1;
}
