/* The log's ring: sealed blocks do not change, old ones go in order, and no reader gets torn bytes. */
#include "log.h"

#include <stdlib.h>
#include <string.h>

#include "crc32.h"
#include "hal_host.h"
#include "log_decoder.h"
#include "random.h"
#include "unity.h"

enum { RING_SIZE = (int)(PROTO_LOG_BLOCK_COUNT * PROTO_LOG_BLOCK_SIZE), MOST_RECORDS = 256 };

static struct log ring;
static struct hal_host board;
static uint8_t bytes[RING_SIZE];
static struct proto_log_record decoded[MOST_RECORDS];

void setUp(void)
{
    hal_host_init(&board);
    hal_host_select(&board);
    memset(&ring, 0xA5, sizeof ring);
    log_init(&ring);
    random_seed(11);
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

static void write_log(uint16_t log_id, uint32_t records)
{
    log_open(&ring, log_id, 20, 0, 1000u * log_id);
    for (uint32_t i = 0; i < records; i++) {
        const struct proto_log_record record = record_of(i);
        log_append(&ring, &record, 1000u * log_id + record.t_ms);
    }
    log_close(&ring, PROTO_LOG_END_FINISHED);
}

/* Decodes all blocks of a log entry; returns the number of records found, each as record_of says from `first`
 * on. */
static uint32_t check_records(const struct proto_log_entry *entry, uint32_t first)
{
    uint32_t count = 0;
    for (uint32_t block = entry->first_block; block < entry->first_block + entry->block_count; block++) {
        TEST_ASSERT_TRUE(log_copy(&ring, block * PROTO_LOG_BLOCK_SIZE, bytes, PROTO_LOG_BLOCK_SIZE));
        const int found = log_decoder_block(bytes, block, entry->log_id, decoded, MOST_RECORDS);
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
    TEST_ASSERT_TRUE(log_entry(&ring, 0, &entry));
    TEST_ASSERT_EQUAL_UINT32(3000, entry.record_count);
    TEST_ASSERT_EQUAL_UINT32(3000, check_records(&entry, 0));
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_FINISHED, entry.end);
    TEST_ASSERT_EQUAL_UINT8(0, entry.truncated);
    TEST_ASSERT_EQUAL_UINT32(1000, entry.start_ms);
    TEST_ASSERT_EQUAL_UINT32(1000 + 2999 * 50, entry.end_ms);
    printf("noisy drive: %.2f bytes per record\n", entry.block_count * 512.0 / 3000.0);
}

static void logs_follow_one_another_and_each_begins_a_block(void)
{
    struct proto_log_entry entry;
    uint32_t next = 0;
    for (uint16_t id = 1; id <= 5; id++) {
        write_log(id, 100u * id);
    }
    TEST_ASSERT_EQUAL_UINT8(5, log_count(&ring));
    for (uint8_t i = 0; i < 5; i++) {
        TEST_ASSERT_TRUE(log_entry(&ring, i, &entry));
        TEST_ASSERT_EQUAL_UINT16(i + 1, entry.log_id);
        TEST_ASSERT_EQUAL_UINT32(next, entry.first_block);
        TEST_ASSERT_EQUAL_UINT32(100u * (i + 1u), check_records(&entry, 0));
        next += entry.block_count;
    }
    TEST_ASSERT_FALSE(log_entry(&ring, 5, &entry));
    TEST_ASSERT_EQUAL_UINT32(next * 512, log_end_offset(&ring));
}

static void long_log_wraps_and_keeps_its_newest_blocks(void)
{
    struct proto_log_entry entry;
    write_log(1, 20000);
    TEST_ASSERT_TRUE(log_entry(&ring, 0, &entry));
    TEST_ASSERT_EQUAL_UINT8(1, entry.truncated);
    TEST_ASSERT_EQUAL_UINT32(PROTO_LOG_BLOCK_COUNT, entry.block_count);
    TEST_ASSERT_EQUAL_UINT32(log_oldest_offset(&ring), entry.first_block * 512);
    TEST_ASSERT_EQUAL_UINT32(log_end_offset(&ring), (entry.first_block + entry.block_count) * 512);
    /* Where the kept part begins is told by its first record's time. */
    TEST_ASSERT_TRUE(log_copy(&ring, log_oldest_offset(&ring), bytes, 512));
    TEST_ASSERT_TRUE(log_decoder_block(bytes, entry.first_block, 1, decoded, MOST_RECORDS) > 0);
    const uint32_t first = decoded[0].t_ms / 50;
    TEST_ASSERT_EQUAL_UINT32(20000 - first, check_records(&entry, first));
}

static void overwritten_logs_leave_the_table_in_order(void)
{
    struct proto_log_entry entry;
    write_log(1, 500);
    write_log(2, 500);
    log_open(&ring, 3, 20, 0, 0);
    uint32_t i = 0;
    bool saw_two = false;
    while (log_entry(&ring, 0, &entry) && entry.log_id < 3) {
        const struct proto_log_record record = record_of(i++);
        log_append(&ring, &record, 0);
        TEST_ASSERT_TRUE(log_entry(&ring, 0, &entry));
        saw_two = saw_two || entry.log_id == 2;
        TEST_ASSERT_TRUE(entry.first_block * 512 >= log_oldest_offset(&ring));
        TEST_ASSERT_TRUE(entry.block_count > 0);
    }
    TEST_ASSERT_TRUE(saw_two);
    TEST_ASSERT_EQUAL_UINT8(1, log_count(&ring));
    log_close(&ring, PROTO_LOG_END_STOPPED);
    TEST_ASSERT_TRUE(log_entry(&ring, 0, &entry));
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_STOPPED, entry.end);
}

