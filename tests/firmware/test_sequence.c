/* Uploaded sequences run on the board alone, to the millisecond, and their log records it. */
#include "fixture.h"

#include <stdio.h>

#include "log_decoder.h"
#include "random.h"

enum { MAX_ROWS = 20000 };

static struct proto_log_record rows[MAX_ROWS];
static int row_count;

/* The paper's test XI. */
static const struct proto_segment test_xi[] = {
    {PROTO_SEGMENT_KIND_EFFORT, 1000, 0.0f, 0.0f},   {PROTO_SEGMENT_KIND_EFFORT, 2000, 0.35f, 0.35f},
    {PROTO_SEGMENT_KIND_EFFORT, 2000, 0.50f, 0.50f}, {PROTO_SEGMENT_KIND_EFFORT, 2000, 0.45f, 0.45f},
    {PROTO_SEGMENT_KIND_EFFORT, 2000, 0.0f, 0.0f},
};
enum { TEST_XI_SEGMENTS = sizeof test_xi / sizeof test_xi[0], TEST_XI_MS = 9000 };

void setUp(void)
{
    fixture_power_up();
    row_count = 0;
}

void tearDown(void)
{
}

static uint8_t sequence_state(void)
{
    struct proto_seq_state_reply state;
    fixture_ask(PROTO_ID_SEQ_STATE, NULL, 0);
    TEST_ASSERT_TRUE(
        proto_seq_state_reply_decode(&state, fixture.reply.payload, fixture.reply.payload_length));
    return state.sequence_state;
}

/* Downloads the newest log into rows[]. */
static struct proto_log_entry fetch(void)
{
    static uint8_t bytes[HAL_LOG_MEMORIES * HAL_HOST_LOG_SIZE];
    const struct proto_log_entry entry = fixture_newest_log();
    const uint32_t size = entry.cell_count * PROTO_LOG_CELL_SIZE;
    fixture_read_log(entry.first_cell * PROTO_LOG_CELL_SIZE, bytes, size);
    row_count = 0;
    for (uint32_t at = 0; at < size; at += log_decoder_span(bytes + at)) {
        const int found = log_decoder_block(bytes + at, entry.first_cell + at / PROTO_LOG_CELL_SIZE,
                                            entry.log_id, rows + row_count, MAX_ROWS - row_count);
        TEST_ASSERT_TRUE(found > 0);
        row_count += found;
    }
    return entry;
}

static void run_test_xi(uint16_t log_rate_hz)
{
    fixture_start(fixture_upload(test_xi, TEST_XI_SEGMENTS, log_rate_hz));
    fixture_run(TEST_XI_MS + 1);
}

static void segments_change_at_their_exact_millisecond(void)
{
    const struct proto_segment segments[] = {
        {PROTO_SEGMENT_KIND_EFFORT, 7, 0.10f, -0.10f},
        {PROTO_SEGMENT_KIND_EFFORT, 1, 0.20f, -0.20f},
        {PROTO_SEGMENT_KIND_EFFORT, 250, 0.30f, -0.30f},
        {PROTO_SEGMENT_KIND_EFFORT, 3, 0.0f, 0.05f},
    };
    const int16_t left[] = {1000, 2000, 3000, 0};
    const int16_t right[] = {-1000, -2000, -3000, 500};
    fixture.motors_turn = false;
    fixture_set_parameter(PROTO_PARAMETER_EFFORT_MODE_SLEW_PER_S, 500.0f); /* each step within a tick */
    fixture_start(fixture_upload(segments, 4, 0));
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    for (size_t i = 0; i < 4; i++) {
        for (uint32_t ms = 0; ms < segments[i].duration_ms; ms++) {
            fixture_run(1);
            TEST_ASSERT_EQUAL_INT16(left[i], fixture.board.effort_e4[0]);
            TEST_ASSERT_EQUAL_INT16(right[i], fixture.board.effort_e4[1]);
        }
    }
    fixture_run(1);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[1]);
    TEST_ASSERT_EQUAL_UINT8(PROTO_SEQUENCE_STATE_DONE, sequence_state());
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_IDLE, fixture_status().state);
}

