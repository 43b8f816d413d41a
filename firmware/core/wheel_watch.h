/* Plausibility of one wheel's counts under its effort: encoder lost or reversed, wheel stalled.
 *
 * None of the three needs a model of the robot, only bounds that hold for any drivable robot: a free wheel
 * turns under `stall_effort`, no wheel stops from speed within milliseconds, and no wheel runs further
 * against its effort than its kinetic energy carries it. */
#ifndef WHEEL_WATCH_H
#define WHEEL_WATCH_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"
#include "tuning.h"
#include "wheel_watch_limits.h"

enum {
    WHEEL_WATCH_RECENT_MS = 4,
    WHEEL_WATCH_BEFORE_MS = 16,
    WHEEL_WATCH_HISTORY_MS = WHEEL_WATCH_RECENT_MS + WHEEL_WATCH_BEFORE_MS,
    /* The same history, for a motion that turns round: what was before, and what is now. */
    WHEEL_WATCH_TURNED_MS = 8,
    WHEEL_WATCH_TURNING_MS = 2,
    WHEEL_WATCH_UNTURNED_MS = WHEEL_WATCH_HISTORY_MS - WHEEL_WATCH_TURNED_MS - WHEEL_WATCH_TURNING_MS,
};

/* A start from rest as the feedforward's ka predicts it. */
struct wheel_start {
    float mps;
    float way_m;
    uint16_t ms; /* when the way comes to as many counts as show a motion; 0: not yet */
};

struct wheel_watch {
    int32_t history[WHEEL_WATCH_HISTORY_MS]; /* counts of the last ticks, oldest at `next` */
    uint8_t next;
    int32_t front;        /* the furthest count in the direction of the last motion */
    int8_t heading;       /* that direction */
    int32_t place;        /* position that the wheel has stayed near, within the dither */
    uint16_t standing_ms; /* how long, under stall_effort */
    uint16_t broken_ms;   /* how long, under any effort along the motion, since counts broke off */
    int8_t fast;          /* direction of a motion at speed when `place` was left last; 0: it was none */
    int8_t way;           /* of the last count */
    uint8_t turns;        /* changes of it since, up to TURNS */
    uint16_t dither_ms;   /* time since, under an effort along that motion */
    bool moved;           /* since the effort took its direction */
    struct wheel_start soonest; /* how a start under this effort goes at best, */
    struct wheel_start due;     /* and at worst */
    uint16_t late_ms;           /* by which the wheel's starts have come later than the soonest, at most */
    bool start_known;           /* such a start has been seen */
    int8_t broken_off;          /* direction of a motion that ended within RECENT_MS; 0: it did not */
    int8_t effort_direction;    /* direction of the effort that `work` refers to */
    uint16_t push_ms;           /* since when it has been that */
    bool from_rest;             /* the wheel stood when that effort began, and has not moved along it since */
    bool rested;                /* it stood then */
    int32_t against;            /* counts against that effort since it began, or since the last along it */
    float borne;                /* effort that other forces on the wheel may balance */
    float work;             /* done against the motion, as the square of the speed it takes away, (m/s)^2 */
    float initial_energy;   /* kinetic energy against the effort when it began, in the same unit */
    float energy;           /* that, and the work that other forces on the wheel may do */
    uint16_t creep_ms;      /* of the span under a large effort that is under way */
    int8_t creep_direction; /* of that effort */
    int32_t creep_from;     /* counts at the last of its steps */
    int32_t creep_counts;   /* its distance */
    float creep_m;          /* a wheel that goes no further in this span creeps */
    bool creeps;            /* the span that has just ended was one of creeping */
    bool lost, stalled, reversed;
};

/* A wheel that has always stood at `counts`. */
void wheel_watch_init(struct wheel_watch *watch, int32_t counts);

/* One tick: counts and speed of this tick, and the efforts of both wheels that have been applied up to now,
 * forward positive. */
void wheel_watch_step(struct wheel_watch *watch, const struct tuning *tuning, int wheel, int32_t counts,
                      const int16_t effort_e4[HAL_WHEELS], float speed_mps);

/* Whether its sums are numbers, so that its comparisons mean something; the next step starts them anew. */
bool wheel_watch_is_finite(const struct wheel_watch *watch);

#endif
