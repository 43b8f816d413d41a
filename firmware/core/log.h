/* The log's memory: a ring of blocks that are sealed one by one, and a table of the logs in it.
 *
 * The control tick writes; the main loop reads sealed blocks. A reader copies first and asks afterwards
 * whether the ring has moved past what it copied, so that the tick never waits. */
#ifndef LOG_H
#define LOG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "log_coding.h"
#include "proto.h"

/* Logs that the table holds; when one more opens, the oldest is forgotten with its blocks. 36 bytes each. */
enum { LOG_TABLE_SIZE = 64 };

struct log_info {
    uint16_t log_id;
    uint16_t rate_hz;
    uint8_t end;          /* enum proto_log_end */
    uint32_t first_block; /* block numbers; those that the ring still holds are from log.oldest_block on */
    uint32_t end_block;   /* one past the last sealed block */
    uint32_t record_count;
    uint32_t start_ms;
    uint32_t end_ms;
    uint32_t sequence_crc;
};

struct log {
    uint8_t ring[PROTO_LOG_BLOCK_COUNT][PROTO_LOG_BLOCK_SIZE];
    volatile uint32_t oldest_block; /* first block that may be read */
    volatile uint32_t end_block;    /* one past the last sealed block; the number of the open block, if any */
    bool open;                      /* a log is open */
    uint16_t used;                  /* bytes used in the open block, 0 when none is open */
    uint16_t records;               /* records in the open block */
    struct log_coder coder;
    struct log_info table[LOG_TABLE_SIZE]; /* a ring as well */
    uint8_t table_first;
    uint8_t table_count;
};

void log_init(struct log *log);

/* Called by the control tick. */
void log_open(struct log *log, uint16_t log_id, uint16_t rate_hz, uint32_t sequence_crc, uint32_t now_ms);
void log_append(struct log *log, const struct proto_log_record *record, uint32_t now_ms);
void log_close(struct log *log, uint8_t end);

/* Called by the main loop. Offsets are absolute: block number * block size + position. */
uint32_t log_oldest_offset(const struct log *log);
uint32_t log_end_offset(const struct log *log);

/* Copies sealed bytes from `offset` on; false when the ring has overwritten the first of them. The caller
 * keeps the range below log_end_offset. */
bool log_copy(const struct log *log, uint32_t offset, uint8_t *out, size_t length);

/* CRC-32 of sealed bytes, under the same conditions. */
bool log_digest(const struct log *log, uint32_t offset, uint32_t length, uint32_t *crc);

/* The table's entry `index`, oldest first; false when there are not so many. */
bool log_entry(const struct log *log, uint8_t index, struct proto_log_entry *out);
uint8_t log_count(const struct log *log);

/* Forgets every log; false while one is open. */
bool log_erase(struct log *log);

#endif
