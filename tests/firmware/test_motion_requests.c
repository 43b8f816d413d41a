/* Motion requests are checked completely before they take effect: live commands, uploads, starts. */
#include "fixture.h"

void setUp(void)
{
    fixture_power_up();
}

void tearDown(void)
{
}

static const struct proto_segment short_drive = {PROTO_SEGMENT_KIND_EFFORT, 100, 0.3f, 0.3f};

static void send_one_segment(uint8_t kind, uint32_t duration_ms, float a, float b)
{
    const struct proto_segment segment = {.kind = kind, .duration_ms = duration_ms, .a = a, .b = b};
    fixture_send_segments(0, &segment, 1);
}

/* After a refusal the bridges' efforts are unchanged. */
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
        fixture_set_effort(bad[i].left, bad[i].right);
        fixture_expect_refused((enum proto_refusal_reason)bad[i].reason, bad[i].detail);
        fixture_set_velocity(bad[i].left * 2.0f, bad[i].right * 2.0f);
        fixture_expect_refused((enum proto_refusal_reason)bad[i].reason, bad[i].detail);
        fixture_run(1);
        TEST_ASSERT_EQUAL_INT16(left_e4, fixture.board.effort_e4[0]);
        TEST_ASSERT_EQUAL_INT16(right_e4, fixture.board.effort_e4[1]);
    }
}

static void bad_live_commands_leave_the_wheels_as_they_were(void)
{
    check_bad_live_commands(0, 0);
    fixture_set_effort(0.25f, -0.4f);
    fixture_run(4);
    check_bad_live_commands(2500, -4000);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_LIVE, fixture_status().state);
}

