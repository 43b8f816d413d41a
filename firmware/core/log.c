/* The log's memory: a ring of blocks that are sealed one by one, and a table of the logs in it. */
#include "log.h"

#include <string.h>

#include "crc32.h"
#include "hal.h"

static uint8_t *block_bytes(struct log *log, uint32_t block)
{
    return log->ring[block % PROTO_LOG_BLOCK_COUNT];
}

static struct log_info *newest(struct log *log)
{
    return &log->table[(log->table_first + log->table_count - 1u) % LOG_TABLE_SIZE];
}

static void forget_oldest_log(struct log *log)
{
    log->table_first = (uint8_t)((log->table_first + 1u) % LOG_TABLE_SIZE);
    log->table_count--;
}

void log_init(struct log *log)
{
    log->oldest_block = 0;
    log->end_block = 0;
    log->open = false;
    log->used = 0;
    log->records = 0;
    log->table_first = 0;
    log->table_count = 0;
}

void log_open(struct log *log, uint16_t log_id, uint16_t rate_hz, uint32_t sequence_crc, uint32_t now_ms)
{
    if (log->table_count == LOG_TABLE_SIZE) {
        forget_oldest_log(log);
        log->oldest_block = log->table[log->table_first].first_block;
    }
    log->table_count++;
    *newest(log) = (struct log_info){
        .log_id = log_id,
        .rate_hz = rate_hz,
        .end = PROTO_LOG_END_OPEN,
        .first_block = log->end_block,
        .end_block = log->end_block,
        .start_ms = now_ms,
        .end_ms = now_ms,
        .sequence_crc = sequence_crc,
    };
    log->open = true;
}

/* Takes the next block of the ring. Readers must see the old one as gone before its first byte changes. */
static void open_block(struct log *log)
{
    if (log->end_block - log->oldest_block >= PROTO_LOG_BLOCK_COUNT) {
        log->oldest_block = log->oldest_block + 1u;
        /* Every log but the open one has at least one block, so at most one is overwritten by one block. */
        const struct log_info *const oldest = &log->table[log->table_first];
        if (oldest->end_block <= log->oldest_block) {
            forget_oldest_log(log);
        }
    }
    memset(&log->coder, 0, sizeof log->coder);
    log->used = PROTO_LOG_HEADER_SIZE;
    log->records = 0;
}

static void seal_block(struct log *log)
{
    uint8_t *const bytes = block_bytes(log, log->end_block);
    const struct proto_log_header header = {
        .block_number = log->end_block,
        .log_id = newest(log)->log_id,
        .used = log->used,
        .records = log->records,
        .version = PROTO_LOG_RECORD_VERSION,
    };
    (void)proto_log_header_encode(&header, bytes, PROTO_LOG_HEADER_SIZE);
    memset(bytes + log->used, 0, PROTO_LOG_BLOCK_SIZE - log->used);
    log->used = 0;
    log->end_block = log->end_block + 1u;
    newest(log)->end_block = log->end_block;
}

void log_append(struct log *log, const struct proto_log_record *record, uint32_t now_ms)
{
    uint32_t words[PROTO_LOG_FIELD_COUNT];
    uint8_t coded[LOG_CODING_MAX_SIZE];
    if (!log->open) {
        return;
    }
    if (log->used == 0) {
        open_block(log);
    }
    proto_log_record_to_words(record, words);
    size_t size = log_coder_encode(&log->coder, words, coded);
    if (log->used + size > PROTO_LOG_BLOCK_SIZE) {
        seal_block(log);
        open_block(log);
        size = log_coder_encode(&log->coder, words, coded);
    }
    memcpy(block_bytes(log, log->end_block) + log->used, coded, size);
    log_coder_accept(&log->coder, words);
    log->used = (uint16_t)(log->used + size);
    log->records++;
    newest(log)->record_count++;
    newest(log)->end_ms = now_ms;
}

void log_close(struct log *log, uint8_t end)
{
    if (!log->open) {
        return;
    }
    if (log->used != 0) {
        seal_block(log);
    }
    newest(log)->end = end;
    log->open = false;
}

uint32_t log_oldest_offset(const struct log *log)
{
    return log->oldest_block * PROTO_LOG_BLOCK_SIZE;
}

uint32_t log_end_offset(const struct log *log)
{
    return log->end_block * PROTO_LOG_BLOCK_SIZE;
}

/* The longest run of bytes from `offset` on that lies together in the ring. */
static const uint8_t *run_at(const struct log *log, uint32_t offset, size_t *length)
{
    const uint32_t ring_size = PROTO_LOG_BLOCK_COUNT * PROTO_LOG_BLOCK_SIZE;
    const uint32_t position = (offset / PROTO_LOG_BLOCK_SIZE) % PROTO_LOG_BLOCK_COUNT * PROTO_LOG_BLOCK_SIZE +
                              offset % PROTO_LOG_BLOCK_SIZE;
    if (*length > ring_size - position) {
        *length = ring_size - position;
    }
    return &log->ring[0][0] + position;
}

/* Offsets count modulo 2^32, hence the difference. The fence keeps the copy before the question. */
static bool still_there(const struct log *log, uint32_t offset)
{
    __atomic_signal_fence(__ATOMIC_SEQ_CST);
    return log_end_offset(log) - offset <= log_end_offset(log) - log_oldest_offset(log);
}

bool log_copy(const struct log *log, uint32_t offset, uint8_t *out, size_t length)
{
    size_t done = 0;
    while (done < length) {
        size_t run = length - done;
        const uint8_t *const from = run_at(log, offset + (uint32_t)done, &run);
        memcpy(out + done, from, run);
        done += run;
    }
    return still_there(log, offset);
}

bool log_digest(const struct log *log, uint32_t offset, uint32_t length, uint32_t *crc)
{
    uint32_t done = 0;
    *crc = 0;
    while (done < length) {
        size_t run = length - done;
        const uint8_t *const from = run_at(log, offset + done, &run);
        *crc = crc32_update(*crc, from, run);
        done += (uint32_t)run;
    }
    return still_there(log, offset);
}

bool log_entry(const struct log *log, uint8_t index, struct proto_log_entry *out)
{
    const uint32_t state = hal_critical_enter();
    const bool there = index < log->table_count;
    const struct log_info info = log->table[(log->table_first + index) % LOG_TABLE_SIZE];
    const uint32_t oldest = log->oldest_block;
    hal_critical_exit(state);
    if (!there) {
        return false;
    }
    const bool truncated = info.first_block < oldest;
    const uint32_t first = truncated ? oldest : info.first_block;
    *out = (struct proto_log_entry){
        .log_id = info.log_id,
        .end = info.end,
        .truncated = truncated,
        .rate_hz = info.rate_hz,
        .first_block = first,
        .block_count = info.end_block > first ? info.end_block - first : 0,
        .record_count = info.record_count,
        .start_ms = info.start_ms,
        .end_ms = info.end_ms,
        .sequence_crc = info.sequence_crc,
    };
    return true;
}

uint8_t log_count(const struct log *log)
{
    return log->table_count;
}

bool log_erase(struct log *log)
{
    const uint32_t state = hal_critical_enter();
    const bool closed = !log->open;
    if (closed) {
        log->oldest_block = log->end_block;
        log->table_count = 0;
    }
    hal_critical_exit(state);
    return closed;
}
