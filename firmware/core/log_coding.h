/* Lossless coding of log records: a prediction of each field, and the coded residual. */
#ifndef LOG_CODING_H
#define LOG_CODING_H

#include <stddef.h>
#include <stdint.h>

#include "log_predictor.h"
#include "log_replay.h"
#include "proto.h"
#include "range_coder.h"

/* Kinds of numbers; each adapts models of its own. */
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
 * and the bytes that the coder has not released yet. */
enum {
    LOG_CODING_MAX = (16 * ((LOG_LENGTHS + 2) * RANGE_CODER_MAX_BITS + 36) + 2 * RANGE_CODER_MAX_BITS) / 8 + 6
};

/* One block's records. Everything starts anew with each block, so that a block decodes alone. */
struct log_coder {
    struct range_coder coder;
    struct log_replay replay;
    uint32_t rate_hz;
    uint32_t record; /* number of the next record since the log opened */
    uint32_t last[PROTO_LOG_FIELD_COUNT];
    int32_t turned_e4; /* heading beyond what the counts imply */
    struct log_predictor travel[2];
    struct log_predictor effort[2];
    struct log_predictor battery;
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

/* Codes one record; LOG_CODING_MAX bytes must be free. */
void log_coder_add(struct log_coder *coder, const struct proto_log_record *record);

/* Bytes coded so far, less the few that the coder has not released yet. */
size_t log_coder_size(const struct log_coder *coder);

/* Ends the block; returns the size of its records. */
size_t log_coder_finish(struct log_coder *coder);

#endif
