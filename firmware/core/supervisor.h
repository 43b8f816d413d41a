/* Whether the robot may move, and what stops it: states, and a table of faults. */
#ifndef SUPERVISOR_H
#define SUPERVISOR_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"
#include "proto.h"
#include "tuning.h"

enum {
    /* The supply sags for tens of milliseconds when both motors start; a battery that is flat stays low. */
    SUPERVISOR_BATTERY_LOW_MS = 250,
    /* Two readings in a row: a supply without a battery rises by 2 V a millisecond. */
    SUPERVISOR_BATTERY_HIGH_MS = 1,
    /* Longer than a window of the speed measurement: one disturbed count does not trip it. */
    SUPERVISOR_OVERSPEED_MS = 20,
};

/* What it takes to clear a fault, besides the command to do so. */
enum supervisor_clears {
    SUPERVISOR_CLEARS_WHEN_GONE, /* its cause must be gone */
    SUPERVISOR_CLEARS_AT_ONCE,   /* its cause is momentary */
    SUPERVISOR_LASTS,            /* it stays for as long as the board runs */
};

struct supervisor {
    uint8_t state;                          /* enum proto_state */
    bool armed;                             /* someone has allowed this start of the board to move */
    uint32_t active;                        /* faults whose cause is present */
    uint32_t latched;                       /* faults that stopped the wheels */
    uint32_t noted;                         /* faults that start-up found */
    uint16_t present_ms[PROTO_FAULT_COUNT]; /* ticks in a row with the cause present, saturating */
    volatile uint32_t silence_ms;   /* since the last valid command, or request to a sequence's host */
    bool unattended;                /* the sequence goes on without its host */
    volatile bool overrun;          /* set from the tick interrupt's frame, taken by the next step */
    bool store_damaged;             /* the parameters in force are not those that were saved last */
    volatile bool sequence_damaged; /* set from the main loop, taken by the next step */
    volatile bool can_bus_off;      /* set from the main loop */
    bool main_loop_hung;            /* the main loop has not come round for too long */
    bool not_finite;                /* a number that control rests on is none */
};

/* What the faults are judged by. */
struct supervisor_view {
    float speed_mps[HAL_WHEELS];
    bool still[HAL_WHEELS];
    bool lost[HAL_WHEELS], reversed[HAL_WHEELS], stalled[HAL_WHEELS]; /* see wheel_watch.h */
    bool hot[HAL_WHEELS];                                             /* see motor_heat.h */
    uint16_t battery_mv;
    bool battery_valid;
    bool supply_dip;     /* the board's own supply sags */
    bool emergency_stop; /* pressed, or not released by hal_release_emergency_stop since */
};

/* `boot_faults`: what start-up found; those that stop are latched from the beginning. */
void supervisor_init(struct supervisor *supervisor, uint32_t boot_faults);

/* The wheels are or may be driven. */
bool supervisor_is_moving(const struct supervisor *supervisor);

/* One tick; true when a fault has just been latched, and the wheels must be braked. */
bool supervisor_step(struct supervisor *supervisor, const struct tuning *tuning,
                     const struct supervisor_view *view);

/* Latches faults that were found outside of a tick, while the robot stands. */
void supervisor_stop(struct supervisor *supervisor, uint32_t faults);

/* The faults that forbid to begin moving, 0 when there are none. `from_rest`: both wheels must stand. */
uint32_t supervisor_self_check(const struct supervisor *supervisor, const struct tuning *tuning,
                               const struct supervisor_view *view, bool from_rest);

/* Unlatches; returns the faults that stop and are still present, 0 when it was done. */
uint32_t supervisor_clear(struct supervisor *supervisor);

/* A row of the table, for tests and documents; `bit` counts from 0. */
struct supervisor_row {
    uint32_t hold_ms;
    bool stops;
    enum supervisor_clears clears;
};
struct supervisor_row supervisor_row(uint32_t bit);

#endif
