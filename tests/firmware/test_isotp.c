/* ISO-TP: two ends communicate at every length and pace, and a faulty peer costs one message. */
#include <string.h>

#include "isotp.h"
#include "unity.h"

enum { CAPACITY = 1031 };

static uint8_t buffers[2][CAPACITY];
static struct isotp a, b; /* a sends, b receives */
static uint8_t message[ISOTP_MAX_LENGTH + 1];
static uint32_t now_ms;

void setUp(void)
{
    now_ms = 5;
    isotp_init(&a, buffers[0], CAPACITY, 8);
    isotp_init(&b, buffers[1], CAPACITY, 8);
    for (size_t i = 0; i < sizeof message; i++) {
        message[i] = (uint8_t)(i * 7u + i / 256u);
    }
}

void tearDown(void)
{
}

/* One frame from `from`, if it has one, to `to`; true when it completed a message there. */
static bool pass(struct isotp *from, struct isotp *to, size_t *length)
{
    uint8_t frame[ISOTP_FRAME_SIZE];
    const size_t size = isotp_next_frame(from, frame, now_ms);
    return isotp_receive(to, frame, size, now_ms, length);
}

/* What b has received when a has sent all it could; 0: no message. */
static size_t converse(void)
{
    size_t length = 0;
    for (uint32_t i = 0; i < 2000 && length == 0; i++) {
        size_t ignored;
        (void)pass(&a, &b, &length);
        (void)pass(&b, &a, &ignored);
    }
    return length;
}

static bool give(struct isotp *to, const char *bytes, size_t size)
{
    size_t length = 0;
    return isotp_receive(to, (const uint8_t *)bytes, size, now_ms, &length);
}

#define GIVE(to, bytes) give(to, bytes, sizeof(bytes) - 1)

static void expect_next(struct isotp *from, const char *bytes, size_t size)
{
    uint8_t frame[ISOTP_FRAME_SIZE];
    TEST_ASSERT_EQUAL(size, isotp_next_frame(from, frame, now_ms));
    if (size > 0) {
        TEST_ASSERT_EQUAL_HEX8_ARRAY(bytes, frame, size);
    }
}

#define EXPECT_NEXT(from, bytes) expect_next(from, bytes, sizeof(bytes) - 1)

/* Takes the first frame of a message of `length` and the frames after it, until a waits for flow control. */
static void begin_message(size_t length)
{
    uint8_t frame[ISOTP_FRAME_SIZE];
    TEST_ASSERT_TRUE(isotp_send(&a, message, length));
    TEST_ASSERT_EQUAL(ISOTP_FRAME_SIZE, isotp_next_frame(&a, frame, now_ms));
    EXPECT_NEXT(&a, "");
}

static void a_message_of_every_length_arrives_whole(void)
{
    for (size_t length = 1; length <= CAPACITY; length++) {
        TEST_ASSERT_TRUE(isotp_send(&a, message, length));
        TEST_ASSERT_EQUAL(length, converse());
        TEST_ASSERT_EQUAL_HEX8_ARRAY(message, buffers[1], length);
        TEST_ASSERT_TRUE(isotp_is_idle(&a));
    }
}

static void blocks_of_every_size_are_kept(void)
{
    for (uint8_t block = 0; block < 20; block++) {
        isotp_init(&b, buffers[1], CAPACITY, block);
        TEST_ASSERT_TRUE(isotp_send(&a, message, 300));
        TEST_ASSERT_EQUAL(300, converse());
        TEST_ASSERT_EQUAL_HEX8_ARRAY(message, buffers[1], 300);
    }
}

static void what_is_no_message_or_comes_too_early_is_not_sent(void)
{
    TEST_ASSERT_FALSE(isotp_send(&a, message, 0));
    TEST_ASSERT_FALSE(isotp_send(&a, message, ISOTP_MAX_LENGTH + 1));
    TEST_ASSERT_TRUE(isotp_send(&a, message, ISOTP_MAX_LENGTH));
    TEST_ASSERT_FALSE(isotp_send(&a, message, 1));
}

static void a_message_too_long_for_the_peer_is_given_up(void)
{
    uint8_t frame[ISOTP_FRAME_SIZE];
    TEST_ASSERT_TRUE(isotp_send(&a, message, CAPACITY + 1));
    (void)isotp_next_frame(&a, frame, now_ms);
    TEST_ASSERT_FALSE(give(&b, (const char *)frame, sizeof frame));
    EXPECT_NEXT(&b, "\x32\x08\x00");
    TEST_ASSERT_FALSE(GIVE(&a, "\x32\x08\x00"));
    TEST_ASSERT_TRUE(isotp_is_idle(&a));
    TEST_ASSERT_EQUAL_UINT32(1, a.errors.overflows);
    TEST_ASSERT_EQUAL_UINT32(1, b.errors.overflows);
}

