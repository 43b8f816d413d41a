/* A decoder of log blocks, written from SPEC.md alone: the tests' second opinion on the core's coder. */
#ifndef LOG_DECODER_H
#define LOG_DECODER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "proto.h"

struct log_decoder {
    const uint8_t *at;
    const uint8_t *end;
    uint32_t last[16];
    uint32_t one_before[16];
};

static inline void log_decoder_start(struct log_decoder *decoder, const uint8_t *from, size_t length)
{
    memset(decoder, 0, sizeof *decoder);
    decoder->at = from;
    decoder->end = from + length;
}

/* The next record's words; false at the end of the bytes, or when they are no record. */
static inline bool log_decoder_next(struct log_decoder *decoder, uint32_t words[16])
{
    if (decoder->end - decoder->at < 2) {
        return false;
    }
    const unsigned mask = (unsigned)decoder->at[0] | ((unsigned)decoder->at[1] << 8);
    decoder->at += 2;
    for (unsigned field = 0; field < 16; field++) {
        const bool line = field == 0 || field == 8 || field == 9 || (field >= 12 && field <= 14);
        uint32_t value = decoder->last[field];
        if (line) {
            value = decoder->last[field] * 2 - decoder->one_before[field];
        }
        if (mask & (1u << field)) {
            uint64_t coded = 0;
            unsigned shift = 0;
            for (;;) {
                if (decoder->at == decoder->end || shift > 28) {
                    return false;
                }
                const uint8_t byte = *decoder->at++;
                coded |= (uint64_t)(byte & 0x7F) << shift;
                shift += 7;
                if (byte < 0x80) {
                    break;
                }
            }
            const int64_t difference = (coded & 1) ? -(int64_t)(coded / 2) - 1 : (int64_t)(coded / 2);
            value += (uint32_t)difference;
        }
        words[field] = value;
    }
    memcpy(decoder->one_before, decoder->last, sizeof decoder->last);
    memcpy(decoder->last, words, sizeof decoder->last);
    return true;
}

/* Decodes one sealed block into `out`; returns the number of records, or -1 when the block is not sound. */
static inline int log_decoder_block(const uint8_t *block, uint32_t block_number, uint16_t log_id,
                                    struct proto_log_record *out, int capacity)
{
    struct proto_log_header header;
    struct log_decoder decoder;
    uint32_t words[16];
    int count = 0;
    if (!proto_log_header_decode(&header, block, PROTO_LOG_HEADER_SIZE) ||
        header.block_number != block_number || header.log_id != log_id || header.version != 1 ||
        header.used > PROTO_LOG_BLOCK_SIZE || header.used < PROTO_LOG_HEADER_SIZE) {
        return -1;
    }
    for (unsigned i = header.used; i < PROTO_LOG_BLOCK_SIZE; i++) {
        if (block[i] != 0) {
            return -1;
        }
    }
    log_decoder_start(&decoder, block + PROTO_LOG_HEADER_SIZE, (size_t)header.used - PROTO_LOG_HEADER_SIZE);
    while (count < capacity && log_decoder_next(&decoder, words)) {
        proto_log_record_from_words(&out[count], words);
        count++;
    }
    return decoder.at == decoder.end && count == header.records ? count : -1;
}

#endif
