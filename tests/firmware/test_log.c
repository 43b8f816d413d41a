/* The log's ring: sealed blocks do not change, and old ones are overwritten in order. */
#include "log.h"

#include <stdlib.h>
#include <string.h>

#include "crc32.h"
#include "hal_host.h"
#include "log_decoder.h"
#include "log_feed.h"
#include "random.h"
#include "unity.h"

enum { MAX_RECORDS = 4096 };

static struct log ring;
static struct hal_host board;
static uint32_t ring_size;
static uint8_t bytes[HAL_LOG_MEMORIES * HAL_HOST_LOG_SIZE];
static struct proto_log_record decoded[MAX_RECORDS];

static void power_up(size_t first_memory, size_t second_memory)
{
    hal_host_init(&board);
    hal_host_select(&board);
    board.log_memory_size[0] = first_memory;
    board.log_memory_size[1] = second_memory;
    memset(board.log_memory, 0xA5, sizeof board.log_memory);
    memset(&ring, 0xA5, sizeof ring);
    log_init(&ring);
    ring_size = ring.cells * PROTO_LOG_CELL_SIZE;
    random_seed(11);
}

void setUp(void)
{
    power_up(8192, 16384 + 20); /* an odd rest is left alone */
    TEST_ASSERT_EQUAL_UINT32(8192 + 16384, ring_size);
}

void tearDown(void)
{
}

/* Record `i` of a noisy drive; the same `i` gives the same record. */
static struct proto_log_record record_of(uint32_t i)
{
    const int32_t noise = (int32_t)((i * 2654435761u) >> 28);
    return (struct proto_log_record){
        .t_ms = i * 50u,
        .mode = PROTO_MODE_EFFORT,
        .cmd_left = 3500,
        .cmd_right = 3500,
        .effort_left = 3500,
        .effort_right = 3500,
        .counts_left = (int32_t)(i * 150u) + noise,
        .counts_right = (int32_t)(i * 152u) - noise,
        .speed_left = (int16_t)(500 + noise),
        .speed_right = (int16_t)(505 - noise),
        .x_mm = (int32_t)(i * 25u),
        .y_mm = (int32_t)(i / 10u),
        .theta_e4 = (int32_t)(i * 12u) + noise,
        .battery_10mv = (uint16_t)(1200 - i % 3),
    };
}

static void open_log(uint16_t log_id)
{
    const struct log_opening opening = {
        .log_id = log_id,
        .start_ms = 1000u * log_id,
        .sequence_crc = 0xC0FFEEu + log_id,
        .format = {.geometry = {0.00016624259f, 9.3492346e-05f}, .rate_hz = 20},
    };
    log_open(&ring, &opening);
}

static void append(uint32_t first, uint32_t count)
{
    for (uint32_t i = first; i < first + count; i++) {
        const struct proto_log_record record = record_of(i);
        log_append(&ring, &record);
    }
}

static void write_log(uint16_t log_id, uint32_t records)
{
    open_log(log_id);
    append(0, records);
    log_close(&ring, PROTO_LOG_END_FINISHED);
}

/* The log's entry `index`, oldest first. */
static bool entry_at(uint32_t index, struct proto_log_entry *out)
{
    struct log_walk walk = log_walk_start(&ring);
    for (uint32_t i = 0; i <= index; i++) {
        if (!log_walk_next(&ring, &walk, out)) {
            return false;
        }
    }
    return true;
}

static uint32_t log_count(void)
{
    struct proto_log_entry entry;
    uint32_t count = 0;
    while (entry_at(count, &entry)) {
        count++;
    }
    return count;
}

static uint32_t digest(uint32_t offset, uint32_t length)
{
    return log_digest(&ring, offset, length);
}

