/* A stop is heard in the received bytes however they are cut into pieces, and nothing else is taken for one.
 */
#include <string.h>

#include "crc32.h"
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
        const size_t length = coded_frame(PROTO_ID_STOP, (uint16_t)sequence, sequence % 5u, coded);
        for (size_t cut = 0; cut < length; cut++) {
            TEST_ASSERT_FALSE(stop_listener_hear(&listener, coded, cut));
            TEST_ASSERT_TRUE(stop_listener_hear(&listener, coded + cut, length - cut));
        }
    }
}

static void stop_of_any_length_is_heard_until_it_is_longer_than_a_frame(void)
{
    static uint8_t payload[PROTO_MAX_PAYLOAD];
    static uint8_t coded[FRAME_MAX_CODED];
    static struct frame_decoder decoder;
    random_seed(3);
    for (size_t length = 0; length <= sizeof payload; length++) {
        for (size_t i = 0; i < length; i++) {
            payload[i] = random_below(200) == 0 ? 0 : (uint8_t)random_u32();
        }
        const size_t size = frame_encode(PROTO_ID_STOP, 7, payload, length, coded, sizeof coded);
        TEST_ASSERT_TRUE(stop_listener_hear(&listener, coded, size));
    }
    /* One byte more, with the CRC that belongs to it: neither hears it. */
    static uint8_t plain[FRAME_MAX_PLAIN + 1];
    memset(plain, 1, sizeof plain);
    plain[0] = (uint8_t)PROTO_ID_STOP;
    const uint32_t crc = crc32_update(0, plain, sizeof plain - FRAME_CRC_SIZE);
    memcpy(plain + sizeof plain - FRAME_CRC_SIZE, &crc, sizeof crc);
    struct frame out;
    bool decoded = false;
    for (size_t at = 0; at < sizeof plain;) { /* by hand, since frame_encode refuses; no zero in it */
        const size_t run = sizeof plain - at < 254 ? sizeof plain - at : 254;
        coded[0] = (uint8_t)(run + 1);
        memcpy(coded + 1, plain + at, run);
        TEST_ASSERT_NULL(memchr(coded, 0, run + 1));
        TEST_ASSERT_FALSE(stop_listener_hear(&listener, coded, run + 1));
        for (size_t i = 0; i <= run; i++) {
            decoded = frame_decoder_push(&decoder, coded[i], &out) || decoded;
        }
        at += run;
    }
    TEST_ASSERT_FALSE(stop_listener_hear(&listener, (const uint8_t *)"\0", 1));
    TEST_ASSERT_FALSE(frame_decoder_push(&decoder, 0, &out) || decoded);
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
            TEST_ASSERT_EQUAL(id == PROTO_ID_STOP, stop_listener_hear(&listener, coded, length));
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

static void it_hears_what_the_decoder_of_frames_takes_for_a_stop(void)
{
    static struct frame_decoder decoder;
    static uint8_t bytes[4 * FRAME_MAX_CODED];
    static uint8_t payload[600];
    unsigned stops = 0;
    random_seed(5);
    for (int round = 0; round < 20000; round++) {
        /* A frame of any kind, whole or damaged, after some noise. */
        size_t count = random_below(12);
        for (size_t i = 0; i < count; i++) {
            bytes[i] = random_below(4) == 0 ? 0 : (uint8_t)random_u32();
        }
        const size_t length = random_below(8) == 0 ? random_below(sizeof payload) : random_below(12);
        for (size_t i = 0; i < length; i++) {
            payload[i] = random_below(6) == 0 ? 0 : (uint8_t)random_u32();
        }
        const uint8_t id = random_below(3) == 0 ? (uint8_t)random_u32() : (uint8_t)PROTO_ID_STOP;
        const size_t size =
            frame_encode(id, (uint16_t)round, payload, length, bytes + count, sizeof bytes - count);
        if (random_below(3) == 0) {
            const size_t at = count + random_below((uint32_t)size);
            bytes[at] = random_below(2) == 0 ? (uint8_t)0 : (uint8_t)random_u32();
        }
        count += size;
        bool decoded = false;
        bool heard = false;
        for (size_t i = 0; i < count;) {
            size_t piece = 1u + random_below(40);
            piece = piece < count - i ? piece : count - i;
            heard = stop_listener_hear(&listener, bytes + i, piece) || heard;
            for (size_t k = 0; k < piece; k++) {
                struct frame out;
                if (frame_decoder_push(&decoder, bytes[i + k], &out)) {
                    decoded = decoded || out.id == PROTO_ID_STOP;
                }
            }
            i += piece;
        }
        TEST_ASSERT_EQUAL(decoded, heard);
        stops += heard ? 1u : 0u;
    }
    TEST_ASSERT_GREATER_THAN_UINT(2000, stops);
}

static struct hal_can_frame can_frame(uint16_t id, uint8_t length, const uint8_t *data)
{
    struct hal_can_frame frame = {.id = id, .length = length};
    memcpy(frame.data, data, length);
    return frame;
}

static void can_stop_is_heard_by_its_first_frame(void)
{
    enum { NODE = PROTO_CAN_HOST_TO_BOARD + 5 };
    uint8_t coded[32];
    uint8_t plain[16];
    struct frame_decoder decoder = {0};
    struct frame out;
    for (uint8_t payload = 0; payload < 6; payload++) {
        const size_t size = coded_frame(PROTO_ID_STOP, 7, payload, coded);
        for (size_t i = 0; i < size; i++) {
            (void)frame_decoder_push(&decoder, coded[i], &out);
            memcpy(plain, decoder.plain, sizeof plain);
        }
        const uint8_t length = (uint8_t)(payload + 7u);
        uint8_t data[8] = {length};
        if (payload == 0) {
            memcpy(data + 1, plain, 7);
        } else {
            data[0] = 0x10;
            data[1] = length;
            memcpy(data + 2, plain, 6);
        }
        struct hal_can_frame frame = can_frame(NODE, 8, data);
        TEST_ASSERT_TRUE(stop_listener_is_stop(&frame));
        frame.data[payload == 0 ? 1 : 2] ^= 1u; /* another request */
        TEST_ASSERT_FALSE(stop_listener_is_stop(&frame));
    }
    /* No first frame: too short, too long for a frame, of a length that has to be a single frame. */
    struct hal_can_frame frame = can_frame(NODE, 7, (const uint8_t[]){0x10, 20, PROTO_ID_STOP, 1, 0, 0, 0});
    TEST_ASSERT_FALSE(stop_listener_is_stop(&frame));
    frame = can_frame(NODE, 8, (const uint8_t[]){0x1F, 0xFF, PROTO_ID_STOP, 1, 0, 0, 0, 0});
    TEST_ASSERT_FALSE(stop_listener_is_stop(&frame));
    frame = can_frame(NODE, 8, (const uint8_t[]){0x10, 7, PROTO_ID_STOP, 1, 0, 0, 0, 0});
    TEST_ASSERT_FALSE(stop_listener_is_stop(&frame));
    /* A single frame with a wrong CRC, or longer than its CAN frame. */
    frame = can_frame(NODE, 8, (const uint8_t[]){7, PROTO_ID_STOP, 1, 0, 0, 0, 0, 0});
    TEST_ASSERT_FALSE(stop_listener_is_stop(&frame));
    frame = can_frame(NODE, 4, (const uint8_t[]){7, PROTO_ID_STOP, 1, 0});
    TEST_ASSERT_FALSE(stop_listener_is_stop(&frame));
    frame = can_frame(PROTO_CAN_HOST_TO_BOARD, 3, (const uint8_t[]){PROTO_ID_STOP, 1, 2});
    TEST_ASSERT_TRUE(stop_listener_is_stop(&frame));
    frame = can_frame(PROTO_CAN_HOST_TO_BOARD, 0, (const uint8_t[]){PROTO_ID_STOP});
    TEST_ASSERT_FALSE(stop_listener_is_stop(&frame));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(stop_is_heard_at_its_last_byte_in_any_two_pieces);
    RUN_TEST(stop_of_any_length_is_heard_until_it_is_longer_than_a_frame);
    RUN_TEST(stop_is_heard_wherever_it_lies_between_other_bytes);
    RUN_TEST(second_stop_after_a_first_counts_as_heard_once);
    RUN_TEST(other_frames_are_no_stop);
    RUN_TEST(damaged_stop_is_none);
    RUN_TEST(stop_that_ends_a_longer_frame_is_none);
    RUN_TEST(it_hears_what_the_decoder_of_frames_takes_for_a_stop);
    RUN_TEST(can_stop_is_heard_by_its_first_frame);
    return UNITY_END();
}