static void longest_sequence_keeps_time_over_all_its_segments(void)
{
    static struct proto_segment segments[PROTO_MAX_SEGMENTS];
    uint32_t total = 0;
    random_seed(3);
    for (uint32_t i = 0; i < PROTO_MAX_SEGMENTS; i++) {
        const uint32_t duration = 1 + random_below(30);
        segments[i] =
            (struct proto_segment){PROTO_SEGMENT_KIND_EFFORT, duration, (float)(i % 2 + 1) * 0.1f, 0.0f};
        total += duration;
    }
    fixture.motors_turn = false;
    fixture_start(fixture_upload(segments, PROTO_MAX_SEGMENTS, 0));
    for (uint32_t i = 0; i < PROTO_MAX_SEGMENTS; i++) {
        for (uint32_t ms = 0; ms < segments[i].duration_ms; ms++) {
            fixture_run(1);
            TEST_ASSERT_EQUAL_INT16(i % 2 == 0 ? 1000 : 2000, fixture.board.effort_e4[0]);
        }
    }
    fixture_run(1);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    (void)fetch();
    TEST_ASSERT_EQUAL_UINT32(total, rows[row_count - 1].t_ms);
}

static void sequence_goes_on_while_the_host_is_silent(void)
{
    fixture_start(fixture_upload(test_xi, TEST_XI_SEGMENTS, 0));
    fixture_run(4000);
    TEST_ASSERT_EQUAL_INT16(5000, fixture.board.effort_e4[0]);
    const struct proto_status_reply status = fixture_status();
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_SEQUENCE, status.state);
    TEST_ASSERT_EQUAL_HEX32(0, status.faults_latched);
}

static void log_has_a_row_every_50_ms_from_zero_to_the_end(void)
{
    run_test_xi(0);
    const struct proto_log_entry entry = fetch();
    TEST_ASSERT_EQUAL_UINT16(20, entry.rate_hz);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_FINISHED, entry.end);
    TEST_ASSERT_EQUAL_INT(181, row_count);
    TEST_ASSERT_EQUAL_UINT32(181, entry.record_count);
    for (int i = 0; i < row_count; i++) {
        TEST_ASSERT_EQUAL_UINT32((uint32_t)i * 50, rows[i].t_ms);
    }
    TEST_ASSERT_EQUAL_INT32(0, rows[0].counts_left);
    TEST_ASSERT_EQUAL_INT16(0, rows[0].effort_left);
    TEST_ASSERT_EQUAL_INT16(0, rows[0].speed_left);
    TEST_ASSERT_EQUAL_UINT32(9000, entry.end_ms - entry.start_ms);
}

static void row_at_a_step_tells_of_the_time_before_it(void)
{
    run_test_xi(0);
    (void)fetch();
    TEST_ASSERT_EQUAL_INT16(0, rows[20].effort_left); /* t = 1.000 s */
    TEST_ASSERT_EQUAL_INT16(0, rows[20].cmd_left);
    TEST_ASSERT_EQUAL_UINT16(0, rows[20].segment);
    TEST_ASSERT_EQUAL_INT16(3410, rows[21].effort_left); /* 0.1, 0.2 and 0.3 on the way to 0.35 */
    TEST_ASSERT_EQUAL_INT16(3500, rows[21].cmd_left);
    TEST_ASSERT_EQUAL_UINT16(1, rows[21].segment);
    TEST_ASSERT_EQUAL_INT16(3500, rows[60].effort_left); /* t = 3.000 s */
    TEST_ASSERT_EQUAL_INT16(4990, rows[61].effort_left);
    TEST_ASSERT_EQUAL_INT16(5000, rows[62].effort_left);
    TEST_ASSERT_EQUAL_UINT8(PROTO_MODE_EFFORT, rows[61].mode);
    TEST_ASSERT_EQUAL_INT16(0, rows[180].effort_left);
    TEST_ASSERT_EQUAL_UINT16(4, rows[180].segment);
}

static void row_across_a_step_holds_the_mean_of_both_efforts(void)
{
    const struct proto_segment segments[] = {
        {PROTO_SEGMENT_KIND_EFFORT, 110, 0.10f, 0.0f},
        {PROTO_SEGMENT_KIND_EFFORT, 90, 0.20f, -0.30f},
    };
    fixture_start(fixture_upload(segments, 2, 0));
    fixture_run(201);
    (void)fetch();
    TEST_ASSERT_EQUAL_INT(5, row_count);
    TEST_ASSERT_EQUAL_INT16(1800, rows[3].effort_left);   /* 10 ms of 0.1, 40 ms of 0.2 */
    TEST_ASSERT_EQUAL_INT16(-2340, rows[3].effort_right); /* 10 ms of 0, 0.1 and 0.2, 38 ms of 0.3 */
    TEST_ASSERT_EQUAL_INT16(2000, rows[4].effort_left);
}