/* Decodes the sealed block at a cell; returns its records, and in *cell where the next one begins. */
static int decode_at(uint32_t *cell, uint16_t log_id)
{
    uint8_t block[PROTO_LOG_BLOCK_LIMIT];
    const uint32_t left = log_end_offset(&ring) - *cell * PROTO_LOG_CELL_SIZE;
    log_copy(&ring, *cell * PROTO_LOG_CELL_SIZE, block, left < sizeof block ? left : sizeof block);
    const int found = log_decoder_block(block, *cell, log_id, decoded, MAX_RECORDS);
    *cell += log_decoder_span(block) / PROTO_LOG_CELL_SIZE;
    return found;
}

/* Decodes all blocks of a log entry; returns the number of records found, each as record_of says from `first`
 * on. */
static uint32_t check_records(const struct proto_log_entry *entry, uint32_t first)
{
    uint32_t count = 0;
    for (uint32_t cell = entry->first_cell; cell < entry->first_cell + entry->cell_count;) {
        const int found = decode_at(&cell, entry->log_id);
        TEST_ASSERT_TRUE(found > 0);
        for (int i = 0; i < found; i++) {
            const struct proto_log_record expected = record_of(first + count);
            uint32_t expected_words[16];
            uint32_t found_words[16];
            proto_log_record_to_words(&expected, expected_words);
            proto_log_record_to_words(&decoded[i], found_words);
            TEST_ASSERT_EQUAL_UINT32_ARRAY(expected_words, found_words, 16);
            count++;
        }
    }
    return count;
}

static void log_comes_back_record_by_record(void)
{
    struct proto_log_entry entry;
    write_log(1, 3000);
    TEST_ASSERT_TRUE(entry_at(0, &entry));
    TEST_ASSERT_EQUAL_UINT32(3000, entry.record_count);
    TEST_ASSERT_EQUAL_UINT32(3000, check_records(&entry, 0));
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_FINISHED, entry.end);
    TEST_ASSERT_EQUAL_UINT8(0, entry.truncated);
    TEST_ASSERT_EQUAL_UINT16(20, entry.rate_hz);
    TEST_ASSERT_EQUAL_HEX32(0xC0FFEE + 1, entry.sequence_crc);
    TEST_ASSERT_EQUAL_UINT32(1000, entry.start_ms);
    TEST_ASSERT_EQUAL_UINT32(1000 + 2999 * 50, entry.end_ms);
    printf("noisy drive: %.2f bytes per record\n", entry.cell_count * (double)PROTO_LOG_CELL_SIZE / 3000.0);
}

static void logs_follow_one_another_and_each_begins_a_block(void)
{
    struct proto_log_entry entry;
    uint32_t next = 0;
    for (uint16_t id = 1; id <= 5; id++) {
        write_log(id, 100u * id);
    }
    TEST_ASSERT_EQUAL_UINT32(5, log_count());
    for (uint32_t i = 0; i < 5; i++) {
        TEST_ASSERT_TRUE(entry_at(i, &entry));
        TEST_ASSERT_EQUAL_UINT16(i + 1, entry.log_id);
        TEST_ASSERT_EQUAL_UINT32(next, entry.first_cell);
        TEST_ASSERT_EQUAL_UINT32(100u * (i + 1u), check_records(&entry, 0));
        next += entry.cell_count;
    }
    TEST_ASSERT_EQUAL_UINT32(next * PROTO_LOG_CELL_SIZE, log_end_offset(&ring));
}

static void open_log_is_listed_with_what_is_sealed_of_it(void)
{
    struct proto_log_entry entry;
    write_log(1, 50);
    open_log(2);
    append(0, 1);
    TEST_ASSERT_EQUAL_UINT32(2, log_count());
    TEST_ASSERT_TRUE(entry_at(1, &entry));
    TEST_ASSERT_EQUAL_UINT16(2, entry.log_id);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_OPEN, entry.end);
    TEST_ASSERT_EQUAL_UINT32(0, entry.cell_count);
    TEST_ASSERT_EQUAL_UINT32(1, entry.record_count);
    append(1, 1999);
    TEST_ASSERT_TRUE(entry_at(1, &entry));
    TEST_ASSERT_TRUE(entry.cell_count > 0);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_OPEN, entry.end);
    TEST_ASSERT_EQUAL_UINT32(2000, entry.record_count);
    TEST_ASSERT_EQUAL_UINT32(2000 + 1999 * 50, entry.end_ms);
    TEST_ASSERT_TRUE(check_records(&entry, 0) < 2000);
    TEST_ASSERT_EQUAL_UINT32(2, log_count());
}

