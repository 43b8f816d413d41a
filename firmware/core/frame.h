/* Frames on a byte stream: COBS stuffing, a CRC-32, resynchronisation at the next zero byte. */
#ifndef FRAME_H
#define FRAME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "proto.h"

enum {
    FRAME_HEADER_SIZE = 3, /* id u8, sequence u16 */
    FRAME_CRC_SIZE = 4,
    FRAME_MAX_PLAIN = FRAME_HEADER_SIZE + (int)PROTO_MAX_PAYLOAD + FRAME_CRC_SIZE,
    /* One code byte per started run of 254, and the closing zero. */
    FRAME_MAX_CODED = FRAME_MAX_PLAIN + FRAME_MAX_PLAIN / 254 + 2,
};

/* A frame that arrived whole; `payload` points into the decoder and lives until its next byte. */
struct frame {
    uint8_t id;
    uint16_t sequence;
    uint32_t crc;
    const uint8_t *payload;
    size_t payload_length;
};

/* Unstuffs one byte at a time. All zero is the state at the start of a stream. */
struct frame_decoder {
    uint8_t plain[FRAME_MAX_PLAIN];
    uint16_t length;  /* bytes of plain[] that are filled */
    uint8_t left;     /* data bytes that follow before the next code byte */
    bool zero_owed;   /* the run that ends now stands for a zero, unless the frame ends here */
    bool broken;      /* this frame is invalid */
    bool started;     /* a byte came since the last zero */
    uint32_t dropped; /* damaged frames since the start */
};

/* Takes one byte; true when it completed a valid frame, which is then in *out. */
bool frame_decoder_push(struct frame_decoder *decoder, uint8_t byte, struct frame *out);

/* The frame in plain bytes that arrived as a whole; false when they are none. `out` points into them. */
bool frame_open(const uint8_t *plain, size_t length, struct frame *out);

/* Writes a coded frame with its closing zero; returns its size, 0 when it does not fit into `capacity`. */
size_t frame_encode(uint8_t id, uint16_t sequence, const uint8_t *payload, size_t payload_length,
                    uint8_t *out, size_t capacity);

#endif
