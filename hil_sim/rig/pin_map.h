/* What is soldered to the chip on each board that the rig knows: pins, motor drivers, crystal, divider. */
#ifndef PIN_MAP_H
#define PIN_MAP_H

#include <stdbool.h>
#include <stdint.h>

#include "../board/board.h"
#include "../plant/plant.h"
#include "target.h"

/* How a motor driver reads its two inputs. */
enum driver_kind {
    DRIVER_INPUTS,        /* IN1, IN2 (DRV8871): both high brake, both low coast */
    DRIVER_MAGNITUDE_DIR, /* PWM, DIR (MD10C): PWM low brakes, DIR low is forward */
    DRIVER_ENABLE_PHASE   /* EN, PH (DRV8838, DRV8876): EN low brakes, PH high is forward */
};

struct pin_map {
    struct board_pin bridge[PLANT_WHEELS][2], encoder[PLANT_WHEELS][2];
    struct board_pin battery, led, enable;
    struct board_pin stop[2]; /* a contact to ground, wired to the break inputs of both timers */
    uint32_t crystal_hz;
    double divider; /* volts at the pin for each volt of the supply */
    enum driver_kind driver;
};

const struct pin_map *pin_map_of(enum rig_target target);

/* What a driver of this kind makes of its inputs' duties, as the duties of a bridge with IN/IN inputs. */
void driver_to_bridge(enum driver_kind kind, const double duty[2], double in_in[2]);

#endif
