/* Records of one log: what to write, and when.
 *
 * The first record is taken when the log opens (t = 0, counts 0, speeds and efforts 0). Every later one
 * stands at the end of its interval: efforts and speeds are means over it, mode, segment and command are
 * those in force inside it. So a record at the millisecond of a step still describes the time before it.
 * Record k stands at floor(1000 k / rate) ms; the last one closes the log and its interval may be shorter. */
#ifndef RECORDER_H
#define RECORDER_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"
#include "log_feed.h"
#include "log_replay.h"

struct recorder {
    bool opening;   /* a log shall open at the next tick */
    bool active;    /* a log is open */
    bool armed;     /* that log, or the one that shall open, waits for a trigger: no drive ends it */
    uint8_t ending; /* enum proto_log_end, or LOG_END_DISCARDED, with which the open log shall close at the
                       next tick; OPEN: it goes on */
    uint8_t opening_ending; /* the same for the log that shall open: a stop may come before its first tick */
    uint16_t next_log_id;
    uint16_t rate_hz; /* of the log that opens */
    uint32_t sequence_crc;
    uint32_t before_ms;                /* of an armed log, how much is kept from before its trigger */
    uint32_t elapsed_ms;               /* since the log opened */
    uint32_t row_ms;                   /* where the last record stands */
    uint32_t next_row_ms;              /* where the next one is due */
    uint32_t next_row_part;            /* fraction of a millisecond carried, in 1/rate */
    uint16_t open_rate_hz;             /* of the open log */
    int32_t effort_sum_e4[HAL_WHEELS]; /* applied effort, summed over the ticks since the last record */
    struct log_replay replay;          /* how speeds follow from counts, as the host finds them too */
    int32_t counts_at_open[HAL_WHEELS];
    int32_t counts_at_row[HAL_WHEELS];
};

/* The robot now, as a record shows it; the recorder adds time, counts since the start, speeds and mean
 * efforts. */
struct recorder_view {
    uint32_t now_ms;
    int32_t counts[HAL_WHEELS];
    struct log_geometry geometry;
    struct proto_log_record record;
};

void recorder_init(struct recorder *recorder);

/* Asks for a log from the next tick on; returns its id. */
uint16_t recorder_request(struct recorder *recorder, uint16_t rate_hz, uint32_t sequence_crc);

/* The same for a log that waits for a trigger. */
uint16_t recorder_arm(struct recorder *recorder, uint16_t rate_hz, uint32_t before_ms);

/* Whether a log is open or shall open that has not been asked to end. */
bool recorder_is_busy(const struct recorder *recorder);

/* Ends the log that waits for a trigger. */
void recorder_finish_armed(struct recorder *recorder, uint8_t end);

/* Asks for the end of the newest log, unless that waits for a trigger; a first reason is kept. One that was
 * asked for and ends before its first tick still opens, so that the id given out exists. */
void recorder_finish(struct recorder *recorder, uint8_t end);

/* One millisecond has passed under these efforts. */
void recorder_pass(struct recorder *recorder, const int16_t applied_e4[HAL_WHEELS]);

/* Whether this tick has a record to write. */
bool recorder_due(const struct recorder *recorder);

/* Hands over the record that is due, and the log's end if that was asked for. */
void recorder_write(struct recorder *recorder, struct log_feed *feed, struct recorder_view *view);

/* Opens the log that was asked for, with its first record. */
void recorder_open(struct recorder *recorder, struct log_feed *feed, struct recorder_view *view);

#endif
