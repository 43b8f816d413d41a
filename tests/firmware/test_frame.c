/* Frames are received whole, and nothing else is accepted as a frame. */
#include <string.h>

#include "crc32.h"
#include "frame.h"
#include "random.h"
#include "unity.h"
#include "vectors/vectors.h"

static struct frame_decoder decoder;

void setUp(void)
{
    memset(&decoder, 0, sizeof decoder);
}

void tearDown(void)
{
}

/* Feeds bytes; returns how many frames came out. The last one is in *frame. */
static int feed(const uint8_t *bytes, size_t length, struct frame *frame)
{
    int count = 0;
    for (size_t i = 0; i < length; i++) {
        count += frame_decoder_push(&decoder, bytes[i], frame) ? 1 : 0;
    }
    return count;
}

static void crc32_is_that_of_zlib(void)
{
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926, crc32_update(0, (const uint8_t *)"123456789", 9));
    const uint32_t first = crc32_update(0, (const uint8_t *)"1234", 4);
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926, crc32_update(first, (const uint8_t *)"56789", 5));
}

static void board_and_host_agree_on_every_shared_frame(void)
{
    static uint8_t coded[FRAME_MAX_CODED];
    for (size_t i = 0; i < sizeof message_vectors / sizeof message_vectors[0]; i++) {
        const struct message_vector *const v = &message_vectors[i];
        struct frame frame = {0};
        const size_t size =
            frame_encode(v->id, v->sequence, v->payload, v->payload_length, coded, sizeof coded);
        TEST_ASSERT_EQUAL_MESSAGE(v->frame_length, size, v->name);
        TEST_ASSERT_EQUAL_UINT8_ARRAY_MESSAGE(v->frame, coded, size, v->name);
        TEST_ASSERT_EQUAL_MESSAGE(1, feed(v->frame, v->frame_length, &frame), v->name);
        TEST_ASSERT_EQUAL_MESSAGE(v->id, frame.id, v->name);
        TEST_ASSERT_EQUAL_MESSAGE(v->sequence, frame.sequence, v->name);
        TEST_ASSERT_EQUAL_MESSAGE(v->payload_length, frame.payload_length, v->name);
        if (v->payload_length > 0) {
            TEST_ASSERT_EQUAL_UINT8_ARRAY_MESSAGE(v->payload, frame.payload, v->payload_length, v->name);
        }
    }
}

static void frames_of_every_length_come_back(void)
{
    static uint8_t payload[PROTO_MAX_PAYLOAD];
    static uint8_t coded[FRAME_MAX_CODED];
    struct frame frame;
    random_seed(1);
    for (size_t length = 0; length <= PROTO_MAX_PAYLOAD; length++) {
        /* Payloads with many zeros and with none: both extremes of stuffing. */
        const uint32_t zero_in = 1 + random_below(600);
        for (size_t i = 0; i < length; i++) {
            payload[i] = random_below(zero_in) == 0 ? 0 : (uint8_t)(1 + random_below(255));
        }
        const size_t size = frame_encode(0x31, (uint16_t)length, payload, length, coded, sizeof coded);
        TEST_ASSERT_TRUE(size > length);
        TEST_ASSERT_EQUAL_PTR(coded + size - 1, memchr(coded, 0, sizeof coded));
        TEST_ASSERT_EQUAL(1, feed(coded, size, &frame));
        TEST_ASSERT_EQUAL(length, frame.payload_length);
        TEST_ASSERT_EQUAL(0, length > 0 ? memcmp(payload, frame.payload, length) : 0);
    }
    TEST_ASSERT_EQUAL_UINT32(0, decoder.dropped);
}

static void payload_beyond_the_limit_is_not_framed(void)
{
    static uint8_t payload[PROTO_MAX_PAYLOAD + 1];
    static uint8_t coded[2 * FRAME_MAX_CODED];
    TEST_ASSERT_EQUAL(0, frame_encode(1, 1, payload, sizeof payload, coded, sizeof coded));
    TEST_ASSERT_EQUAL(0, frame_encode(1, 1, payload, 100, coded, 100));
}