static void log_that_opens_while_another_is_open_ends_that_one(void)
{
    struct proto_log_entry entry;
    open_log(1);
    append(0, 10);
    open_log(2);
    append(0, 10);
    log_close(&ring, PROTO_LOG_END_FAULT);
    TEST_ASSERT_TRUE(entry_at(0, &entry));
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_STOPPED, entry.end);
    TEST_ASSERT_TRUE(entry_at(1, &entry));
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_FAULT, entry.end);
    const struct proto_log_record late = record_of(10);
    log_append(&ring, &late);
    TEST_ASSERT_TRUE(entry_at(1, &entry));
    TEST_ASSERT_EQUAL_UINT32(10, entry.record_count);
}

static void long_log_wraps_and_keeps_its_newest_blocks(void)
{
    struct proto_log_entry entry;
    write_log(1, 30000);
    TEST_ASSERT_TRUE(entry_at(0, &entry));
    TEST_ASSERT_EQUAL_UINT8(1, entry.truncated);
    TEST_ASSERT_TRUE(entry.cell_count > ring.cells - 2u * PROTO_LOG_BLOCK_LIMIT / PROTO_LOG_CELL_SIZE);
    TEST_ASSERT_TRUE(entry.cell_count <= ring.cells);
    TEST_ASSERT_EQUAL_UINT32(log_oldest_offset(&ring), entry.first_cell * PROTO_LOG_CELL_SIZE);
    TEST_ASSERT_EQUAL_UINT32(log_end_offset(&ring),
                             (entry.first_cell + entry.cell_count) * PROTO_LOG_CELL_SIZE);
    /* The time of the first record shows where the kept part begins. */
    uint32_t cell = entry.first_cell;
    TEST_ASSERT_TRUE(decode_at(&cell, 1) > 0);
    const uint32_t first = decoded[0].t_ms / 50;
    TEST_ASSERT_EQUAL_UINT32(30000 - first, check_records(&entry, first));
}

static void overwritten_logs_leave_the_list_in_order(void)
{
    struct proto_log_entry entry;
    write_log(1, 500);
    write_log(2, 500);
    open_log(3);
    uint32_t i = 0;
    bool saw_two = false;
    while (entry_at(0, &entry) && entry.log_id < 3) {
        append(i++, 1);
        TEST_ASSERT_TRUE(entry_at(0, &entry));
        saw_two = saw_two || entry.log_id == 2;
        TEST_ASSERT_TRUE(entry.first_cell * PROTO_LOG_CELL_SIZE >= log_oldest_offset(&ring));
        TEST_ASSERT_TRUE(entry.cell_count > 0);
    }
    TEST_ASSERT_TRUE(saw_two);
    TEST_ASSERT_EQUAL_UINT32(1, log_count());
    log_close(&ring, PROTO_LOG_END_STOPPED);
    TEST_ASSERT_TRUE(entry_at(0, &entry));
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_STOPPED, entry.end);
}

static void sealed_blocks_never_change_while_they_last(void)
{
    static uint32_t crc_of[20000];
    uint32_t known_end = 0;
    open_log(1);
    for (uint32_t i = 0; i < 30000; i++) {
        append(i * 7919u, 1);
        for (; known_end < ring.end_cell; known_end++) {
            crc_of[known_end] = digest(known_end * PROTO_LOG_CELL_SIZE, PROTO_LOG_CELL_SIZE);
        }
        if (i % 97 == 0) {
            for (uint32_t cell = ring.oldest_cell; cell < known_end; cell++) {
                TEST_ASSERT_EQUAL_HEX32(crc_of[cell],
                                        digest(cell * PROTO_LOG_CELL_SIZE, PROTO_LOG_CELL_SIZE));
            }
        }
    }
    TEST_ASSERT_TRUE(known_end > 2 * ring.cells);
}

