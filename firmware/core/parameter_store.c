/* The parameter store: two slots, of which one always holds a complete set, also after a power failure. */
#include "parameter_store.h"

#include <string.h>

#include "crc32.h"
#include "parameters.h"

enum word { MAGIC, FORMAT, SEQUENCE, RECORDS, SCHEMA, CRC, COMMIT, RESERVED, HEADER_WORDS };

enum { WORD = 4, RECORD = 2 * WORD, CHECKED_HEADER = CRC * WORD, FIRST_RECORD = HEADER_WORDS * WORD };
enum { MAX_RECORDS = (HAL_STORE_SLOT_SIZE - FIRST_RECORD) / RECORD };

#define MAGIC_WORD  0x52415054u /* "TPAR" */
#define FORMAT_WORD (1u | (uint32_t)RECORD << 16)
#define COMMIT_WORD                                                                                          \
    0x5AA5C33Cu /* sixteen ones: as far from erased (all ones) as from retired (all zeros)                   \
                 */
#define RETIRED_WORD 0u

/* This many wrong bits still count as committed, so that one bad cell does not make a saved set look unsaved.
 * Random bits match this closely once in eight million times. */
enum { COMMIT_TOLERANCE = 2 };

static uint32_t get_word(const uint8_t bytes[WORD])
{
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static uint32_t read_word(uint32_t slot, uint32_t offset)
{
    uint8_t bytes[WORD];
    hal_store_read(slot, offset, bytes, sizeof bytes);
    return get_word(bytes);
}

static uint32_t header_word(uint32_t slot, enum word word)
{
    return read_word(slot, (uint32_t)word * WORD);
}

static float as_float(uint32_t word)
{
    float value;
    memcpy(&value, &word, sizeof value);
    return value;
}

static uint32_t as_word(float value)
{
    uint32_t word;
    memcpy(&word, &value, sizeof word);
    return word;
}

struct record {
    uint32_t key;
    uint32_t value;
};

static struct record read_record(uint32_t slot, uint32_t index)
{
    uint8_t bytes[RECORD];
    hal_store_read(slot, FIRST_RECORD + index * RECORD, bytes, sizeof bytes);
    return (struct record){.key = get_word(bytes), .value = get_word(bytes + WORD)};
}

static uint32_t crc_of(uint32_t slot, uint32_t records)
{
    uint8_t chunk[CHECKED_HEADER];
    hal_store_read(slot, 0, chunk, CHECKED_HEADER);
    uint32_t crc = crc32_update(0, chunk, CHECKED_HEADER);
    for (uint32_t i = 0; i < records; i++) {
        hal_store_read(slot, FIRST_RECORD + i * RECORD, chunk, RECORD);
        crc = crc32_update(crc, chunk, RECORD);
    }
    return crc;
}

/* All that lies in front of the commit word is as it was written. */
static bool is_whole(uint32_t slot)
{
    const uint32_t records = header_word(slot, RECORDS);
    return header_word(slot, MAGIC) == MAGIC_WORD && header_word(slot, FORMAT) == FORMAT_WORD &&
           records <= MAX_RECORDS && header_word(slot, SEQUENCE) != 0 &&
           header_word(slot, CRC) == crc_of(slot, records);
}

static bool is_committed(uint32_t slot)
{
    uint32_t wrong = header_word(slot, COMMIT) ^ COMMIT_WORD;
    uint32_t bits = 0;
    while (wrong != 0) {
        wrong &= wrong - 1u;
        bits++;
    }
    return bits <= COMMIT_TOLERANCE;
}

/* All cells alike; on some parts an erased cell reads as zero. */
static bool is_blank(uint32_t slot)
{
    uint8_t chunk[64];
    hal_store_read(slot, 0, chunk, 1);
    const uint8_t first = chunk[0];
    bool alike = first == 0xFFu || first == 0;
    for (uint32_t offset = 0; alike && offset < HAL_STORE_SLOT_SIZE; offset += sizeof chunk) {
        hal_store_read(slot, offset, chunk, sizeof chunk);
        for (size_t i = 0; i < sizeof chunk; i++) {
            alike = alike && chunk[i] == first;
        }
    }
    return alike;
}

static uint8_t inspect(uint32_t slot)
{
    if (is_committed(slot)) {
        return is_whole(slot) ? PROTO_SLOT_STATE_GOOD : PROTO_SLOT_STATE_DAMAGED;
    }
    return is_blank(slot) ? PROTO_SLOT_STATE_BLANK : PROTO_SLOT_STATE_UNFINISHED;
}

void parameter_store_open(struct parameter_store *store)
{
    *store = (struct parameter_store){.newest = PARAMETER_STORE_NONE};
    for (uint32_t slot = 0; slot < HAL_STORE_SLOTS; slot++) {
        store->states[slot] = inspect(slot);
        /* A plain comparison: the cells wear out long before the number wraps. */
        if (store->states[slot] == PROTO_SLOT_STATE_GOOD && header_word(slot, SEQUENCE) > store->sequence) {
            store->newest = (uint8_t)slot;
            store->sequence = header_word(slot, SEQUENCE);
            store->records = (uint16_t)header_word(slot, RECORDS);
        }
    }
}

bool parameter_store_is_damaged(const struct parameter_store *store)
{
    for (uint32_t slot = 0; slot < HAL_STORE_SLOTS; slot++) {
        const bool fell_back =
            store->newest == PARAMETER_STORE_NONE && store->states[slot] == PROTO_SLOT_STATE_UNFINISHED;
        if (fell_back || store->states[slot] == PROTO_SLOT_STATE_DAMAGED) {
            return true;
        }
    }
    return false;
}

static bool find_key(const struct parameter_store *store, uint32_t key, uint32_t *value)
{
    for (uint32_t i = 0; i < store->records; i++) {
        const struct record record = read_record(store->newest, i);
        if (record.key == key) {
            *value = record.value;
            return true;
        }
    }
    return false;
}

static bool is_known(const struct parameter_table *table, uint32_t key)
{
    for (uint16_t i = 0; i < table->count; i++) {
        if (table->infos[i].key == key) {
            return true;
        }
    }
    return false;
}

bool parameter_store_find(const struct parameter_store *store, const struct proto_parameter_info *info,
                          float *value)
{
    uint32_t word;
    if (!find_key(store, info->key, &word) || parameters_check(info, as_float(word)) != PARAMETERS_OK) {
        return false;
    }
    *value = as_float(word);
    return true;
}

void parameter_store_load(const struct parameter_store *store, const struct parameter_table *table)
{
    for (uint16_t i = 0; i < table->count; i++) {
        if (!parameter_store_find(store, &table->infos[i], &table->values[i])) {
            table->values[i] = table->infos[i].default_value;
        }
    }
}

struct parameter_store_counts parameter_store_count(const struct parameter_store *store,
                                                    const struct parameter_table *table)
{
    struct parameter_store_counts counts = {0};
    uint32_t word;
    float value;
    for (uint16_t i = 0; i < table->count; i++) {
        if (parameter_store_find(store, &table->infos[i], &value)) {
            counts.stored++;
        } else if (find_key(store, table->infos[i].key, &word)) {
            counts.unfit++;
        }
    }
    counts.unknown = (uint16_t)(store->records - counts.stored - counts.unfit);
    return counts;
}

/* The newest set holds each of the table's values, bit by bit. */
static bool holds(const struct parameter_store *store, const struct parameter_table *table)
{
    uint32_t word;
    for (uint16_t i = 0; i < table->count; i++) {
        if (!find_key(store, table->infos[i].key, &word) || word != as_word(table->values[i])) {
            return false;
        }
    }
    return true;
}

uint8_t parameter_store_next_slot(const struct parameter_store *store)
{
    return store->newest == 0 ? 1 : 0;
}

/* A set under way into a slot. */
struct writing {
    uint32_t slot;
    uint32_t records;
    bool good;
};

static void put_word(struct writing *writing, uint32_t offset, uint32_t word)
{
    writing->good = writing->good && hal_store_program(writing->slot, offset, word);
}

static void put_record(struct writing *writing, uint32_t key, uint32_t value)
{
    if (writing->records < MAX_RECORDS) {
        put_word(writing, FIRST_RECORD + writing->records * RECORD, key);
        put_word(writing, FIRST_RECORD + writing->records * RECORD + WORD, value);
        writing->records++;
    }
}

static void put_header(struct writing *writing, enum word word, uint32_t value)
{
    put_word(writing, (uint32_t)word * WORD, value);
}

static void put_records(struct writing *writing, const struct parameter_store *store,
                        const struct parameter_table *table)
{
    for (uint16_t i = 0; i < table->count; i++) {
        put_record(writing, table->infos[i].key, as_word(table->values[i]));
    }
    /* Values that this image does not know are kept for the image that does. */
    for (uint32_t i = 0; i < store->records; i++) {
        const struct record record = read_record(store->newest, i);
        if (!is_known(table, record.key)) {
            put_record(writing, record.key, record.value);
        }
    }
}

/* Everything but the commit; false: what can be read back is not what was written. */
static bool write_set(const struct parameter_store *store, const struct parameter_table *table, uint32_t slot,
                      uint32_t *missed_ticks)
{
    struct writing writing = {.slot = slot, .good = true};
    /* Retired first, or an interrupted erase could leave a commit in front of a corrupt set, which would be
     * reported as damage. */
    put_header(&writing, COMMIT, RETIRED_WORD);
    hal_watchdog_feed(); /* the erase takes up to 0.8 s of the watchdog's second */
    writing.good = writing.good && hal_store_erase(slot, missed_ticks);
    hal_watchdog_feed();
    put_records(&writing, store, table);
    put_header(&writing, MAGIC, MAGIC_WORD);
    put_header(&writing, FORMAT, FORMAT_WORD);
    put_header(&writing, SEQUENCE, store->sequence + 1u);
    put_header(&writing, RECORDS, writing.records);
    put_header(&writing, SCHEMA, PROTO_SCHEMA_HASH);
    if (!writing.good) {
        return false;
    }
    put_header(&writing, CRC, crc_of(slot, writing.records));
    const struct parameter_store written = {.newest = (uint8_t)slot, .records = (uint16_t)writing.records};
    return writing.good && is_whole(slot) && header_word(slot, SEQUENCE) == store->sequence + 1u &&
           header_word(slot, RECORDS) == writing.records && holds(&written, table);
}

enum parameter_store_result parameter_store_save(struct parameter_store *store,
                                                 const struct parameter_table *table, uint32_t *missed_ticks)
{
    *missed_ticks = 0;
    if (store->newest != PARAMETER_STORE_NONE && !parameter_store_is_damaged(store) && holds(store, table)) {
        return PARAMETER_STORE_UNCHANGED; /* spares the cells and the pause */
    }
    const uint32_t slot = parameter_store_next_slot(store);
    bool saved = write_set(store, table, slot, missed_ticks);
    if (saved) {
        /* The content read back decides, here as at the next start, not the status that the memory
         * reports. */
        (void)hal_store_program(slot, COMMIT * WORD, COMMIT_WORD);
        saved = inspect(slot) == PROTO_SLOT_STATE_GOOD;
    }
    if (saved && store->states[1u - slot] == PROTO_SLOT_STATE_DAMAGED) {
        (void)hal_store_program(1u - slot, COMMIT * WORD, RETIRED_WORD); /* repaired: no longer a fault */
    }
    parameter_store_open(store);
    return saved ? PARAMETER_STORE_SAVED : PARAMETER_STORE_FAILED;
}
