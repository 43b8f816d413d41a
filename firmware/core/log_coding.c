/* Lossless coding of log records: a mask of what differs from its prediction, and varints. */
#include "log_coding.h"

#include <string.h>

/* Small differences of either sign become small numbers: 0, -1, 1, -2 become 0, 1, 2, 3. */
static uint32_t zigzag(uint32_t difference)
{
    return (difference << 1) ^ (difference >> 31 ? 0xFFFFFFFFu : 0u);
}

static size_t put_varint(uint8_t *out, uint32_t value)
{
    size_t size = 0;
    while (value >= 0x80u) {
        out[size] = (uint8_t)(value & 0x7Fu) | 0x80u;
        value >>= 7;
        size++;
    }
    out[size] = (uint8_t)value;
    return size + 1;
}

size_t log_coder_encode(const struct log_coder *coder, const uint32_t words[PROTO_LOG_FIELD_COUNT],
                        uint8_t out[LOG_CODING_MAX_SIZE])
{
    uint32_t mask = 0;
    size_t size = 2;
    for (uint32_t field = 0; field < PROTO_LOG_FIELD_COUNT; field++) {
        const uint32_t last = coder->last[field];
        const bool line = ((PROTO_LOG_LINE_MASK >> field) & 1u) != 0;
        const uint32_t prediction = line ? 2u * last - coder->one_before[field] : last;
        if (words[field] != prediction) {
            mask |= 1u << field;
            size += put_varint(out + size, zigzag(words[field] - prediction));
        }
    }
    out[0] = (uint8_t)(mask & 0xFFu);
    out[1] = (uint8_t)(mask >> 8);
    return size;
}

void log_coder_accept(struct log_coder *coder, const uint32_t words[PROTO_LOG_FIELD_COUNT])
{
    memcpy(coder->one_before, coder->last, sizeof coder->last);
    memcpy(coder->last, words, sizeof coder->last);
}