static void the_longer_lengths_of_2016_are_refused_as_too_long(void)
{
    TEST_ASSERT_FALSE(GIVE(&b, "\x10\x00\x00\x00\x20\x00\x01\x02"));
    EXPECT_NEXT(&b, "\x32\x08\x00");
}

static void frames_that_say_nothing_sensible_are_counted_and_ignored(void)
{
    TEST_ASSERT_FALSE(GIVE(&b, "\x00"));                             /* a single frame of no bytes */
    TEST_ASSERT_FALSE(GIVE(&b, "\x08\x01\x02\x03\x04\x05\x06\x07")); /* of more than it can hold */
    TEST_ASSERT_FALSE(GIVE(&b, "\x05\x01\x02\x03"));                 /* of more than it has */
    TEST_ASSERT_FALSE(GIVE(&b, "\x10"));                             /* half a first frame */
    TEST_ASSERT_FALSE(GIVE(&b, "\x10\x40\x01\x02"));                 /* a short one */
    TEST_ASSERT_FALSE(GIVE(&b, "\x10\x07\x01\x02\x03\x04\x05\x06")); /* for what one frame holds */
    TEST_ASSERT_FALSE(GIVE(&b, "\x21\x01\x02"));                     /* a continuation of nothing */
    TEST_ASSERT_FALSE(GIVE(&b, "\x30\x00\x00"));                     /* flow control that was not requested */
    TEST_ASSERT_FALSE(GIVE(&b, "\x70\x00\x00"));                     /* a kind that does not exist */
    TEST_ASSERT_EQUAL_UINT32(9, b.errors.unexpected);
    TEST_ASSERT_FALSE(GIVE(&b, ""));
    TEST_ASSERT_FALSE(GIVE(&b, "\x07\x01\x02\x03\x04\x05\x06\x07\x08")); /* no frame of classic CAN */
    TEST_ASSERT_EQUAL_UINT32(9, b.errors.unexpected);
    EXPECT_NEXT(&b, "");
    TEST_ASSERT_TRUE(GIVE(&b, "\x01\x2A"));
    TEST_ASSERT_EQUAL_HEX8(0x2A, buffers[1][0]);
}

static void a_single_frame_longer_than_the_buffer_is_ignored(void)
{
    isotp_init(&b, buffers[1], 3, 8);
    TEST_ASSERT_FALSE(GIVE(&b, "\x04\x01\x02\x03\x04"));
    TEST_ASSERT_TRUE(GIVE(&b, "\x03\x01\x02\x03"));
}

static void a_lost_frame_costs_its_message_and_no_other(void)
{
    TEST_ASSERT_FALSE(GIVE(&b, "\x10\x14\x01\x02\x03\x04\x05\x06"));
    EXPECT_NEXT(&b, "\x30\x08\x00");
    TEST_ASSERT_FALSE(GIVE(&b, "\x22\x07\x08\x09\x0A\x0B\x0C\x0D")); /* the first of them is missing */
    TEST_ASSERT_EQUAL_UINT32(1, b.errors.sequence);
    TEST_ASSERT_TRUE(isotp_send(&a, message, 100));
    TEST_ASSERT_EQUAL(100, converse());
}

static void a_frame_cut_short_costs_its_message(void)
{
    TEST_ASSERT_FALSE(GIVE(&b, "\x10\x14\x01\x02\x03\x04\x05\x06"));
    TEST_ASSERT_FALSE(GIVE(&b, "\x21\x07\x08\x09"));
    TEST_ASSERT_EQUAL_UINT32(1, b.errors.sequence);
    EXPECT_NEXT(&b, "");
}

static void a_new_message_ends_the_one_under_way(void)
{
    TEST_ASSERT_FALSE(GIVE(&b, "\x10\x14\x01\x02\x03\x04\x05\x06"));
    TEST_ASSERT_TRUE(GIVE(&b, "\x02\xAA\xBB"));
    TEST_ASSERT_EQUAL_UINT32(1, b.errors.unexpected);
    TEST_ASSERT_FALSE(GIVE(&b, "\x10\x08\x01\x02\x03\x04\x05\x06"));
    TEST_ASSERT_FALSE(GIVE(&b, "\x10\x08\x11\x12\x13\x14\x15\x16"));
    TEST_ASSERT_EQUAL_UINT32(2, b.errors.unexpected);
    TEST_ASSERT_TRUE(GIVE(&b, "\x21\x17\x18"));
    TEST_ASSERT_EQUAL_HEX8_ARRAY("\x11\x12\x13\x14\x15\x16\x17\x18", buffers[1], 8);
}

