/* A stop is heard in the received bytes however they are cut into pieces, and nothing else is taken for one.
 */
#include <string.h>

#include "frame.h"
#include "proto.h"
#include "random.h"
#include "stop_listener.h"
#include "unity.h"

static struct stop_listener listener;

void setUp(void)
{
    listener = (struct stop_listener){0};
}

void tearDown(void)
{
}

static size_t coded_frame(uint8_t id, uint16_t sequence, size_t payload_length, uint8_t *out)
{
    static const uint8_t payload[200] = {1, 0, 2};
    return frame_encode(id, sequence, payload, payload_length, out, FRAME_MAX_CODED);
}

static void stop_is_heard_at_its_last_byte_in_any_two_pieces(void)
{
    uint8_t coded[FRAME_MAX_CODED];
    for (uint32_t sequence = 0; sequence < 0x10000u; sequence += 85u) { /* zeros in all places */
        const size_t length = coded_frame(PROTO_ID_STOP, (uint16_t)sequence, 0, coded);
        for (size_t cut = 0; cut < length; cut++) {
            TEST_ASSERT_FALSE(stop_listener_hear(&listener, coded, cut));
            TEST_ASSERT_TRUE(stop_listener_hear(&listener, coded + cut, length - cut));
        }
    }
}

static void stop_is_heard_wherever_it_lies_between_other_bytes(void)
{
    uint8_t bytes[64];
    for (size_t before = 0; before < 40; before++) {
        memset(bytes, 0xAB, sizeof bytes);
        bytes[before] = 0;
        const size_t length = coded_frame(PROTO_ID_STOP, 7, 0, bytes + before + 1);
        TEST_ASSERT_TRUE(stop_listener_hear(&listener, bytes, before + 1 + length + 5));
        TEST_ASSERT_FALSE(stop_listener_hear(&listener, (const uint8_t *)"\0", 1));
    }
}

static void second_stop_after_a_first_counts_as_heard_once(void)
{
    uint8_t bytes[2 * FRAME_MAX_CODED];
    const size_t first = coded_frame(PROTO_ID_STOP, 1, 0, bytes);
    const size_t second = coded_frame(PROTO_ID_STOP, 2, 0, bytes + first);
    TEST_ASSERT_TRUE(stop_listener_hear(&listener, bytes, first + second));
    TEST_ASSERT_FALSE(stop_listener_hear(&listener, (const uint8_t *)"\0\0", 2));
}

static void other_frames_are_no_stop(void)
{
    uint8_t coded[FRAME_MAX_CODED];
    for (uint32_t id = 1; id < 128; id++) {
        for (size_t payload = 0; payload < 8; payload++) {
            const size_t length = coded_frame((uint8_t)id, 9, payload, coded);
            const bool is_stop = id == PROTO_ID_STOP && payload == 0;
            TEST_ASSERT_EQUAL(is_stop, stop_listener_hear(&listener, coded, length));
        }
    }
}

static void damaged_stop_is_none(void)
{
    uint8_t coded[FRAME_MAX_CODED];
    const size_t length = coded_frame(PROTO_ID_STOP, 9, 0, coded);
    for (size_t at = 0; at + 1 < length; at++) {
        for (unsigned bit = 0; bit < 8; bit++) {
            uint8_t damaged[FRAME_MAX_CODED];
            memcpy(damaged, coded, length);
            damaged[at] = (uint8_t)(damaged[at] ^ (1u << bit));
            TEST_ASSERT_FALSE(stop_listener_hear(&listener, damaged, length));
        }
    }
}

static void stop_that_ends_a_longer_frame_is_none(void)
{
    uint8_t bytes[300] = {0};
    for (size_t before = 1; before < 280; before++) {
        memset(bytes, 0xAB, before);
        const size_t length = coded_frame(PROTO_ID_STOP, 9, 0, bytes + before);
        TEST_ASSERT_FALSE(stop_listener_hear(&listener, bytes, before + length));
    }
}

static void noise_in_pieces_is_heard_as_in_one(void)
{
    random_seed(5);
    for (int round = 0; round < 3000; round++) {
        uint8_t bytes[96];
        struct stop_listener whole = {0};
        for (size_t i = 0; i < sizeof bytes; i++) {
            bytes[i] = random_below(8) == 0 ? 0 : (uint8_t)random_u32();
        }
        const size_t at = random_below(60);
        bytes[at] = 0;
        (void)coded_frame(PROTO_ID_STOP, (uint16_t)round, 0, bytes + at + 1);
        const bool heard = stop_listener_hear(&whole, bytes, sizeof bytes);
        bool in_pieces = false;
        listener = (struct stop_listener){0};
        for (size_t i = 0; i < sizeof bytes;) {
            size_t piece = 1u + random_below(9);
            piece = piece < sizeof bytes - i ? piece : sizeof bytes - i;
            in_pieces = stop_listener_hear(&listener, bytes + i, piece) || in_pieces;
            i += piece;
        }
        TEST_ASSERT_TRUE(heard);
        TEST_ASSERT_TRUE(in_pieces);
        TEST_ASSERT_EQUAL_UINT8_ARRAY(whole.last, listener.last, sizeof whole.last);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(stop_is_heard_at_its_last_byte_in_any_two_pieces);
    RUN_TEST(stop_is_heard_wherever_it_lies_between_other_bytes);
    RUN_TEST(second_stop_after_a_first_counts_as_heard_once);
    RUN_TEST(other_frames_are_no_stop);
    RUN_TEST(damaged_stop_is_none);
    RUN_TEST(stop_that_ends_a_longer_frame_is_none);
    RUN_TEST(noise_in_pieces_is_heard_as_in_one);
    return UNITY_END();
}