static void copy_and_digest_cross_the_pieces_of_memory(void)
{
    static uint8_t one_by_one[sizeof bytes];
    write_log(1, 30000);
    const uint32_t oldest = log_oldest_offset(&ring);
    const uint32_t held = log_end_offset(&ring) - oldest;
    TEST_ASSERT_NOT_EQUAL(0, oldest % ring_size);
    log_copy(&ring, oldest, bytes, held);
    for (uint32_t i = 0; i < held; i++) {
        log_copy(&ring, oldest + i, &one_by_one[i], 1);
    }
    TEST_ASSERT_EQUAL_INT(0, memcmp(bytes, one_by_one, held));
    TEST_ASSERT_EQUAL_HEX32(crc32_update(0, bytes, held), digest(oldest, held));
}

static void board_with_one_piece_of_memory_has_a_shorter_ring(void)
{
    struct proto_log_entry entry;
    power_up(8192, 0);
    write_log(1, 20000);
    TEST_ASSERT_TRUE(entry_at(0, &entry));
    TEST_ASSERT_EQUAL_UINT32(8192 / PROTO_LOG_CELL_SIZE, ring.cells);
    TEST_ASSERT_TRUE(entry.cell_count <= ring.cells);
    uint32_t cell = entry.first_cell;
    TEST_ASSERT_TRUE(decode_at(&cell, 1) > 0);
    TEST_ASSERT_TRUE(check_records(&entry, decoded[0].t_ms / 50) > 0);
}

static void erased_logs_are_gone_and_offsets_count_on(void)
{
    struct proto_log_entry entry;
    write_log(1, 500);
    const uint32_t end = log_end_offset(&ring);
    open_log(2);
    TEST_ASSERT_FALSE(log_erase(&ring));
    append(0, 1);
    log_close(&ring, PROTO_LOG_END_STOPPED);
    TEST_ASSERT_TRUE(log_erase(&ring));
    TEST_ASSERT_EQUAL_UINT32(0, log_count());
    TEST_ASSERT_EQUAL_UINT32(log_end_offset(&ring), log_oldest_offset(&ring));
    write_log(3, 100);
    TEST_ASSERT_TRUE(entry_at(0, &entry));
    TEST_ASSERT_EQUAL_UINT16(3, entry.log_id);
    TEST_ASSERT_TRUE(entry.first_cell * PROTO_LOG_CELL_SIZE >= end);
    TEST_ASSERT_EQUAL_UINT32(100, check_records(&entry, 0));
}

static void many_short_logs_are_all_listed_until_the_ring_is_full(void)
{
    struct proto_log_entry entry;
    power_up(32768, 65536);
    for (uint16_t id = 1; id <= 300; id++) {
        write_log(id, 3);
    }
    TEST_ASSERT_EQUAL_UINT32(300, log_count());
    for (uint16_t id = 301; id <= 1000; id++) {
        write_log(id, 3);
    }
    const uint32_t count = log_count();
    TEST_ASSERT_TRUE(entry_at(0, &entry));
    TEST_ASSERT_EQUAL_UINT16(1001 - count, entry.log_id);
    TEST_ASSERT_EQUAL_UINT32(3, check_records(&entry, 0));
    TEST_ASSERT_TRUE(entry_at(count - 1, &entry));
    TEST_ASSERT_EQUAL_UINT16(1000, entry.log_id);
}

static void list_ends_even_when_the_memory_has_gone_bad(void)
{
    write_log(1, 5000);
    for (uint32_t i = 0; i < 1000; i++) {
        board.log_memory[random_below(2)][random_below(8192)] = (uint8_t)random_u32();
        TEST_ASSERT_TRUE(log_count() <= ring.cells + 1);
    }
    memset(board.log_memory, 0, sizeof board.log_memory);
    TEST_ASSERT_TRUE(log_count() <= ring.cells);
    write_log(2, 5000);
    TEST_ASSERT_TRUE(log_end_offset(&ring) - log_oldest_offset(&ring) <= ring_size);
}

