/* What would move the robot is checked as a whole before it does: live commands, uploads, starts. */
#include "bench.h"

void setUp(void)
{
    bench_power_up();
}

void tearDown(void)
{
}

static const struct proto_segment short_drive = {PROTO_SEGMENT_KIND_EFFORT, 100, 0.3f, 0.3f};

static void send_one_segment(uint8_t kind, uint32_t duration_ms, float a, float b)
{
    const struct proto_segment segment = {.kind = kind, .duration_ms = duration_ms, .a = a, .b = b};
    bench_send_segments(0, &segment, 1);
}

/* Whatever is refused, the bridges get what they got before. */
static void check_bad_live_commands(int16_t left_e4, int16_t right_e4)
{
    static const struct {
        float left;
        float right;
        uint8_t reason;
        uint32_t detail;
    } bad[] = {
        {NAN, 0.1f, PROTO_REFUSAL_REASON_NOT_FINITE, 0},
        {0.1f, NAN, PROTO_REFUSAL_REASON_NOT_FINITE, 1},
        {INFINITY, 0.1f, PROTO_REFUSAL_REASON_NOT_FINITE, 0},
        {0.1f, -INFINITY, PROTO_REFUSAL_REASON_NOT_FINITE, 1},
        {1.0001f, 0.0f, PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0},
        {0.0f, -1.0001f, PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1},
        {1e30f, 0.0f, PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        bench_set_effort(bad[i].left, bad[i].right);
        bench_expect_refused((enum proto_refusal_reason)bad[i].reason, bad[i].detail);
        bench_set_velocity(bad[i].left * 2.0f, bad[i].right * 2.0f);
        bench_expect_refused((enum proto_refusal_reason)bad[i].reason, bad[i].detail);
        bench_run(1);
        TEST_ASSERT_EQUAL_INT16(left_e4, bench.board.effort_e4[0]);
        TEST_ASSERT_EQUAL_INT16(right_e4, bench.board.effort_e4[1]);
    }
}

static void bad_live_commands_leave_the_wheels_as_they_were(void)
{
    check_bad_live_commands(0, 0);
    bench_set_effort(0.25f, -0.4f);
    bench_run(1);
    check_bad_live_commands(2500, -4000);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_LIVE, bench_status().state);
}

static void limits_of_live_commands_are_the_parameters(void)
{
    bench_set_parameter(PROTO_PARAMETER_EFFORT_LIMIT, 0.5f);
    bench_set_parameter(PROTO_PARAMETER_SPEED_LIMIT_MPS, 0.8f);
    bench_set_effort(0.51f, 0.0f);
    bench_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    bench_set_velocity(0.0f, -0.81f);
    bench_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    bench_set_effort(0.5f, -0.5f);
    bench_expect_accepted();
    bench_set_velocity(0.8f, 0.8f);
    bench_expect_accepted();
    bench_run(300);
    TEST_ASSERT_TRUE(bench.board.effort_e4[0] <= 5000);
}

static void live_commands_are_refused_while_a_sequence_runs(void)
{
    bench_start(bench_upload(&short_drive, 1, 0));
    bench_run(10);
    bench_set_effort(0.9f, 0.9f);
    bench_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    bench_set_velocity(0.9f, 0.9f);
    bench_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    bench_run(1);
    TEST_ASSERT_EQUAL_INT16(3000, bench.board.effort_e4[0]);
}

static void sequence_is_refused_while_the_host_drives(void)
{
    const uint32_t crc = bench_upload(&short_drive, 1, 0);
    bench_set_effort(0.0f, 0.0f);
    bench_ask_u32(PROTO_ID_SEQ_START, crc);
    bench_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_LIVE);
}

static void upload_is_refused_while_a_sequence_runs(void)
{
    const uint32_t crc = bench_upload(&short_drive, 1, 0);
    bench_start(crc);
    bench_run(5);
    bench_begin_upload(1, 0);
    bench_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    send_one_segment(PROTO_SEGMENT_KIND_EFFORT, 100, 0.1f, 0.1f);
    bench_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    bench_ask_u32(PROTO_ID_SEQ_COMMIT, crc);
    bench_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    bench_ask_u32(PROTO_ID_SEQ_START, crc);
    bench_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    bench_run(1);
    TEST_ASSERT_EQUAL_INT16(3000, bench.board.effort_e4[0]);
}

static void start_is_refused_while_a_fault_is_latched(void)
{
    const uint32_t crc = bench_upload(&short_drive, 1, 0);
    bench_set_effort(0.0f, 0.0f);
    bench_run(600);
    bench_ask_u32(PROTO_ID_SEQ_START, crc);
    bench_expect_refused(PROTO_REFUSAL_REASON_FAULT_LATCHED, PROTO_FAULT_HOST_SILENT);
}