static void limits_of_live_commands_are_the_parameters(void)
{
    fixture_set_parameter(PROTO_PARAMETER_EFFORT_LIMIT, 0.5f);
    fixture_set_parameter(PROTO_PARAMETER_SPEED_LIMIT_MPS, 0.8f);
    fixture_set_effort(0.51f, 0.0f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    fixture_set_velocity(0.0f, -0.81f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    fixture_set_effort(0.5f, -0.5f);
    fixture_expect_accepted();
    fixture_set_velocity(0.8f, 0.8f);
    fixture_expect_accepted();
    fixture_run(300);
    TEST_ASSERT_TRUE(fixture.board.effort_e4[0] <= 5000);
}

static void effort_changes_by_no_more_than_its_limit_in_a_tick(void)
{
    const int16_t expected_e4[] = {1000, 2000, 3000, 3500, 3500, 2500, 1500, 500, -500, -1000, -1000};
    for (size_t i = 0; i < sizeof expected_e4 / sizeof expected_e4[0]; i++) {
        fixture_set_effort(i < 5 ? 0.35f : -0.1f, 0.0f);
        fixture_run(1);
        TEST_ASSERT_EQUAL_INT16(expected_e4[i], fixture.board.effort_e4[0]);
        TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[1]);
    }
    fixture_stop();
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    fixture_run(1);
    fixture_set_effort(0.35f, 0.0f);
    fixture_run(1);
    TEST_ASSERT_EQUAL_INT16(1000, fixture.board.effort_e4[0]); /* from the brake, not from before it */
}

static void live_commands_are_refused_while_a_sequence_runs(void)
{
    fixture_start(fixture_upload(&short_drive, 1, 0));
    fixture_run(10);
    fixture_set_effort(0.9f, 0.9f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    fixture_set_velocity(0.9f, 0.9f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    fixture_run(1);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
}

static void sequence_is_refused_while_the_host_drives(void)
{
    const uint32_t crc = fixture_upload(&short_drive, 1, 0);
    fixture_set_effort(0.0f, 0.0f);
    fixture_ask_start(crc, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_LIVE);
}

static void upload_is_refused_while_a_sequence_runs(void)
{
    const uint32_t crc = fixture_upload(&short_drive, 1, 0);
    fixture_start(crc);
    fixture_run(5);
    fixture_begin_upload(1, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    send_one_segment(PROTO_SEGMENT_KIND_EFFORT, 100, 0.1f, 0.1f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    fixture_ask_u32(PROTO_ID_SEQ_COMMIT, crc);
    fixture_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    fixture_ask_start(crc, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    fixture_run(1);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
}

static void start_is_refused_while_a_fault_is_latched(void)
{
    const uint32_t crc = fixture_upload(&short_drive, 1, 0);
    fixture_set_effort(0.0f, 0.0f);
    fixture_run(600);
    fixture_ask_start(crc, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_FAULT_LATCHED, PROTO_FAULT_HOST_SILENT);
}

static void bad_uploads_are_refused_by_name(void)
{
    fixture_begin_upload(0, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    fixture_begin_upload(PROTO_MAX_SEGMENTS + 1, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_TOO_LONG, PROTO_MAX_SEGMENTS);
    fixture_begin_upload(1, 201);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    send_one_segment(PROTO_SEGMENT_KIND_EFFORT, 100, 0.1f, 0.1f); /* none of these began an upload */
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, PROTO_SEQUENCE_STATE_EMPTY);
    fixture_ask_u32(PROTO_ID_SEQ_COMMIT, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, PROTO_SEQUENCE_STATE_EMPTY);
    fixture_ask_start(0, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, PROTO_SEQUENCE_STATE_EMPTY);

    fixture_begin_upload(3, 0);
    fixture_expect_accepted();
    send_one_segment(3, 100, 0.1f, 0.1f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_UNKNOWN_SEGMENT_KIND, 0);
    send_one_segment(PROTO_SEGMENT_KIND_EFFORT, 0, 0.1f, 0.1f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    send_one_segment(PROTO_SEGMENT_KIND_EFFORT, 600001, 0.1f, 0.1f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    send_one_segment(PROTO_SEGMENT_KIND_EFFORT, 100, 1.1f, 0.1f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    send_one_segment(PROTO_SEGMENT_KIND_VELOCITY, 100, 0.1f, -1.6f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    send_one_segment(PROTO_SEGMENT_KIND_TWIST, 100, 1.4f,
                     1.0f); /* the right wheel would have to do 1.54 m/s */
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    send_one_segment(PROTO_SEGMENT_KIND_VELOCITY, 100, NAN, 0.0f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_NOT_FINITE, 0);
    send_one_segment(PROTO_SEGMENT_KIND_TWIST, 100, 0.0f, INFINITY);
    fixture_expect_refused(PROTO_REFUSAL_REASON_NOT_FINITE, 0);

    fixture_send_segments(1, &short_drive, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_GAP, 0);
    fixture_send_segments(0, &short_drive, 1);
    fixture_expect_accepted();
    fixture_send_segments(0, &short_drive, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_GAP, 1);
    fixture_ask_u32(PROTO_ID_SEQ_COMMIT, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_INCOMPLETE, 1);
    fixture_ask_start(0, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, PROTO_SEQUENCE_STATE_RECEIVING);

    const struct proto_segment rest[3] = {short_drive, short_drive, short_drive};
    fixture_send_segments(1, rest, 3);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_TOO_LONG, 3);
    fixture_send_segments(1, rest, 2);
    fixture_expect_accepted();
    uint8_t packed[3 * PROTO_SEGMENT_SIZE];
    const uint32_t crc = crc32_update(0, packed, fixture_pack(rest, 3, packed));
    fixture_ask_u32(PROTO_ID_SEQ_COMMIT, crc ^ 1u);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_BAD_CRC, crc);
    fixture_ask_u32(PROTO_ID_SEQ_COMMIT, crc);
    fixture_expect_accepted();
    fixture_ask_start(crc ^ 1u, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_BAD_CRC, crc);
}

static void frame_with_one_bad_segment_is_refused_as_a_whole(void)
{
    struct proto_segment segments[3] = {short_drive, short_drive, short_drive};
    segments[1].a = NAN;
    fixture_begin_upload(3, 0);
    fixture_send_segments(0, segments, 3);
    fixture_expect_refused(PROTO_REFUSAL_REASON_NOT_FINITE, 1);
    segments[1].a = 0.2f;
    fixture_send_segments(0, segments, 3);
    fixture_expect_accepted();
}

static void sequence_beyond_a_limit_lowered_since_is_refused_at_the_start(void)
{
    const struct proto_segment segments[2] = {{PROTO_SEGMENT_KIND_EFFORT, 10, 0.2f, 0.2f},
                                              {PROTO_SEGMENT_KIND_EFFORT, 10, 0.6f, 0.6f}};
    const uint32_t crc = fixture_upload(segments, 2, 0);
    fixture_set_parameter(PROTO_PARAMETER_EFFORT_LIMIT, 0.5f);
    fixture_ask_start(crc, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
}

static void new_upload_forgets_the_sequence_before_it(void)
{
    const uint32_t crc = fixture_upload(&short_drive, 1, 0);
    fixture_begin_upload(2, 0);
    fixture_ask_start(crc, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, PROTO_SEQUENCE_STATE_RECEIVING);
    fixture_ask(PROTO_ID_SEQ_ABORT, NULL, 0);
    fixture_expect_accepted();
    fixture_ask_u32(PROTO_ID_SEQ_COMMIT, crc);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, PROTO_SEQUENCE_STATE_EMPTY);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(bad_live_commands_leave_the_wheels_as_they_were);
    RUN_TEST(limits_of_live_commands_are_the_parameters);
    RUN_TEST(effort_changes_by_no_more_than_its_limit_in_a_tick);
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