static void a_peer_may_ask_to_wait_but_not_for_ever(void)
{
    begin_message(20);
    for (int i = 0; i < ISOTP_WAITS_ALLOWED; i++) {
        now_ms += ISOTP_TIMEOUT_MS - 1;
        TEST_ASSERT_FALSE(GIVE(&a, "\x31\x00\x00"));
        isotp_expire(&a, now_ms);
        TEST_ASSERT_FALSE(isotp_is_idle(&a));
    }
    TEST_ASSERT_FALSE(GIVE(&a, "\x31\x00\x00"));
    TEST_ASSERT_TRUE(isotp_is_idle(&a));
    TEST_ASSERT_EQUAL_UINT32(1, a.errors.unexpected);
}

static void an_unknown_flow_status_gives_the_message_up(void)
{
    begin_message(20);
    TEST_ASSERT_FALSE(GIVE(&a, "\x30\x00")); /* too short to be one */
    TEST_ASSERT_FALSE(isotp_is_idle(&a));
    TEST_ASSERT_FALSE(GIVE(&a, "\x35\x00\x00"));
    TEST_ASSERT_TRUE(isotp_is_idle(&a));
}

/* Milliseconds between the first two frames of a block, after flow control with this STmin. */
static uint32_t gap_for(uint8_t st_min)
{
    const char leave[] = {0x30, 0x00, (char)st_min};
    uint8_t frame[ISOTP_FRAME_SIZE];
    setUp();
    begin_message(40);
    TEST_ASSERT_FALSE(give(&a, leave, sizeof leave));
    TEST_ASSERT_EQUAL(ISOTP_FRAME_SIZE, isotp_next_frame(&a, frame, now_ms));
    const uint32_t first_ms = now_ms;
    while (isotp_next_frame(&a, frame, now_ms) == 0) {
        now_ms++;
    }
    return now_ms - first_ms;
}

static void the_pause_that_the_peer_asks_for_is_kept(void)
{
    TEST_ASSERT_EQUAL_UINT32(0, gap_for(0));
    TEST_ASSERT_EQUAL_UINT32(2, gap_for(1)); /* ticks may lie just behind and just before the two */
    TEST_ASSERT_EQUAL_UINT32(11, gap_for(10));
    TEST_ASSERT_EQUAL_UINT32(128, gap_for(0x7F));
    TEST_ASSERT_EQUAL_UINT32(128, gap_for(0x80)); /* reserved: the longest */
    TEST_ASSERT_EQUAL_UINT32(2, gap_for(0xF1));   /* 100 us */
    TEST_ASSERT_EQUAL_UINT32(2, gap_for(0xF9));
    TEST_ASSERT_EQUAL_UINT32(128, gap_for(0xFA));
}

static void a_peer_that_falls_silent_is_given_up(void)
{
    begin_message(20);
    TEST_ASSERT_FALSE(GIVE(&b, "\x10\x14\x01\x02\x03\x04\x05\x06"));
    now_ms += ISOTP_TIMEOUT_MS - 1;
    isotp_expire(&a, now_ms);
    isotp_expire(&b, now_ms);
    TEST_ASSERT_EQUAL_UINT32(0, a.errors.timeouts + b.errors.timeouts);
    now_ms++;
    isotp_expire(&a, now_ms);
    isotp_expire(&b, now_ms);
    TEST_ASSERT_TRUE(isotp_is_idle(&a));
    TEST_ASSERT_EQUAL_UINT32(1, a.errors.timeouts);
    TEST_ASSERT_EQUAL_UINT32(1, b.errors.timeouts);
    TEST_ASSERT_FALSE(GIVE(&b, "\x21\x07\x08\x09\x0A\x0B\x0C\x0D"));
    TEST_ASSERT_EQUAL_UINT32(1, b.errors.unexpected);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(a_message_of_every_length_arrives_whole);
    RUN_TEST(blocks_of_every_size_are_kept);
    RUN_TEST(what_is_no_message_or_comes_too_early_is_not_sent);
    RUN_TEST(a_message_too_long_for_the_peer_is_given_up);
    RUN_TEST(the_longer_lengths_of_2016_are_refused_as_too_long);
    RUN_TEST(frames_that_say_nothing_sensible_are_counted_and_ignored);
    RUN_TEST(a_single_frame_longer_than_the_buffer_is_ignored);
    RUN_TEST(a_lost_frame_costs_its_message_and_no_other);
    RUN_TEST(a_frame_cut_short_costs_its_message);
    RUN_TEST(a_new_message_ends_the_one_under_way);
    RUN_TEST(a_peer_may_ask_to_wait_but_not_for_ever);
    RUN_TEST(an_unknown_flow_status_gives_the_message_up);
    RUN_TEST(the_pause_that_the_peer_asks_for_is_kept);
    RUN_TEST(a_peer_that_falls_silent_is_given_up);
    return UNITY_END();
}
