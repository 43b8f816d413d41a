/* Whether the robot may move, and what stops it: states, and a table of faults. */
#ifndef SUPERVISOR_H
#define SUPERVISOR_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"
#include "tuning.h"

enum {
    /* The supply sags for tens of milliseconds when both motors start; a battery that is flat stays low. */
    SUPERVISOR_BATTERY_LOW_MS = 250,
};

struct supervisor {
    uint8_t state;             /* enum proto_state */
    uint32_t active;           /* faults whose cause is present */
    uint32_t latched;          /* faults that stopped the wheels */
    uint16_t battery_below_ms; /* ticks in a row below battery_low_v, saturating */
    bool battery_low;          /* with hysteresis */
    uint32_t silence_ms;       /* since the last valid command */
    volatile bool overrun;     /* set from the tick interrupt's frame, taken by the next step */
    bool clock_fallback;
    bool store_damaged; /* the parameters in force are not those that were saved last */
};

/* What the faults are judged by. */
struct supervisor_view {
    float speed_mps[HAL_WHEELS];
    bool still[HAL_WHEELS];
    bool at_rest; /* both wheels have been braked for so long that they must stand */
    uint16_t battery_mv;
    bool battery_valid;
};

void supervisor_init(struct supervisor *supervisor, bool clock_fallback);

/* The wheels are or may be driven. */
bool supervisor_is_moving(const struct supervisor *supervisor);

/* One tick; true when a fault has just been latched, and the wheels must be braked. */
bool supervisor_step(struct supervisor *supervisor, const struct tuning *tuning,
                     const struct supervisor_view *view);

/* The faults that forbid to begin moving, 0 when there are none. `from_rest`: both wheels must stand. */
uint32_t supervisor_self_check(const struct supervisor *supervisor, const struct tuning *tuning,
                               const struct supervisor_view *view, bool from_rest);

/* Unlatches; returns the faults that stop and are still present, 0 when it was done. */
uint32_t supervisor_clear(struct supervisor *supervisor);

#endif