static void speeds_are_the_counts_over_the_interval(void)
{
    run_test_xi(0);
    (void)fetch();
    for (int i = 1; i < row_count; i++) {
        const double mmps =
            (rows[i].counts_left - rows[i - 1].counts_left) * fixture_metres_per_count() * 1000.0 / 0.05;
        TEST_ASSERT_DOUBLE_WITHIN(0.51, mmps, rows[i].speed_left);
    }
    TEST_ASSERT_INT_WITHIN(10, 495, rows[60].speed_left); /* 1.5 * (0.35 - 0.02) m/s */
}

static void last_row_is_there_when_the_end_lies_between_two_intervals(void)
{
    const struct proto_segment segment = {PROTO_SEGMENT_KIND_EFFORT, 123, 0.2f, 0.2f};
    fixture_start(fixture_upload(&segment, 1, 0));
    fixture_run(124);
    (void)fetch();
    TEST_ASSERT_EQUAL_INT(4, row_count);
    TEST_ASSERT_EQUAL_UINT32(123, rows[3].t_ms);
    TEST_ASSERT_EQUAL_INT16(2000, rows[3].effort_left);
}

static void log_rate_follows_the_request_from_1_to_200_hz(void)
{
    const uint16_t rates[] = {1, 3, 7, 30, 100, 150, 200};
    for (size_t i = 0; i < sizeof rates / sizeof rates[0]; i++) {
        fixture_power_up();
        run_test_xi(rates[i]);
        TEST_ASSERT_EQUAL_UINT16(rates[i], fetch().rate_hz);
        TEST_ASSERT_EQUAL_INT(9 * rates[i] + 1, row_count);
        for (int row = 0; row < row_count; row++) {
            TEST_ASSERT_EQUAL_UINT32((uint32_t)row * 1000u / rates[i], rows[row].t_ms);
        }
    }
}

static void log_rate_follows_the_parameter_when_the_request_leaves_it_open(void)
{
    fixture_set_parameter(PROTO_PARAMETER_LOG_RATE_HZ, 50.0f);
    run_test_xi(0);
    TEST_ASSERT_EQUAL_UINT16(50, fetch().rate_hz);
    TEST_ASSERT_EQUAL_INT(451, row_count);
}

static void odometry_starts_from_zero_with_every_sequence(void)
{
    run_test_xi(0);
    (void)fetch();
    const int32_t first_end = rows[row_count - 1].x_mm;
    TEST_ASSERT_TRUE(first_end > 2500);
    fixture_run(1000);
    run_test_xi(0);
    (void)fetch();
    TEST_ASSERT_EQUAL_INT32(0, rows[0].x_mm);
    TEST_ASSERT_EQUAL_INT32(0, rows[0].counts_left);
    TEST_ASSERT_INT_WITHIN(1, first_end, rows[row_count - 1].x_mm);
}

static void same_sequence_twice_gives_two_logs_with_the_same_rows(void)
{
    static struct proto_log_record before[200];
    run_test_xi(0);
    const uint16_t first_id = fetch().log_id;
    memcpy(before, rows, 181 * sizeof rows[0]);
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        /* A whole number of counts, so that the same travel falls on the same edges. */
        fixture.motor[wheel].travel_m =
            (floor(fixture.motor[wheel].travel_m / fixture_metres_per_count()) + 1e-3) *
            fixture_metres_per_count();
    }
    fixture_run(1000);
    run_test_xi(0);
    TEST_ASSERT_EQUAL_UINT16(first_id + 1, fetch().log_id);
    TEST_ASSERT_EQUAL_INT(181, row_count);
    for (int i = 0; i < row_count; i++) {
        TEST_ASSERT_INT_WITHIN(1, before[i].counts_left, rows[i].counts_left);
        TEST_ASSERT_EQUAL_INT16(before[i].effort_left, rows[i].effort_left);
    }
}

