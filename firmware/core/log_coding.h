/* Lossless coding of log records: what a record is expected to be, and coded bits for what it is instead. */
#ifndef LOG_CODING_H
#define LOG_CODING_H

#include <stddef.h>
#include <stdint.h>

#include "log_guess.h"
#include "log_replay.h"
#include "proto.h"
#include "range_coder.h"

/* Kinds of numbers; each learns its own habits. */
enum log_kind {
    LOG_KIND_TIME,
    LOG_KIND_MODE,
    LOG_KIND_SEGMENT,
    LOG_KIND_FAULTS,
    LOG_KIND_COMMAND,
    LOG_KIND_TRAVEL,
    LOG_KIND_EFFORT_SET,
    LOG_KIND_EFFORT_HELD,
    LOG_KIND_SPEED,
    LOG_KIND_HEADING,
    LOG_KIND_POSITION,
    LOG_KIND_BATTERY,
    LOG_KINDS,
};

enum { LOG_CONTEXTS = 6, LOG_LENGTHS = 12 };

/* A number is zero or not, has a sign, a length and its bits. */
struct log_number {
    struct bit_model zero[LOG_CONTEXTS];
    struct bit_model sign;
    struct bit_model more[LOG_LENGTHS];
    struct bit_model top[LOG_LENGTHS];
};

/* Bytes that one record adds at most: 16 numbers of 12 + 2 coded and 5 + 31 plain bits, two coded bits more,
 * and what the coder holds back. */
enum {
    LOG_CODING_MOST =
        (16 * ((LOG_LENGTHS + 2) * RANGE_CODER_MOST_BITS + 36) + 2 * RANGE_CODER_MOST_BITS) / 8 + 6
};

/* One block's records. Everything starts anew with each block, so that a block decodes alone. */
struct log_coder {
    struct range_coder coder;
    struct log_replay replay;
    uint32_t rate_hz;
    uint32_t record; /* number of the next record since the log opened */
    uint32_t last[PROTO_LOG_FIELD_COUNT];
    int32_t turned_e4; /* heading that the counts do not tell */
    struct log_guess travel[2];
    struct log_guess effort[2];
    struct log_guess battery;
    struct log_axis axes[2];
    struct bit_model same;
    struct bit_model replayed;
    struct log_number numbers[LOG_KINDS];
};

/* What a log's blocks share. */
struct log_format {
    struct log_geometry geometry;
    uint16_t rate_hz;
};

/* A block's first record is number `first_record` of its log. */
void log_coder_start(struct log_coder *coder, const struct log_format *format, uint32_t first_record,
                     uint8_t *out, size_t capacity);

/* Codes one record; LOG_CODING_MOST bytes must be free. */
void log_coder_add(struct log_coder *coder, const struct proto_log_record *record);

/* Bytes coded so far, up to a few that are still held back. */
size_t log_coder_size(const struct log_coder *coder);

/* Ends the block; returns the size of its records. */
size_t log_coder_finish(struct log_coder *coder);

#endif
