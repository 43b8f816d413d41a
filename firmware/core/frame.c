/* Frames on a byte stream: COBS stuffing, a CRC-32, resynchronisation at the next zero byte. */
#include "frame.h"

#include "crc32.h"

enum { COBS_LONGEST_CODE = 0xFF }; /* 254 data bytes and no zero after them */

static uint32_t load_u32(const uint8_t *in)
{
    return (uint32_t)in[0] | ((uint32_t)in[1] << 8) | ((uint32_t)in[2] << 16) | ((uint32_t)in[3] << 24);
}

static void store_plain(struct frame_decoder *decoder, uint8_t byte)
{
    if (decoder->length < FRAME_MAX_PLAIN) {
        decoder->plain[decoder->length] = byte;
        decoder->length++;
    } else {
        decoder->broken = true;
    }
}

bool frame_open(const uint8_t *plain, size_t length, struct frame *out)
{
    if (length < FRAME_HEADER_SIZE + FRAME_CRC_SIZE) {
        return false;
    }
    const size_t covered = length - FRAME_CRC_SIZE;
    const uint32_t crc = load_u32(plain + covered);
    if (crc32_update(0, plain, covered) != crc) {
        return false;
    }
    out->id = plain[0];
    out->sequence = (uint16_t)(plain[1] | (uint16_t)(plain[2] << 8));
    out->crc = crc;
    out->payload = plain + FRAME_HEADER_SIZE;
    out->payload_length = covered - FRAME_HEADER_SIZE;
    return true;
}

/* At a zero byte: checks whether the bytes before it are a valid frame. */
static bool finish_frame(const struct frame_decoder *decoder, struct frame *out)
{
    return !decoder->broken && decoder->left == 0 && frame_open(decoder->plain, decoder->length, out);
}

bool frame_decoder_push(struct frame_decoder *decoder, uint8_t byte, struct frame *out)
{
    if (byte == 0) {
        const bool started = decoder->started;
        const bool sound = started && finish_frame(decoder, out);
        if (started && !sound) {
            decoder->dropped++;
        }
        decoder->length = 0;
        decoder->left = 0;
        decoder->zero_owed = false;
        decoder->broken = false;
        decoder->started = false;
        return sound;
    }
    decoder->started = true;
    if (decoder->left > 0) {
        store_plain(decoder, byte);
        decoder->left--;
    } else {
        if (decoder->zero_owed) {
            store_plain(decoder, 0);
        }
        decoder->left = (uint8_t)(byte - 1u);
        decoder->zero_owed = byte != COBS_LONGEST_CODE;
    }
    return false;
}

/* Stuffs byte by byte into a buffer that holds the worst case, so that a frame needs no plain copy first. */
struct cobs_writer {
    uint8_t *out;
    size_t length;
    size_t code_at; /* where the run that grows now keeps its code byte */
    uint8_t code;
};

static void close_run(struct cobs_writer *writer)
{
    writer->out[writer->code_at] = writer->code;
    writer->code_at = writer->length;
    writer->length++;
    writer->code = 1;
}

static void put_stuffed(struct cobs_writer *writer, const uint8_t *data, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        /* A full run is closed by the byte after it, so that a frame that ends on it needs no empty run. */
        if (writer->code == COBS_LONGEST_CODE) {
            close_run(writer);
        }
        if (data[i] == 0) {
            close_run(writer);
        } else {
            writer->out[writer->length] = data[i];
            writer->length++;
            writer->code++;
        }
    }
}

size_t frame_encode(uint8_t id, uint16_t sequence, const uint8_t *payload, size_t payload_length,
                    uint8_t *out, size_t capacity)
{
    const size_t plain = FRAME_HEADER_SIZE + payload_length + FRAME_CRC_SIZE;
    if (payload_length > PROTO_MAX_PAYLOAD || capacity < plain + plain / 254 + 2) {
        return 0;
    }
    const uint8_t header[FRAME_HEADER_SIZE] = {id, (uint8_t)(sequence & 0xFFu), (uint8_t)(sequence >> 8)};
    const uint32_t crc = crc32_update(crc32_update(0, header, sizeof header), payload, payload_length);
    const uint8_t trailer[FRAME_CRC_SIZE] = {(uint8_t)(crc & 0xFFu), (uint8_t)((crc >> 8) & 0xFFu),
                                             (uint8_t)((crc >> 16) & 0xFFu), (uint8_t)(crc >> 24)};
    struct cobs_writer writer = {.out = out, .length = 1, .code_at = 0, .code = 1};
    put_stuffed(&writer, header, sizeof header);
    put_stuffed(&writer, payload, payload_length);
    put_stuffed(&writer, trailer, sizeof trailer);
    out[writer.code_at] = writer.code;
    out[writer.length] = 0;
    return writer.length + 1;
}