static void twist_turns_into_wheel_speeds(void)
{
    const struct proto_segment segment = {PROTO_SEGMENT_KIND_TWIST, 2000, 0.4f, 1.0f};
    fixture_start(fixture_upload(&segment, 1, 0));
    fixture_run(2001);
    (void)fetch();
    TEST_ASSERT_EQUAL_UINT8(PROTO_MODE_VELOCITY, rows[30].mode);
    TEST_ASSERT_INT_WITHIN(1, 400 - 142, rows[30].cmd_left); /* v - omega W / 2 */
    TEST_ASSERT_INT_WITHIN(1, 400 + 142, rows[30].cmd_right);
    TEST_ASSERT_INT_WITHIN(12, 258, rows[30].speed_left);
    TEST_ASSERT_INT_WITHIN(12, 542, rows[30].speed_right);
    /* One radian a second, from the acceleration on. */
    TEST_ASSERT_INT_WITHIN(200, 10000, rows[40].theta_e4 - rows[20].theta_e4);
}

static void modes_may_change_from_segment_to_segment(void)
{
    const struct proto_segment segments[] = {
        {PROTO_SEGMENT_KIND_EFFORT, 1000, 0.30f, 0.30f},
        {PROTO_SEGMENT_KIND_VELOCITY, 1000, 0.30f, 0.30f},
        {PROTO_SEGMENT_KIND_EFFORT, 1000, 0.10f, 0.10f},
        {PROTO_SEGMENT_KIND_VELOCITY, 1000, 0.0f, 0.0f},
    };
    fixture_start(fixture_upload(segments, 4, 0));
    fixture_run(4001);
    (void)fetch();
    TEST_ASSERT_EQUAL_UINT8(PROTO_MODE_EFFORT, rows[10].mode);
    TEST_ASSERT_EQUAL_UINT8(PROTO_MODE_VELOCITY, rows[30].mode);
    TEST_ASSERT_INT_WITHIN(12, 300, rows[40].speed_left);
    TEST_ASSERT_EQUAL_INT16(1000, rows[50].effort_left);
    TEST_ASSERT_EQUAL_INT16(0, rows[80].effort_left);
}

static void abort_brakes_at_once_and_closes_the_log_with_a_last_row(void)
{
    fixture_start(fixture_upload(test_xi, TEST_XI_SEGMENTS, 0));
    fixture_run(2345);
    fixture_ask(PROTO_ID_SEQ_ABORT, NULL, 0);
    fixture_expect_accepted();
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]); /* before any tick */
    TEST_ASSERT_EQUAL_UINT8(PROTO_SEQUENCE_STATE_ABORTED, sequence_state());
    fixture_run(1);
    const struct proto_log_entry entry = fetch();
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_STOPPED, entry.end);
    TEST_ASSERT_EQUAL_UINT32(2345, rows[row_count - 1].t_ms);
    TEST_ASSERT_EQUAL_UINT8(0, fixture_status().log_open);
    fixture_run(3000);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
}

static void stop_ends_a_sequence_like_an_abort(void)
{
    fixture_start(fixture_upload(test_xi, TEST_XI_SEGMENTS, 0));
    fixture_run(1500);
    fixture_stop();
    fixture_expect_accepted();
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    fixture_run(1);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_STOPPED, fetch().end);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_IDLE, fixture_status().state);
}

static void stop_before_the_first_tick_leaves_a_log_of_one_row(void)
{
    const uint16_t id = fixture_start(fixture_upload(test_xi, TEST_XI_SEGMENTS, 0));
    fixture_stop();
    fixture_run(1);
    const struct proto_log_entry entry = fetch();
    TEST_ASSERT_EQUAL_UINT16(id, entry.log_id);
    TEST_ASSERT_EQUAL_INT(1, row_count);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_STOPPED, entry.end);
    fixture_run(2000);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
}

static void stop_and_start_within_one_millisecond_close_one_log_and_open_the_next(void)
{
    const uint32_t crc = fixture_upload(test_xi, TEST_XI_SEGMENTS, 0);
    const uint16_t first = fixture_start(crc);
    fixture_run(500);
    fixture_stop();
    const uint16_t second = fixture_start(crc);
    fixture_run(TEST_XI_MS + 1);
    TEST_ASSERT_EQUAL_UINT16(first + 1, second);
    const struct proto_log_entry entry = fetch();
    TEST_ASSERT_EQUAL_UINT16(second, entry.log_id);
    TEST_ASSERT_EQUAL_INT(181, row_count);
    TEST_ASSERT_EQUAL_UINT16(2, fixture_list_logs(0).total);
}

