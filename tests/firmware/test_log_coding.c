/* The log's coding is lossless for all records. */
#include "log_coding.h"

#include <math.h>
#include <string.h>

#include "log_decoder.h"
#include "odometry.h"
#include "random.h"
#include "unity.h"
#include "vectors/vectors.h"

enum { RECORDS = 2000 };

static const struct log_format paper = {.geometry = {0.00016624259f, 9.3492346e-05f}, .rate_hz = 20};
static struct log_coder coder;
static struct log_decoder decoder;
static uint32_t words[RECORDS][PROTO_LOG_FIELD_COUNT];
static uint8_t coded[RECORDS * LOG_CODING_MAX];

void setUp(void)
{
}

void tearDown(void)
{
}

static size_t code_all(const struct log_format *format, uint32_t first, int count)
{
    log_coder_start(&coder, format, first, coded, sizeof coded);
    for (int i = 0; i < count; i++) {
        struct proto_log_record record;
        proto_log_record_from_words(&record, words[i]);
        proto_log_record_to_words(&record, words[i]); /* what the fields' types hold */
        const size_t before = log_coder_size(&coder);
        log_coder_add(&coder, &record);
        TEST_ASSERT_TRUE(log_coder_size(&coder) - before <= (size_t)LOG_CODING_MAX);
    }
    return log_coder_finish(&coder);
}

static void check_round_trip(const struct log_format *format, uint32_t first, int count)
{
    const size_t size = code_all(format, first, count);
    uint32_t found[16];
    log_decoder_start(&decoder, format->geometry.metres_per_count, format->geometry.turns_per_count,
                      format->rate_hz, first, coded, size);
    for (int i = 0; i < count; i++) {
        log_decoder_next(&decoder, found);
        TEST_ASSERT_EQUAL_UINT32_ARRAY(words[i], found, 16);
    }
}

static void board_and_host_agree_on_the_shared_block(void)
{
    const int count = (int)(sizeof log_vector_records / sizeof log_vector_records[0]);
    const struct log_format format = {
        .geometry = {LOG_VECTOR_METRES_PER_COUNT, LOG_VECTOR_TURNS_PER_COUNT},
        .rate_hz = LOG_VECTOR_RATE_HZ,
    };
    struct proto_log_header header;
    memcpy(words, log_vector_records, sizeof log_vector_records);
    const size_t size = code_all(&format, LOG_VECTOR_FIRST_RECORD, count);
    TEST_ASSERT_TRUE(proto_log_header_decode(&header, log_vector_block, PROTO_LOG_HEADER_SIZE));
    TEST_ASSERT_EQUAL(header.used - PROTO_LOG_HEADER_SIZE, size);
    TEST_ASSERT_EQUAL_UINT8_ARRAY(log_vector_block + PROTO_LOG_HEADER_SIZE, coded, size);
    check_round_trip(&format, LOG_VECTOR_FIRST_RECORD, count);
}

static void records_of_pure_noise_come_back(void)
{
    random_seed(7);
    for (int i = 0; i < RECORDS; i++) {
        for (int field = 0; field < 16; field++) {
            words[i][field] = random_u32();
        }
    }
    check_round_trip(&paper, 0, RECORDS);
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
    check_round_trip(&paper, 0, RECORDS);
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
    check_round_trip(&paper, 0, RECORDS);
}

static void every_geometry_and_rate_that_parameters_allow_comes_back(void)
{
    const float metres[] = {3.14e-8f, 1.0e-5f, 0.00016624259f, 0.0062f, 1.5707964f};
    const float turns[] = {1.0e-9f, 9.3492346e-05f, 0.01f, 12.5f};
    random_seed(10);
    for (uint32_t i = 0; i < 100; i++) {
        const struct log_format format = {
            .geometry = {metres[i % 5], turns[i % 4]},
            .rate_hz = (uint16_t)(1 + random_below(200)),
        };
        for (int k = 0; k < 100; k++) {
            for (int field = 0; field < 16; field++) {
                words[k][field] = k > 0 && random_below(2) == 0 ? words[k - 1][field] + random_below(5)
                                                                : random_u32() >> random_below(32);
            }
        }
        check_round_trip(&format, random_u32(), 100);
    }
}