static void bad_uploads_are_refused_by_name(void)
{
    bench_begin_upload(0, 0);
    bench_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    bench_begin_upload(PROTO_MAX_SEGMENTS + 1, 0);
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_TOO_LONG, PROTO_MAX_SEGMENTS);
    bench_begin_upload(1, 201);
    bench_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    send_one_segment(PROTO_SEGMENT_KIND_EFFORT, 100, 0.1f, 0.1f); /* none of these began an upload */
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, PROTO_SEQUENCE_STATE_EMPTY);
    bench_ask_u32(PROTO_ID_SEQ_COMMIT, 0);
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, PROTO_SEQUENCE_STATE_EMPTY);
    bench_ask_u32(PROTO_ID_SEQ_START, 0);
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, PROTO_SEQUENCE_STATE_EMPTY);

    bench_begin_upload(3, 0);
    bench_expect_accepted();
    send_one_segment(3, 100, 0.1f, 0.1f);
    bench_expect_refused(PROTO_REFUSAL_REASON_UNKNOWN_SEGMENT_KIND, 0);
    send_one_segment(PROTO_SEGMENT_KIND_EFFORT, 0, 0.1f, 0.1f);
    bench_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    send_one_segment(PROTO_SEGMENT_KIND_EFFORT, 600001, 0.1f, 0.1f);
    bench_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    send_one_segment(PROTO_SEGMENT_KIND_EFFORT, 100, 1.1f, 0.1f);
    bench_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    send_one_segment(PROTO_SEGMENT_KIND_VELOCITY, 100, 0.1f, -1.6f);
    bench_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    send_one_segment(PROTO_SEGMENT_KIND_TWIST, 100, 1.4f,
                     1.0f); /* the right wheel would have to do 1.54 m/s */
    bench_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    send_one_segment(PROTO_SEGMENT_KIND_VELOCITY, 100, NAN, 0.0f);
    bench_expect_refused(PROTO_REFUSAL_REASON_NOT_FINITE, 0);
    send_one_segment(PROTO_SEGMENT_KIND_TWIST, 100, 0.0f, INFINITY);
    bench_expect_refused(PROTO_REFUSAL_REASON_NOT_FINITE, 0);

    bench_send_segments(1, &short_drive, 1);
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_GAP, 0);
    bench_send_segments(0, &short_drive, 1);
    bench_expect_accepted();
    bench_send_segments(0, &short_drive, 1);
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_GAP, 1);
    bench_ask_u32(PROTO_ID_SEQ_COMMIT, 0);
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_INCOMPLETE, 1);
    bench_ask_u32(PROTO_ID_SEQ_START, 0);
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, PROTO_SEQUENCE_STATE_RECEIVING);

    const struct proto_segment rest[3] = {short_drive, short_drive, short_drive};
    bench_send_segments(1, rest, 3);
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_TOO_LONG, 3);
    bench_send_segments(1, rest, 2);
    bench_expect_accepted();
    uint8_t packed[3 * PROTO_SEGMENT_SIZE];
    const uint32_t crc = crc32_update(0, packed, bench_pack(rest, 3, packed));
    bench_ask_u32(PROTO_ID_SEQ_COMMIT, crc ^ 1u);
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_BAD_CRC, crc);
    bench_ask_u32(PROTO_ID_SEQ_COMMIT, crc);
    bench_expect_accepted();
    bench_ask_u32(PROTO_ID_SEQ_START, crc ^ 1u);
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_BAD_CRC, crc);
}

static void frame_with_one_bad_segment_is_refused_as_a_whole(void)
{
    struct proto_segment segments[3] = {short_drive, short_drive, short_drive};
    segments[1].a = NAN;
    bench_begin_upload(3, 0);
    bench_send_segments(0, segments, 3);
    bench_expect_refused(PROTO_REFUSAL_REASON_NOT_FINITE, 1);
    segments[1].a = 0.2f;
    bench_send_segments(0, segments, 3);
    bench_expect_accepted();
}

static void sequence_beyond_a_limit_lowered_since_is_refused_at_the_start(void)
{
    const struct proto_segment segments[2] = {{PROTO_SEGMENT_KIND_EFFORT, 10, 0.2f, 0.2f},
                                              {PROTO_SEGMENT_KIND_EFFORT, 10, 0.6f, 0.6f}};
    const uint32_t crc = bench_upload(segments, 2, 0);
    bench_set_parameter(PROTO_PARAMETER_EFFORT_LIMIT, 0.5f);
    bench_ask_u32(PROTO_ID_SEQ_START, crc);
    bench_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
}

static void new_upload_forgets_the_sequence_before_it(void)
{
    const uint32_t crc = bench_upload(&short_drive, 1, 0);
    bench_begin_upload(2, 0);
    bench_ask_u32(PROTO_ID_SEQ_START, crc);
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, PROTO_SEQUENCE_STATE_RECEIVING);
    bench_ask(PROTO_ID_SEQ_ABORT, NULL, 0);
    bench_expect_accepted();
    bench_ask_u32(PROTO_ID_SEQ_COMMIT, crc);
    bench_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, PROTO_SEQUENCE_STATE_EMPTY);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(bad_live_commands_leave_the_wheels_as_they_were);
    RUN_TEST(limits_of_live_commands_are_the_parameters);
    RUN_TEST(live_commands_are_refused_while_a_sequence_runs);
    RUN_TEST(sequence_is_refused_while_the_host_drives);
    RUN_TEST(upload_is_refused_while_a_sequence_runs);
    RUN_TEST(start_is_refused_while_a_fault_is_latched);
    RUN_TEST(bad_uploads_are_refused_by_name);
    RUN_TEST(frame_with_one_bad_segment_is_refused_as_a_whole);
    RUN_TEST(sequence_beyond_a_limit_lowered_since_is_refused_at_the_start);
    RUN_TEST(new_upload_forgets_the_sequence_before_it);
    return UNITY_END();
}