static void finished_sequence_can_be_started_again(void)
{
    const uint32_t crc = fixture_upload(test_xi, TEST_XI_SEGMENTS, 0);
    fixture_start(crc);
    fixture_run(TEST_XI_MS + 200);
    fixture_start(crc);
    fixture_run(1500);
    TEST_ASSERT_EQUAL_INT16(3500, fixture.board.effort_e4[0]);
}

static void half_an_hour_of_test_xi_at_20_hz_fits_into_the_ring(void)
{
    /* Again and again with its rests, a log for each run. */
    enum { RUNS = 200 };
    const uint32_t crc = fixture_upload(test_xi, TEST_XI_SEGMENTS, 20);
    uint32_t records = 0;
    uint32_t cells = 0;
    for (int run = 0; run < RUNS; run++) {
        fixture_start(crc);
        fixture_run(TEST_XI_MS + 200);
    }
    TEST_ASSERT_EQUAL_UINT16(RUNS, fixture_list_logs(0).total);
    for (uint16_t i = 0; i < RUNS; i++) {
        struct proto_log_entry entry;
        const struct proto_log_list_reply list = fixture_list_logs(i);
        TEST_ASSERT_TRUE(proto_log_entry_decode(&entry, list.entries, PROTO_LOG_ENTRY_SIZE));
        TEST_ASSERT_EQUAL_UINT8(0, entry.truncated);
        TEST_ASSERT_EQUAL_UINT32(181, entry.record_count);
        records += entry.record_count;
        cells += entry.cell_count;
    }
    printf("effort mode, 20 Hz: %.2f bytes per sample, headers and padding included\n",
           cells * (double)PROTO_LOG_CELL_SIZE / records);
    TEST_ASSERT_TRUE(records >= 30u * 60u * 20u);
}

static void velocity_mode_takes_less_than_three_bytes_a_sample(void)
{
    static struct proto_segment segments[PROTO_MAX_SEGMENTS];
    const float speeds[] = {0.0f, 0.35f, 0.50f, 0.45f};
    for (uint32_t i = 0; i < 120; i++) {
        segments[i] = (struct proto_segment){PROTO_SEGMENT_KIND_VELOCITY, 2000, speeds[i % 4], speeds[i % 4]};
    }
    fixture_start(fixture_upload(segments, 120, 20));
    fixture_run(240001);
    const struct proto_log_entry entry = fetch();
    const double bytes = entry.cell_count * (double)PROTO_LOG_CELL_SIZE / entry.record_count;
    printf("velocity mode, 20 Hz: %.2f bytes per sample\n", bytes);
    TEST_ASSERT_EQUAL_UINT8(0, entry.truncated);
    TEST_ASSERT_EQUAL_INT(4801, row_count);
    TEST_ASSERT_TRUE(bytes < 3.0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(segments_change_at_their_exact_millisecond);
    RUN_TEST(longest_sequence_keeps_time_over_all_its_segments);
    RUN_TEST(sequence_goes_on_while_the_host_is_silent);
    RUN_TEST(log_has_a_row_every_50_ms_from_zero_to_the_end);
    RUN_TEST(row_at_a_step_tells_of_the_time_before_it);
    RUN_TEST(row_across_a_step_holds_the_mean_of_both_efforts);
    RUN_TEST(speeds_are_the_counts_over_the_interval);
    RUN_TEST(last_row_is_there_when_the_end_lies_between_two_intervals);
    RUN_TEST(log_rate_follows_the_request_from_1_to_200_hz);
    RUN_TEST(log_rate_follows_the_parameter_when_the_request_leaves_it_open);
    RUN_TEST(odometry_starts_from_zero_with_every_sequence);
    RUN_TEST(same_sequence_twice_gives_two_logs_with_the_same_rows);
    RUN_TEST(twist_turns_into_wheel_speeds);
    RUN_TEST(modes_may_change_from_segment_to_segment);
    RUN_TEST(abort_brakes_at_once_and_closes_the_log_with_a_last_row);
    RUN_TEST(stop_ends_a_sequence_like_an_abort);
    RUN_TEST(stop_before_the_first_tick_leaves_a_log_of_one_row);
    RUN_TEST(stop_and_start_within_one_millisecond_close_one_log_and_open_the_next);
    RUN_TEST(finished_sequence_can_be_started_again);
    RUN_TEST(half_an_hour_of_test_xi_at_20_hz_fits_into_the_ring);
    RUN_TEST(velocity_mode_takes_less_than_three_bytes_a_sample);
    return UNITY_END();
}