static void random_logs_of_random_records_all_come_back(void)
{
    static uint32_t kept[20000][16];
    for (uint16_t id = 1; id <= 60; id++) {
        const uint32_t count = 1 + random_below(200);
        open_log(id);
        for (uint32_t i = 0; i < count; i++) {
            struct proto_log_record record;
            uint32_t words[16];
            for (int field = 0; field < 16; field++) {
                words[field] = random_u32() >> random_below(32);
            }
            proto_log_record_from_words(&record, words);
            proto_log_record_to_words(&record, kept[i]);
            log_append(&ring, &record);
        }
        log_close(&ring, PROTO_LOG_END_FINISHED);
        struct proto_log_entry entry;
        TEST_ASSERT_TRUE(entry_at(log_count() - 1, &entry));
        uint32_t found = 0;
        for (uint32_t cell = entry.first_cell; cell < entry.first_cell + entry.cell_count;) {
            const int in_block = decode_at(&cell, id);
            TEST_ASSERT_TRUE(in_block > 0);
            for (int i = 0; i < in_block; i++) {
                uint32_t words[16];
                proto_log_record_to_words(&decoded[i], words);
                TEST_ASSERT_EQUAL_UINT32_ARRAY(kept[found], words, 16);
                found++;
            }
        }
        TEST_ASSERT_EQUAL_UINT32(count, found);
    }
}

static void feed_hands_over_in_order_and_keeps_room_for_a_log_s_end(void)
{
    static struct log_feed feed;
    const struct log_opening opening = {
        .log_id = 9, .start_ms = 70, .format = {.geometry = {1.0e-4f, 1.0e-4f}, .rate_hz = 200}};
    struct proto_log_entry entry;
    log_feed_init(&feed);
    log_feed_open(&feed, &opening);
    for (uint32_t i = 0; i < 2 * LOG_FEED_SIZE; i++) {
        const struct proto_log_record record = record_of(i);
        log_feed_record(&feed, &record);
    }
    log_feed_close(&feed, PROTO_LOG_END_FAULT);
    TEST_ASSERT_EQUAL_UINT32(0, log_count());
    log_feed_drain(&feed, &ring);
    TEST_ASSERT_TRUE(entry_at(0, &entry));
    TEST_ASSERT_EQUAL_UINT16(9, entry.log_id);
    TEST_ASSERT_EQUAL_UINT32(LOG_FEED_SIZE - LOG_FEED_KEPT - 1, entry.record_count);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_FAULT, entry.end);
    TEST_ASSERT_EQUAL_UINT32(entry.record_count, check_records(&entry, 0));
    for (int i = 0; i < 2 * LOG_FEED_SIZE; i++) {
        log_feed_open(&feed, &opening);
        log_feed_close(&feed, PROTO_LOG_END_FINISHED);
    }
    log_feed_drain(&feed, &ring);
    TEST_ASSERT_EQUAL_UINT32(feed.written, feed.read);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(log_comes_back_record_by_record);
    RUN_TEST(logs_follow_one_another_and_each_begins_a_block);
    RUN_TEST(open_log_is_listed_with_what_is_sealed_of_it);
    RUN_TEST(log_that_opens_while_another_is_open_ends_that_one);
    RUN_TEST(long_log_wraps_and_keeps_its_newest_blocks);
    RUN_TEST(overwritten_logs_leave_the_list_in_order);
    RUN_TEST(sealed_blocks_never_change_while_they_last);
    RUN_TEST(copy_and_digest_cross_the_pieces_of_memory);
    RUN_TEST(board_with_one_piece_of_memory_has_a_shorter_ring);
    RUN_TEST(erased_logs_are_gone_and_offsets_count_on);
    RUN_TEST(many_short_logs_are_all_listed_until_the_ring_is_full);
    RUN_TEST(list_ends_even_when_the_memory_has_gone_bad);
    RUN_TEST(random_logs_of_random_records_all_come_back);
    RUN_TEST(feed_hands_over_in_order_and_keeps_room_for_a_log_s_end);
    return UNITY_END();
}
