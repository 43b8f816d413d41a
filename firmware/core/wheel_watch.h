/* One wheel's counts held against its effort: an encoder that is lost or reversed, a wheel that is stalled.
 *
 * None of the three needs a model of the robot, only bounds that hold for any robot that is fit to drive:
 * a free wheel turns under `stall_effort`, no wheel stops from speed within milliseconds, and no wheel runs
 * further against its effort than its kinetic energy carries it. */
#ifndef WHEEL_WATCH_H
#define WHEEL_WATCH_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"
#include "tuning.h"

enum {
    /* Counts that say nothing: a loose wire, or one phase alone, toggles between two places. */
    WHEEL_WATCH_DITHER_COUNTS = 2,
    /* From rest: a wheel of the paper's robot in a pivot, where breakaway takes 15 % of effort, makes three
     * counts in 40 ms at 25 %. Six times that leaves room for stiff grease and a gear's backlash. */
    WHEEL_WATCH_START_MS = 250,
    /* Counts that break off at speed are the encoder's doing: 5 g of a crash would still take 7 ms from
     * 0.35 m/s. What the wait is for is the comparison of two windows only. */
    WHEEL_WATCH_BROKEN_OFF_MS = 60,
    /* A wheel that is held: a bump may hold it for a moment, a motor endures its stall current for seconds.
     */
    WHEEL_WATCH_STALL_MS = 400,
    WHEEL_WATCH_RECENT_MS = 4,
    WHEEL_WATCH_BEFORE_MS = 16,
    WHEEL_WATCH_HISTORY_MS = WHEEL_WATCH_RECENT_MS + WHEEL_WATCH_BEFORE_MS,
};

struct wheel_watch {
    int32_t history[WHEEL_WATCH_HISTORY_MS]; /* counts of the last ticks, oldest at `next` */
    uint8_t next;
    int32_t front;        /* the furthest count in the direction of the last motion */
    int8_t heading;       /* that direction */
    int32_t place;        /* counts that the wheel has kept to, give or take the dither */
    uint16_t standing_ms; /* how long, under stall_effort */
    uint16_t broken_ms;   /* how long, under any effort along the motion, since counts broke off */
    bool moved;           /* since the effort took its direction */
    int8_t broken_off;    /* direction of a motion that ended within RECENT_MS; 0: it did not */
    int8_t pushed;        /* direction of the effort that bears on `work` */
    bool stood;           /* when that effort began, and has not moved along it since */
    int32_t against;      /* counts against that effort since it began, or since the last along it */
    float work;           /* done against the motion, as the square of the speed it takes away, (m/s)^2 */
    float brought;        /* what the motion had to give when the effort began, in the same unit */
    float energy;         /* that, and what else may push the wheel */
    bool lost, stalled, reversed;
};

/* A wheel that has always stood at `counts`. */
void wheel_watch_init(struct wheel_watch *watch, int32_t counts);

/* One tick: counts and speed of this tick, and the efforts of both wheels that have been applied up to now,
 * forward positive. */
void wheel_watch_step(struct wheel_watch *watch, const struct tuning *tuning, int wheel, int32_t counts,
                      const int16_t effort_e4[HAL_WHEELS], float speed_mps);

#endif
