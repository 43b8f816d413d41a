/* The log's coding loses nothing, whatever the records. */
#include "log_coding.h"

#include <string.h>

#include "log_decoder.h"
#include "random.h"
#include "unity.h"
#include "vectors/vectors.h"

enum { RECORDS = 2000 };

static struct log_coder coder;
static struct log_decoder decoder;
static uint32_t words[RECORDS][PROTO_LOG_FIELD_COUNT];
static uint8_t coded[RECORDS * LOG_CODING_MAX_SIZE];

void setUp(void)
{
    memset(&coder, 0, sizeof coder);
}

void tearDown(void)
{
}

static size_t code_all(int count)
{
    size_t size = 0;
    for (int i = 0; i < count; i++) {
        size += log_coder_encode(&coder, words[i], coded + size);
        log_coder_accept(&coder, words[i]);
    }
    return size;
}

static void check_round_trip(int count, size_t size)
{
    uint32_t found[16];
    log_decoder_start(&decoder, coded, size);
    for (int i = 0; i < count; i++) {
        TEST_ASSERT_TRUE(log_decoder_next(&decoder, found));
        TEST_ASSERT_EQUAL_UINT32_ARRAY(words[i], found, 16);
    }
    TEST_ASSERT_FALSE(log_decoder_next(&decoder, found));
}

static void board_and_host_agree_on_the_shared_log(void)
{
    const int count = (int)(sizeof log_vector_records / sizeof log_vector_records[0]);
    memcpy(words, log_vector_records, sizeof log_vector_records);
    const size_t size = code_all(count);
    TEST_ASSERT_EQUAL(sizeof log_vector_coded, size);
    TEST_ASSERT_EQUAL_UINT8_ARRAY(log_vector_coded, coded, size);
    check_round_trip(count, size);
}

static void records_of_pure_noise_come_back(void)
{
    random_seed(7);
    for (int i = 0; i < RECORDS; i++) {
        for (int field = 0; field < 16; field++) {
            words[i][field] = random_u32();
        }
    }
    const size_t size = code_all(RECORDS);
    TEST_ASSERT_TRUE(size <= RECORDS * (size_t)LOG_CODING_MAX_SIZE);
    check_round_trip(RECORDS, size);
}

static void records_that_jump_between_extremes_come_back(void)
{
    const uint32_t extremes[] = {0,    1,    0x7FFFFFFF, 0x80000000, 0xFFFFFFFF,
                                 0x3F, 0x40, 0x1FFF,     0x2000,     0xFFFFFFC0};
    random_seed(8);
    for (int i = 0; i < RECORDS; i++) {
        for (int field = 0; field < 16; field++) {
            words[i][field] = extremes[random_below(sizeof extremes / sizeof extremes[0])];
        }
    }
    check_round_trip(RECORDS, code_all(RECORDS));
}

static void records_like_a_drive_come_back(void)
{
    random_seed(9);
    memset(words, 0, sizeof words);
    for (int i = 1; i < RECORDS; i++) {
        for (int field = 0; field < 16; field++) {
            words[i][field] = words[i - 1][field] + (random_below(3) == 0 ? random_below(9) - 4u : 0u);
        }
        words[i][0] = (uint32_t)i * 50u;
    }
    check_round_trip(RECORDS, code_all(RECORDS));
}

static void record_that_repeats_its_prediction_costs_two_bytes(void)
{
    const uint32_t still[16] = {0};
    TEST_ASSERT_EQUAL(2, log_coder_encode(&coder, still, coded));
}

static void record_that_was_not_stored_leaves_no_trace(void)
{
    const uint32_t first[16] = {50, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    uint8_t once[LOG_CODING_MAX_SIZE];
    uint8_t again[LOG_CODING_MAX_SIZE];
    const size_t size = log_coder_encode(&coder, first, once);
    TEST_ASSERT_EQUAL(size, log_coder_encode(&coder, first, again));
    TEST_ASSERT_EQUAL_UINT8_ARRAY(once, again, size);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(board_and_host_agree_on_the_shared_log);
    RUN_TEST(records_of_pure_noise_come_back);
    RUN_TEST(records_that_jump_between_extremes_come_back);
    RUN_TEST(records_like_a_drive_come_back);
    RUN_TEST(record_that_repeats_its_prediction_costs_two_bytes);
    RUN_TEST(record_that_was_not_stored_leaves_no_trace);
    return UNITY_END();
}
