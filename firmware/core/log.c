/* The log's memory: a ring of cells, in which each sealed block takes as many as it needs. */
#include "log.h"

#include <string.h>

#include "crc32.h"

static const uint32_t cell_size = PROTO_LOG_CELL_SIZE;
/* The CRC is the header's last field. */
static const size_t header_before_crc = PROTO_LOG_HEADER_SIZE - sizeof(uint32_t);

void log_init(struct log *log)
{
    memset(log, 0, sizeof *log);
    for (uint32_t i = 0; i < (uint32_t)HAL_LOG_MEMORIES; i++) {
        hal_log_memory(i, &log->memory[i]);
        log->cells += (uint32_t)log->memory[i].size / cell_size;
    }
}

/* Where `offset` lies, and in *length how many of the bytes wanted from there on lie together. */
static uint8_t *place(const struct log *log, uint32_t offset, size_t *length)
{
    const uint32_t from_start = ((offset / cell_size) % log->cells) * cell_size + offset % cell_size;
    size_t position = from_start;
    uint32_t memory = 0;
    size_t size = log->memory[0].size / cell_size * cell_size;
    while (position >= size) {
        position -= size;
        memory++;
        size = log->memory[memory].size / cell_size * cell_size;
    }
    if (*length > size - position) {
        *length = size - position;
    }
    return log->memory[memory].start + position;
}

void log_copy(const struct log *log, uint32_t offset, uint8_t *out, size_t length)
{
    size_t done = 0;
    while (done < length) {
        size_t run = length - done;
        const uint8_t *const from = place(log, offset + (uint32_t)done, &run);
        memcpy(out + done, from, run);
        done += run;
    }
}

static void store(struct log *log, uint32_t offset, const uint8_t *from, size_t length)
{
    size_t done = 0;
    while (done < length) {
        size_t run = length - done;
        uint8_t *const to = place(log, offset + (uint32_t)done, &run);
        memcpy(to, from + done, run);
        done += run;
    }
}

uint32_t log_digest(const struct log *log, uint32_t offset, uint32_t length)
{
    uint32_t crc = 0;
    uint32_t done = 0;
    while (done < length) {
        size_t run = length - done;
        const uint8_t *const from = place(log, offset + done, &run);
        crc = crc32_update(crc, from, run);
        done += (uint32_t)run;
    }
    return crc;
}

static struct proto_log_header header_at(const struct log *log, uint32_t cell)
{
    uint8_t bytes[PROTO_LOG_HEADER_SIZE];
    struct proto_log_header header;
    log_copy(log, cell * cell_size, bytes, sizeof bytes);
    (void)proto_log_header_decode(&header, bytes, sizeof bytes);
    return header;
}

/* At least one, so that a walk over the blocks advances even where the memory is corrupt. */
static uint32_t cells_of(uint32_t used)
{
    return used > cell_size ? (used + cell_size - 1u) / cell_size : 1u;
}

/* One past the last block that may be read. */
static uint32_t shown_end(const struct log *log)
{
    return log->hidden ? log->hidden_cell : log->end_cell;
}

/* Cells and times count modulo 2^32. */
static bool is_before(uint32_t earlier, uint32_t later)
{
    return (int32_t)(later - earlier) > 0;
}

static bool before_end(const struct log *log, uint32_t cell)
{
    return is_before(cell, shown_end(log));
}

static void start_block(struct log *log)
{
    log->first_record = log->record_count;
    log_coder_start(&log->coder, &log->opening.format, log->first_record, log->block + PROTO_LOG_HEADER_SIZE,
                    sizeof log->block - PROTO_LOG_HEADER_SIZE);
}

/* An eighth of what is kept, so that little more is kept than that; a second at least, for its header. */
static uint32_t armed_block(const struct log_opening *opening)
{
    enum { PARTS = 8, MIN_MS = 1000, MS_PER_S = 1000 };
    const uint32_t part_ms = opening->before_ms / (uint32_t)PARTS;
    return (part_ms > (uint32_t)MIN_MS ? part_ms : (uint32_t)MIN_MS) * opening->format.rate_hz /
           (uint32_t)MS_PER_S;
}

void log_open(struct log *log, const struct log_opening *opening)
{
    log_close(log, PROTO_LOG_END_STOPPED);
    log->open = true;
    log->opening = *opening;
    log->record_count = 0;
    log->end_ms = opening->start_ms;
    log->hidden = opening->armed;
    log->hidden_cell = log->end_cell;
    log->fired = false;
    log->max_records = opening->armed ? armed_block(opening) : UINT16_MAX;
    start_block(log);
}

void log_fire(struct log *log, uint32_t t_ms)
{
    log->fired = true;
    log->fired_ms = log->opening.start_ms + t_ms;
    log->max_records = UINT16_MAX;
}

/* Puts the header before the records that follow it, in the block's place. */
static void write_header(struct log *log, struct proto_log_header *header)
{
    (void)proto_log_header_encode(header, log->block, PROTO_LOG_HEADER_SIZE);
    header->crc32 =
        crc32_update(crc32_update(0, log->block, header_before_crc), log->block + PROTO_LOG_HEADER_SIZE,
                     header->used - (size_t)PROTO_LOG_HEADER_SIZE);
    (void)proto_log_header_encode(header, log->block, PROTO_LOG_HEADER_SIZE);
}

/* Discards the armed log's blocks that ended before the span to be kept, and closes the gap: however long
 * it is armed, older logs lose no more memory than that span needs. Uses the place of the block that was
 * sealed. */