static void sealed_blocks_never_change_while_they_last(void)
{
    static uint32_t crc_of[40000];
    uint32_t known_end = 0;
    log_open(&ring, 1, 200, 0, 0);
    for (uint32_t i = 0; i < 40000; i++) {
        const struct proto_log_record record = record_of(i * 7919u);
        log_append(&ring, &record, i);
        for (; known_end < ring.end_block; known_end++) {
            TEST_ASSERT_TRUE(log_digest(&ring, known_end * 512, 512, &crc_of[known_end]));
        }
        if (i % 97 == 0) {
            for (uint32_t block = ring.oldest_block; block < known_end; block++) {
                uint32_t crc;
                TEST_ASSERT_TRUE(log_digest(&ring, block * 512, 512, &crc));
                TEST_ASSERT_EQUAL_HEX32(crc_of[block], crc);
            }
        }
    }
    TEST_ASSERT_TRUE(known_end > 2 * PROTO_LOG_BLOCK_COUNT);
}

static void reader_is_told_when_the_ring_has_passed_what_it_read(void)
{
    uint32_t crc;
    write_log(1, 20000);
    const uint32_t oldest = log_oldest_offset(&ring);
    TEST_ASSERT_TRUE(log_copy(&ring, oldest, bytes, 512));
    TEST_ASSERT_FALSE(log_copy(&ring, oldest - 1, bytes, 512));
    TEST_ASSERT_FALSE(log_copy(&ring, oldest - 512, bytes, 512));
    TEST_ASSERT_FALSE(log_digest(&ring, oldest - 512, 1024, &crc));
    /* The block opens that takes the oldest one's place: from then on it counts as gone, though it looks
     * whole. */
    log_open(&ring, 2, 20, 0, 0);
    const struct proto_log_record record = record_of(0);
    log_append(&ring, &record, 0);
    TEST_ASSERT_FALSE(log_copy(&ring, oldest, bytes, 512));
    TEST_ASSERT_TRUE(log_copy(&ring, oldest + 512, bytes, 512));
}

static void copy_and_digest_cross_the_ring_s_end(void)
{
    static uint8_t one_by_one[RING_SIZE];
    uint32_t crc;
    write_log(1, 20000);
    const uint32_t oldest = log_oldest_offset(&ring);
    TEST_ASSERT_NOT_EQUAL(0, oldest % RING_SIZE);
    TEST_ASSERT_TRUE(log_copy(&ring, oldest, bytes, RING_SIZE));
    for (uint32_t i = 0; i < RING_SIZE; i++) {
        TEST_ASSERT_TRUE(log_copy(&ring, oldest + i, &one_by_one[i], 1));
    }
    TEST_ASSERT_EQUAL_INT(0, memcmp(bytes, one_by_one, RING_SIZE));
    TEST_ASSERT_TRUE(log_digest(&ring, oldest, RING_SIZE, &crc));
    TEST_ASSERT_EQUAL_HEX32(crc32_update(0, bytes, RING_SIZE), crc);
}

