/* For all inputs the frame decoder stays within its memory, and decoding inverts coding. */
#include <string.h>

#include "rig.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* A frame that is put together again decodes to itself. */
static void goes_round(uint8_t id, uint16_t sequence, const uint8_t *payload, size_t length)
{
    static uint8_t coded[FRAME_MAX_CODED];
    static struct frame_decoder decoder;
    struct frame again;
    const size_t coded_size = frame_encode(id, sequence, payload, length, coded, sizeof coded);
    RIG_REQUIRE(coded_size >= length + FRAME_HEADER_SIZE + FRAME_CRC_SIZE + 2);
    RIG_REQUIRE(memchr(coded, 0, coded_size) == coded + coded_size - 1);
    memset(&decoder, 0, sizeof decoder);
    for (size_t i = 0; i + 1 < coded_size; i++) {
        RIG_REQUIRE(!frame_decoder_push(&decoder, coded[i], &again));
    }
    RIG_REQUIRE(frame_decoder_push(&decoder, 0, &again));
    RIG_REQUIRE(again.id == id && again.sequence == sequence && again.payload_length == length);
    RIG_REQUIRE(length == 0 || memcmp(again.payload, payload, length) == 0);
    RIG_REQUIRE(decoder.dropped == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct frame_decoder decoder;
    struct frame frame;
    uint32_t ends = 0;
    uint32_t sound = 0;
    memset(&decoder, 0, sizeof decoder);
    for (size_t i = 0; i < size; i++) {
        ends += data[i] == 0;
        if (frame_decoder_push(&decoder, data[i], &frame)) {
            sound++;
            RIG_REQUIRE(frame.payload_length <= PROTO_MAX_PAYLOAD);
            goes_round(frame.id, frame.sequence, frame.payload, frame.payload_length);
        }
    }
    RIG_REQUIRE(sound + decoder.dropped <= ends);

    /* After one more zero the next frame is received, for all inputs before it. */
    (void)frame_decoder_push(&decoder, 0, &frame);
    static const uint8_t status[] = {0x02, 0x02, 0x01, 0x01, 0x05, 0x00}; /* cut short on purpose */
    const uint32_t dropped = decoder.dropped;
    for (size_t i = 0; i < sizeof status; i++) {
        RIG_REQUIRE(!frame_decoder_push(&decoder, status[i], &frame));
    }
    RIG_REQUIRE(decoder.dropped == dropped + 1);

    /* The input as a payload. */
    goes_round(size > 0 ? data[0] : 0, (uint16_t)size, data,
               size < PROTO_MAX_PAYLOAD ? size : PROTO_MAX_PAYLOAD);
    return 0;
}
