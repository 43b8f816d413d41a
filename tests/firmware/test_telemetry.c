/* Live signals: sampled at their rate, read by number, and overwritten samples are counted. */

#include "fixture.h"

void setUp(void);
void tearDown(void);

enum { BATTERY = 1 << PROTO_SIGNAL_BATTERY, COUNTS_LEFT = 1 << PROTO_SIGNAL_COUNTS_LEFT };

static struct proto_stream_read_reply got;

void setUp(void)
{
    fixture_power_up();
}

void tearDown(void)
{
}

static void start(uint32_t signals, uint16_t rate_hz)
{
    const struct proto_stream_start_request request = {.signals = signals, .rate_hz = rate_hz};
    uint8_t payload[PROTO_STREAM_START_REQUEST_SIZE];
    (void)proto_stream_start_request_encode(&request, payload, sizeof payload);
    fixture_ask(PROTO_ID_STREAM_START, payload, sizeof payload);
}

static uint32_t read_samples(uint32_t first, uint16_t max_samples)
{
    const struct proto_stream_read_request request = {.first = first, .most = max_samples};
    uint8_t payload[PROTO_STREAM_READ_REQUEST_SIZE];
    (void)proto_stream_read_request_encode(&request, payload, sizeof payload);
    fixture_ask(PROTO_ID_STREAM_READ, payload, sizeof payload);
    TEST_ASSERT_TRUE(
        proto_stream_read_reply_decode(&got, fixture.reply.payload, fixture.reply.payload_length));
    return (uint32_t)got.samples_length;
}

static uint32_t word(uint32_t index)
{
    const uint8_t *const at = got.samples + 4 * index;
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static void samples_come_at_the_rate_with_the_signals_in_the_order_of_their_bits(void)
{
    fixture.motors_turn = false;
    fixture.board.sample.counts[0] = -7;
    fixture_run(300);
    start(BATTERY | COUNTS_LEFT, 200);
    fixture_expect_accepted();
    fixture_run(100);
    TEST_ASSERT_EQUAL_UINT32(20 * 12, read_samples(0, 1000));
    TEST_ASSERT_EQUAL_UINT32(0, got.first);
    TEST_ASSERT_EQUAL_UINT32(20, got.end);
    for (uint32_t i = 0; i < 20; i++) {
        TEST_ASSERT_EQUAL_UINT32(300 + 5 * (i + 1), word(3 * i));
        TEST_ASSERT_EQUAL_INT32(-7, (int32_t)word(3 * i + 1));
        TEST_ASSERT_EQUAL_UINT32(1200, word(3 * i + 2));
    }
}

static void a_rate_that_divides_no_second_is_kept_on_average(void)
{
    start(BATTERY, 60);
    fixture_run(10000);
    (void)read_samples(0, 0);
    TEST_ASSERT_EQUAL_UINT32(600, got.end);
}

static void a_read_gives_no_more_than_is_wanted_or_there(void)
{
    start(BATTERY, 100);
    fixture_run(100);
    TEST_ASSERT_EQUAL_UINT32(3 * 8, read_samples(4, 3));
    TEST_ASSERT_EQUAL_UINT32(4, got.first);
    TEST_ASSERT_EQUAL_UINT32(2 * 8, read_samples(8, 5));
    TEST_ASSERT_EQUAL_UINT32(0, read_samples(10, 5));
    TEST_ASSERT_EQUAL_UINT32(0, read_samples(11, 5));
    TEST_ASSERT_EQUAL_UINT32(10, got.first);
}

static void what_was_overwritten_is_left_out(void)
{
    struct proto_stream_start_reply reply;
    start((1u << TELEMETRY_SIGNALS) - 1u, 200);
    TEST_ASSERT_TRUE(
        proto_stream_start_reply_decode(&reply, fixture.reply.payload, fixture.reply.payload_length));
    TEST_ASSERT_EQUAL_UINT16(TELEMETRY_WORDS / (TELEMETRY_SIGNALS + 1), reply.capacity);
    fixture_run(5000);
    TEST_ASSERT_EQUAL_UINT32(60, read_samples(0, 1));
    TEST_ASSERT_EQUAL_UINT32(1000, got.end);
    TEST_ASSERT_EQUAL_UINT32(1000 - (reply.capacity - 2u), got.first);
    TEST_ASSERT_EQUAL_UINT32(5 * (got.first + 1), word(0));
    (void)read_samples(got.first, 1000); /* a reply holds so many */
    TEST_ASSERT_EQUAL_UINT32((PROTO_MAX_PAYLOAD - PROTO_STREAM_READ_REPLY_SIZE) / 60 * 60,
                             got.samples_length);
}

static void a_stream_replaces_the_one_before_and_can_be_ended(void)
{
    start(BATTERY, 200);
    fixture_run(20);
    (void)read_samples(0, 9);
    const uint16_t before = got.stream_id;
    start(COUNTS_LEFT, 50);
    fixture_run(20);
    (void)read_samples(0, 9);
    TEST_ASSERT_NOT_EQUAL(before, got.stream_id);
    TEST_ASSERT_EQUAL_UINT32(1, got.end);
    start(0, 0);
    fixture_run(20);
    (void)read_samples(0, 9);
    TEST_ASSERT_EQUAL_UINT32(0, got.end);
    fixture.controller.robot.telemetry.stream_id = UINT16_MAX;
    start(BATTERY, 200);
    (void)read_samples(0, 9);
    TEST_ASSERT_EQUAL_UINT16(1, got.stream_id); /* 0 is for none */
}

static void before_the_first_stream_there_is_none(void)
{
    fixture_run(20);
    TEST_ASSERT_EQUAL_UINT32(0, read_samples(0, 9));
    TEST_ASSERT_EQUAL_UINT16(0, got.stream_id);
}

static void what_cannot_be_is_refused(void)
{
    start(1u << TELEMETRY_SIGNALS, 100);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    start(BATTERY, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    start(BATTERY, 201);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    fixture_ask(PROTO_ID_STREAM_START, "x", 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_BAD_LENGTH, 1);
    fixture_ask(PROTO_ID_STREAM_READ, "x", 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_BAD_LENGTH, 1);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(samples_come_at_the_rate_with_the_signals_in_the_order_of_their_bits);
    RUN_TEST(a_rate_that_divides_no_second_is_kept_on_average);
    RUN_TEST(a_read_gives_no_more_than_is_wanted_or_there);
    RUN_TEST(what_was_overwritten_is_left_out);
    RUN_TEST(a_stream_replaces_the_one_before_and_can_be_ended);
    RUN_TEST(before_the_first_stream_there_is_none);
    RUN_TEST(what_cannot_be_is_refused);
    return UNITY_END();
}