static void erased_logs_are_gone_and_offsets_count_on(void)
{
    struct proto_log_entry entry;
    write_log(1, 500);
    const uint32_t end = log_end_offset(&ring);
    log_open(&ring, 2, 20, 0, 0);
    TEST_ASSERT_FALSE(log_erase(&ring));
    log_close(&ring, PROTO_LOG_END_STOPPED);
    TEST_ASSERT_TRUE(log_erase(&ring));
    TEST_ASSERT_EQUAL_UINT8(0, log_count(&ring));
    TEST_ASSERT_EQUAL_UINT32(log_end_offset(&ring), log_oldest_offset(&ring));
    TEST_ASSERT_FALSE(log_copy(&ring, end - 512, bytes, 512));
    write_log(3, 100);
    TEST_ASSERT_TRUE(log_entry(&ring, 0, &entry));
    TEST_ASSERT_EQUAL_UINT16(3, entry.log_id);
    TEST_ASSERT_TRUE(entry.first_block * 512 >= end);
    TEST_ASSERT_EQUAL_UINT32(100, check_records(&entry, 0));
}

static void more_short_logs_than_the_table_holds_push_out_the_oldest(void)
{
    struct proto_log_entry entry;
    for (uint16_t id = 1; id <= LOG_TABLE_SIZE + 10; id++) {
        write_log(id, 3);
    }
    TEST_ASSERT_EQUAL_UINT8(LOG_TABLE_SIZE, log_count(&ring));
    TEST_ASSERT_TRUE(log_entry(&ring, 0, &entry));
    TEST_ASSERT_EQUAL_UINT16(11, entry.log_id);
    TEST_ASSERT_EQUAL_UINT32(entry.first_block * 512, log_oldest_offset(&ring));
    TEST_ASSERT_EQUAL_UINT32(3, check_records(&entry, 0));
}

static void random_logs_of_random_records_all_come_back(void)
{
    static uint32_t kept[20000][16];
    for (uint16_t id = 1; id <= 30; id++) {
        const uint32_t count = 1 + random_below(400);
        log_open(&ring, id, 20, 0, 0);
        for (uint32_t i = 0; i < count; i++) {
            struct proto_log_record record;
            uint32_t words[16];
            for (int field = 0; field < 16; field++) {
                words[field] = random_u32() >> random_below(32);
            }
            proto_log_record_from_words(&record, words);
            proto_log_record_to_words(&record, kept[i]);
            log_append(&ring, &record, i);
        }
        log_close(&ring, PROTO_LOG_END_FINISHED);
        struct proto_log_entry entry;
        TEST_ASSERT_TRUE(log_entry(&ring, (uint8_t)(log_count(&ring) - 1), &entry));
        uint32_t found = 0;
        for (uint32_t block = entry.first_block; block < entry.first_block + entry.block_count; block++) {
            TEST_ASSERT_TRUE(log_copy(&ring, block * 512, bytes, 512));
            const int in_block = log_decoder_block(bytes, block, id, decoded, MOST_RECORDS);
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

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(log_comes_back_record_by_record);
    RUN_TEST(logs_follow_one_another_and_each_begins_a_block);
    RUN_TEST(long_log_wraps_and_keeps_its_newest_blocks);
    RUN_TEST(overwritten_logs_leave_the_table_in_order);
    RUN_TEST(sealed_blocks_never_change_while_they_last);
    RUN_TEST(reader_is_told_when_the_ring_has_passed_what_it_read);
    RUN_TEST(copy_and_digest_cross_the_ring_s_end);
    RUN_TEST(erased_logs_are_gone_and_offsets_count_on);
    RUN_TEST(more_short_logs_than_the_table_holds_push_out_the_oldest);
    RUN_TEST(random_logs_of_random_records_all_come_back);
    return UNITY_END();
}