/* Speeds and pose by the log's own arithmetic from counts, as the recorder logs them. */
static void drive_whose_pose_follows_from_its_counts(void)
{
    struct log_replay replay;
    struct log_axis axes[2] = {{0}, {0}};
    int32_t counts[2] = {0, 0};
    log_replay_start(&replay, &paper.geometry);
    memset(words, 0, sizeof words);
    for (uint32_t i = 1; i < RECORDS; i++) {
        const int32_t moved[2] = {150 + (int32_t)(i % 3), 152};
        const int64_t before = log_replay_heading(&replay, counts[1] - counts[0]);
        int64_t way[2];
        counts[0] += moved[0];
        counts[1] += moved[1];
        const int64_t after = log_replay_heading(&replay, counts[1] - counts[0]);
        log_replay_way(&replay, moved[0] + moved[1], (uint32_t)(((before + after) / 2) >> 8), way);
        const int32_t row[16] = {(int32_t)i * 50,
                                 1,
                                 0,
                                 0,
                                 3500,
                                 3500,
                                 3500,
                                 3500,
                                 counts[0],
                                 counts[1],
                                 log_replay_speed(&replay, moved[0], 50),
                                 log_replay_speed(&replay, moved[1], 50),
                                 0,
                                 0,
                                 log_replay_heading_e4(after),
                                 1200};
        memcpy(words[i], row, sizeof row);
        for (int axis = 0; axis < 2; axis++) {
            log_axis_step(&axes[axis], way[axis]);
            words[i][12 + axis] = (uint32_t)log_axis_mm(&axes[axis]);
        }
    }
}

static void speeds_and_pose_cost_next_to_nothing(void)
{
    drive_whose_pose_follows_from_its_counts();
    const size_t size = code_all(&paper, 0, RECORDS);
    printf("a drive without noise: %.3f bytes a record\n", (double)size / RECORDS);
    TEST_ASSERT_TRUE(size < RECORDS / 2);
}

static void rest_costs_less_than_two_bits_a_record(void)
{
    memset(words, 0, sizeof words);
    for (uint32_t i = 0; i < RECORDS; i++) {
        words[i][0] = i * 50;
        words[i][15] = 1200;
    }
    const size_t size = code_all(&paper, 0, RECORDS);
    printf("a rest: %.2f bits a record\n", 8.0 * (double)size / RECORDS);
    TEST_ASSERT_TRUE(8 * size < 2 * RECORDS);
    check_round_trip(&paper, 0, RECORDS);
}

static void heading_of_the_replay_is_odometrys(void)
{
    const struct odometry_geometry geometry = odometry_geometry(0.0635f, 0.283f, 2400.0f);
    const struct log_geometry same = {2.0f * geometry.half_metres_per_count, geometry.turns_per_count};
    struct odometry odometry = {0};
    struct log_replay replay;
    int32_t difference = 0;
    log_replay_start(&replay, &same);
    random_seed(12);
    for (int i = 0; i < 20000; i++) {
        const int32_t left = (int32_t)random_below(21) - 10;
        const int32_t right = (int32_t)random_below(21) - 9;
        odometry_step(&odometry, &geometry, left, right);
        difference += right - left;
        TEST_ASSERT_EQUAL_INT32(odometry_theta_e4(&odometry),
                                log_replay_heading_e4(log_replay_heading(&replay, difference)));
    }
}

static void speed_is_counts_over_time_half_away_from_zero(void)
{
    struct log_replay replay;
    log_replay_start(&replay, &paper.geometry);
    const double mm = 1000.0 * (double)paper.geometry.metres_per_count;
    for (int32_t counts = -6000; counts <= 6000; counts += 7) {
        const double exact = counts * mm / 0.05;
        TEST_ASSERT_TRUE(fabs(log_replay_speed(&replay, counts, 50) - exact) <= 0.5 + 1e-6 * fabs(exact));
    }
    TEST_ASSERT_EQUAL_INT16(0, log_replay_speed(&replay, 100, 0));
    TEST_ASSERT_EQUAL_INT16(32767, log_replay_speed(&replay, INT32_MAX, 5));
    TEST_ASSERT_EQUAL_INT16(-32768, log_replay_speed(&replay, INT32_MIN, 5));
}

static void coder_never_writes_beyond_its_room(void)
{
    uint8_t small[9];
    struct proto_log_record record = {0};
    memset(small, 0xA5, sizeof small);
    log_coder_start(&coder, &paper, 0, small, sizeof small - 1);
    random_seed(13);
    for (int i = 0; i < 100; i++) {
        record.faults = random_u32();
        log_coder_add(&coder, &record);
    }
    TEST_ASSERT_TRUE(log_coder_finish(&coder) <= sizeof small - 1);
    TEST_ASSERT_EQUAL_HEX8(0xA5, small[8]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(board_and_host_agree_on_the_shared_block);
    RUN_TEST(records_of_pure_noise_come_back);
    RUN_TEST(records_that_jump_between_extremes_come_back);
    RUN_TEST(records_like_a_drive_come_back);
    RUN_TEST(every_geometry_and_rate_that_parameters_allow_comes_back);
    RUN_TEST(speeds_and_pose_cost_next_to_nothing);
    RUN_TEST(rest_costs_less_than_two_bits_a_record);
    RUN_TEST(heading_of_the_replay_is_odometrys);
    RUN_TEST(speed_is_counts_over_time_half_away_from_zero);
    RUN_TEST(coder_never_writes_beyond_its_room);
    return UNITY_END();
}