static void trim(struct log *log)
{
    const uint32_t from_ms = (log->fired ? log->fired_ms : log->end_ms) - log->opening.before_ms;
    uint32_t to = log->hidden_cell;
    uint32_t from = to;
    bool keep = false;
    while (is_before(from, log->end_cell)) {
        struct proto_log_header header = header_at(log, from);
        if (header.used < PROTO_LOG_HEADER_SIZE || header.used > PROTO_LOG_BLOCK_LIMIT) {
            break; /* corrupt memory: the start of the next block is unknown */
        }
        const uint32_t cells = cells_of(header.used);
        keep = keep || is_before(from_ms, header.end_ms);
        if (keep && to != from) {
            log_copy(log, from * cell_size, log->block, (size_t)cells * cell_size);
            header.cell = to;
            write_header(log, &header);
            store(log, to * cell_size, log->block, (size_t)cells * cell_size);
        }
        to += keep ? cells : 0u;
        from += cells;
    }
    log->end_cell = to;
}

/* Puts the block into the ring, in the place of the oldest ones. */
static void seal_block(struct log *log, uint8_t end)
{
    const size_t size = log_coder_finish(&log->coder);
    const size_t used = PROTO_LOG_HEADER_SIZE + size;
    const uint32_t cells = cells_of((uint32_t)used);
    struct proto_log_header header = {
        .cell = log->end_cell,
        .log_id = log->opening.log_id,
        .used = (uint16_t)used,
        .records = (uint16_t)(log->record_count - log->first_record),
        .version = PROTO_LOG_RECORD_VERSION,
        .end = end,
        .first_record = log->first_record,
        .start_ms = log->opening.start_ms,
        .end_ms = log->end_ms,
        .sequence_crc = log->opening.sequence_crc,
        .metres_per_count = log->opening.format.geometry.metres_per_count,
        .turns_per_count = log->opening.format.geometry.turns_per_count,
        .rate_hz = log->opening.format.rate_hz,
    };
    write_header(log, &header);
    const size_t whole = (size_t)cells * cell_size;
    memset(log->block + used, 0, whole - used);
    while (log->end_cell - log->oldest_cell + cells > log->cells) {
        log->oldest_cell += cells_of(header_at(log, log->oldest_cell).used);
    }
    store(log, log->end_cell * cell_size, log->block, whole);
    log->end_cell += cells;
    if (log->hidden) {
        if (is_before(log->hidden_cell, log->oldest_cell)) {
            log->hidden_cell = log->oldest_cell; /* it filled the ring and overwrote its own beginning */
        }
        trim(log);
    }
}

void log_append(struct log *log, const struct proto_log_record *record)
{
    if (!log->open) {
        return;
    }
    if (PROTO_LOG_HEADER_SIZE + log_coder_size(&log->coder) >= (size_t)LOG_FULL ||
        log->record_count - log->first_record >= log->max_records) {
        seal_block(log, PROTO_LOG_END_OPEN);
        start_block(log);
    }
    log_coder_add(&log->coder, record);
    log->record_count++;
    log->end_ms = log->opening.start_ms + record->t_ms;
}

void log_close(struct log *log, uint8_t end)
{
    if (end == (uint8_t)LOG_END_DISCARDED) {
        log->end_cell = shown_end(log);
    } else if (log->open && log->record_count != 0) {
        seal_block(log, end);
    } else {
        /* There is nothing to keep. */
    }
    log->open = false;
    log->hidden = false;
}

uint32_t log_oldest_offset(const struct log *log)
{
    return log->oldest_cell * cell_size;
}

uint32_t log_end_offset(const struct log *log)
{
    return shown_end(log) * cell_size;
}

struct log_walk log_walk_start(const struct log *log)
{
    return (struct log_walk){.cell = log->oldest_cell};
}

/* The open log, of which no block has been sealed or is left. */
static struct proto_log_entry open_entry(const struct log *log)
{
    return (struct proto_log_entry){
        .log_id = log->opening.log_id,
        .truncated = log->first_record != 0,
        .rate_hz = log->opening.format.rate_hz,
        .first_cell = log->end_cell,
        .start_ms = log->opening.start_ms,
        .sequence_crc = log->opening.sequence_crc,
    };
}

/* Takes one more block of the same log into its entry. */
static void extend(struct proto_log_entry *entry, const struct proto_log_header *header)
{
    entry->end = header->end;
    entry->cell_count += cells_of(header->used);
    entry->record_count = header->first_record + header->records;
    entry->end_ms = header->end_ms;
}

bool log_walk_next(const struct log *log, struct log_walk *walk, struct proto_log_entry *out)
{
    if (before_end(log, walk->cell)) {
        struct proto_log_header header = header_at(log, walk->cell);
        *out = (struct proto_log_entry){
            .log_id = header.log_id,
            .truncated = header.first_record != 0,
            .rate_hz = header.rate_hz,
            .first_cell = walk->cell,
            .start_ms = header.start_ms,
            .sequence_crc = header.sequence_crc,
        };
        do {
            extend(out, &header);
            walk->cell += cells_of(header.used);
            if (before_end(log, walk->cell)) {
                header = header_at(log, walk->cell);
            }
        } while (before_end(log, walk->cell) && header.log_id == out->log_id);
    } else if (log->open && !log->hidden && !walk->open_seen) {
        *out = open_entry(log);
    } else {
        return false;
    }
    if (log->open && out->log_id == log->opening.log_id) {
        walk->open_seen = true;
        out->end = PROTO_LOG_END_OPEN;
        out->record_count = log->record_count;
        out->end_ms = log->end_ms;
    }
    return true;
}

bool log_erase(struct log *log)
{
    if (!log->open) {
        log->oldest_cell = log->end_cell;
    }
    return !log->open;
}
