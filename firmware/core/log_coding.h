/* Lossless coding of log records: a mask of what differs from its prediction, and varints. */
#ifndef LOG_CODING_H
#define LOG_CODING_H

#include <stddef.h>
#include <stdint.h>

#include "proto.h"

enum { LOG_CODING_MAX_SIZE = 2 + 5 * (int)PROTO_LOG_FIELD_COUNT }; /* bytes of one coded record */

/* What predictions are made from; all zero at the start of every block, so that a block decodes alone. */
struct log_coder {
    uint32_t last[PROTO_LOG_FIELD_COUNT];
    uint32_t one_before[PROTO_LOG_FIELD_COUNT];
};

/* Codes one record; returns its size. The coder moves on with log_coder_accept, so that a record which does
 * not fit into a block leaves no trace. */
size_t log_coder_encode(const struct log_coder *coder, const uint32_t words[PROTO_LOG_FIELD_COUNT],
                        uint8_t out[LOG_CODING_MAX_SIZE]);

/* The record has been stored. */
void log_coder_accept(struct log_coder *coder, const uint32_t words[PROTO_LOG_FIELD_COUNT]);

#endif