static void every_single_bit_error_is_caught(void)
{
    static uint8_t coded[64];
    const uint8_t payload[] = {0, 1, 2, 0, 0, 255, 128, 7};
    struct frame frame;
    const size_t size = frame_encode(0x40, 77, payload, sizeof payload, coded, sizeof coded);
    for (size_t bit = 0; bit < 8 * (size - 1); bit++) {
        coded[bit / 8] ^= (uint8_t)(1u << (bit % 8));
        TEST_ASSERT_EQUAL(0, feed(coded, size, &frame));
        coded[bit / 8] ^= (uint8_t)(1u << (bit % 8));
        TEST_ASSERT_EQUAL(1, feed(coded, size, &frame)); /* in step again at once */
    }
    TEST_ASSERT_TRUE(decoder.dropped >= 8 * (size - 1));
}

static void frame_after_noise_arrives_once_a_zero_has_passed(void)
{
    static uint8_t coded[64];
    struct frame frame;
    const size_t size = frame_encode(0x02, 5, NULL, 0, coded, sizeof coded);
    const uint8_t noise[] = {0x55, 0xAA, 0x13, 0x37, 0x00};
    TEST_ASSERT_EQUAL(0, feed(noise, sizeof noise, &frame));
    TEST_ASSERT_EQUAL_UINT32(1, decoder.dropped);
    TEST_ASSERT_EQUAL(1, feed(coded, size, &frame));
}

static void empty_frames_between_frames_are_no_damage(void)
{
    const uint8_t zeros[10] = {0};
    struct frame frame;
    TEST_ASSERT_EQUAL(0, feed(zeros, sizeof zeros, &frame));
    TEST_ASSERT_EQUAL_UINT32(0, decoder.dropped);
}

static void oversize_frame_is_dropped_and_counted_once(void)
{
    static uint8_t coded[64];
    const uint8_t zero = 0;
    struct frame frame;
    for (int i = 0; i < 100000; i++) {
        const uint8_t byte = 0xFF;
        TEST_ASSERT_FALSE(frame_decoder_push(&decoder, byte, &frame));
    }
    TEST_ASSERT_EQUAL(0, feed(&zero, 1, &frame));
    TEST_ASSERT_EQUAL_UINT32(1, decoder.dropped);
    const size_t size = frame_encode(0x02, 5, NULL, 0, coded, sizeof coded);
    TEST_ASSERT_EQUAL(1, feed(coded, size, &frame));
}

static void truncated_frame_is_dropped(void)
{
    static uint8_t coded[64];
    const uint8_t payload[] = {1, 2, 3, 4, 5, 6, 7, 8};
    const uint8_t zero = 0;
    struct frame frame;
    const size_t size = frame_encode(0x40, 1, payload, sizeof payload, coded, sizeof coded);
    for (size_t kept = 1; kept < size - 1; kept++) {
        TEST_ASSERT_EQUAL(0, feed(coded, kept, &frame));
        TEST_ASSERT_EQUAL(0, feed(&zero, 1, &frame));
    }
    TEST_ASSERT_EQUAL_UINT32(size - 2, decoder.dropped);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(crc32_is_that_of_zlib);
    RUN_TEST(board_and_host_agree_on_every_shared_frame);
    RUN_TEST(frames_of_every_length_come_back);
    RUN_TEST(payload_beyond_the_limit_is_not_framed);
    RUN_TEST(every_single_bit_error_is_caught);
    RUN_TEST(frame_after_noise_arrives_once_a_zero_has_passed);
    RUN_TEST(empty_frames_between_frames_are_no_damage);
    RUN_TEST(oversize_frame_is_dropped_and_counted_once);
    RUN_TEST(truncated_frame_is_dropped);
    return UNITY_END();
}
