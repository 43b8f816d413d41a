/* The log's memory: a ring of cells, in which each sealed block takes as many as it needs.
 *
 * Everything here runs in the main loop: the control tick hands its records over through log_feed.h. A sealed
 * block describes its log completely, so that no table is kept beside the ring. */
#ifndef LOG_H
#define LOG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal.h"
#include "log_coding.h"
#include "proto.h"

/* A block is sealed before the record that follows this many bytes, so that most fill ten cells. Longer ones
 * would save little (a header takes 42 bytes) and lose more when damaged: half a minute at 20 Hz as it is. */
enum { LOG_FULL = 630 };
_Static_assert(LOG_FULL + LOG_CODING_MAX <= PROTO_LOG_BLOCK_LIMIT, "a record more always fits");

/* Ends the log and discards it. */
enum { LOG_END_DISCARDED = 0xFF };

/* A log as it opens. An armed one is hidden until it closes, and only its last `before_ms` are kept, counted
 * from the trigger once it has fired: rounded up to whole blocks, which are shorter than in other logs. */
struct log_opening {
    uint16_t log_id;
    bool armed;
    uint32_t before_ms;
    uint32_t start_ms;
    uint32_t sequence_crc;
    struct log_format format;
};

struct log {
    struct hal_memory memory[HAL_LOG_MEMORIES];
    uint32_t cells;       /* in all */
    uint32_t oldest_cell; /* first cell that may be read */
    uint32_t end_cell;    /* one past the last sealed block */
    bool open;
    bool hidden; /* the open log cannot be read yet: its blocks move, as the ring is otherwise full of them */
    bool fired;  /* its trigger has fired */
    uint32_t hidden_cell;       /* its first */
    uint32_t fired_ms;          /* when, device time */
    uint32_t max_records;       /* of its block */
    struct log_opening opening; /* of the open log */
    uint32_t first_record;      /* of the block that is being written */
    uint32_t record_count;      /* of the open log */
    uint32_t end_ms;            /* of its last record */
    struct log_coder coder;
    uint8_t block[PROTO_LOG_BLOCK_LIMIT]; /* being written; goes into the ring as a whole */
};

/* Takes the memory that the board has for it. */
void log_init(struct log *log);

/* A log that is still open ends as stopped. */
void log_open(struct log *log, const struct log_opening *opening);
void log_append(struct log *log, const struct proto_log_record *record);
void log_close(struct log *log, uint8_t end); /* enum proto_log_end or LOG_END_DISCARDED */

/* The trigger of the open log has fired, at the time of its record `t_ms`. */
void log_fire(struct log *log, uint32_t t_ms);

/* Offsets are absolute: cell * cell size + position. */
uint32_t log_oldest_offset(const struct log *log);
uint32_t log_end_offset(const struct log *log);

/* Copies sealed bytes; the caller stays within what is sealed. */
void log_copy(const struct log *log, uint32_t offset, uint8_t *out, size_t length);

/* CRC-32 of sealed bytes, under the same condition. */
uint32_t log_digest(const struct log *log, uint32_t offset, uint32_t length);

/* Goes through the logs, oldest first. */
struct log_walk {
    uint32_t cell;
    bool open_seen;
};
struct log_walk log_walk_start(const struct log *log);

/* The next log; false when there is none. */
bool log_walk_next(const struct log *log, struct log_walk *walk, struct proto_log_entry *out);

/* Forgets every log; false while one is open. */
bool log_erase(struct log *log);

#endif
