/* A decoder of log blocks, written from SPEC.md alone: an independent check of the core's coder. */
#ifndef LOG_DECODER_H
#define LOG_DECODER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "crc32.h"
#include "proto.h"

struct decoder_bit {
    int64_t one, seen;
};

struct decoder_number {
    struct decoder_bit zero[6], sign, more[12], top[12];
};

struct decoder_series {
    int64_t last, before, smooth, residual, errors[4];
};

enum decoder_kind {
    D_TIME,
    D_MODE,
    D_SEGMENT,
    D_FAULTS,
    D_COMMAND,
    D_TRAVEL,
    D_SET,
    D_HELD,
    D_SPEED,
    D_HEADING,
    D_POSITION,
    D_BATTERY,
    D_KINDS
};

struct log_decoder {
    const uint8_t *at, *end;
    uint64_t range, code;
    struct decoder_number numbers[D_KINDS];
    struct decoder_bit changed, differs;
    struct decoder_series travel[2], effort[2], battery;
    int64_t axes[2], turned;
    int64_t mantissa, exponent, turn, max_counts;
    uint64_t record, rate;
    int64_t before[16];
};

static inline int64_t decoder_float(float value, int64_t *exponent)
{
    uint32_t bits;
    memcpy(&bits, &value, 4);
    *exponent = (int64_t)(bits >> 23) - 150;
    return (bits & 0x7FFFFF) | 0x800000;
}

static inline void decoder_halves(struct decoder_bit *bits, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        bits[i] = (struct decoder_bit){32768, 0};
    }
}

static inline uint64_t decoder_byte(struct log_decoder *d)
{
    return d->at < d->end ? *d->at++ : 0;
}

static inline void log_decoder_start(struct log_decoder *d, float metres_per_count, float turns_per_count,
                                     uint32_t rate_hz, uint32_t first_record, const uint8_t *from,
                                     size_t length)
{
    memset(d, 0, sizeof *d);
    decoder_halves((struct decoder_bit *)d->numbers, sizeof d->numbers / (sizeof(struct decoder_bit)));
    decoder_halves(&d->changed, 1);
    decoder_halves(&d->differs, 1);
    d->at = from;
    d->end = from + length;
    d->range = 0xFFFFFFFF;
    for (int i = 0; i < 4; i++) {
        d->code = d->code << 8 | decoder_byte(d);
    }
    int64_t exponent;
    d->mantissa = decoder_float(metres_per_count, &d->exponent);
    d->turn = decoder_float(turns_per_count, &exponent);
    exponent += 40;
    d->turn = exponent > 23 ? INT64_C(1) << 47 : exponent >= 0 ? d->turn << exponent : d->turn >> -exponent;
    d->max_counts = d->turn > 0 ? (INT64_C(1) << 62) / d->turn : 0;
    d->record = first_record;
    d->rate = rate_hz > 0 ? rate_hz : 1;
}

static inline void decoder_narrow(struct log_decoder *d, uint64_t bound, bool bit)
{
    if (bit) {
        d->range = bound;
    } else {
        d->code -= bound;
        d->range -= bound;
    }
    while (d->range < 0x1000000) {
        d->range <<= 8;
        d->code = d->code << 8 | decoder_byte(d);
    }
}

static inline bool decoder_read(struct log_decoder *d, struct decoder_bit *model)
{
    const uint64_t bound = (d->range >> 16) * (uint64_t)model->one;
    const bool bit = d->code < bound;
    const int64_t rate = 655360 / (10 * model->seen + 16);
    decoder_narrow(d, bound, bit);
    model->one += bit ? ((65536 - model->one) * rate) >> 16 : -((model->one * rate) >> 16);
    model->one = model->one < 64 ? 64 : model->one > 65472 ? 65472 : model->one;
    model->seen += model->seen < 30;
    return bit;
}

static inline int64_t decoder_plain(struct log_decoder *d, int64_t count)
{
    int64_t value = 0;
    for (; count > 0; count--) {
        const uint64_t bound = d->range >> 1;
        const bool bit = d->code < bound;
        decoder_narrow(d, bound, bit);
        value = value * 2 + bit;
    }
    return value;
}

static inline int64_t decoder_number(struct log_decoder *d, enum decoder_kind kind, int64_t context)
{
    struct decoder_number *const n = &d->numbers[kind];
    if (!decoder_read(d, &n->zero[context])) {
        return 0;
    }
    const bool negative = decoder_read(d, &n->sign);
    int64_t length = 0;
    while (length < 12 && decoder_read(d, &n->more[length])) {
        length++;
    }
    int64_t size = 1;
    if (length == 12) {
        length = decoder_plain(d, 5);
        size = (INT64_C(1) << length) + decoder_plain(d, length);
    } else if (length > 0) {
        size = 2 + decoder_read(d, &n->top[length]);
        size = (size << (length - 1)) + decoder_plain(d, length - 1);
    }
    return negative ? -size : size;
}

static inline int64_t decoder_clamp(int64_t value, int64_t limit)
{
    return value > limit ? limit : value < -limit ? -limit : value;
}

static inline void decoder_predictions(const struct decoder_series *s, int64_t out[4])
{
    const int64_t step = s->last - s->before;
    out[0] = s->last;
    out[1] = s->last + (step >> 1);
    out[2] = s->last + step;
    out[3] = (s->smooth + 32) >> 6;
}

static inline void decoder_update(struct decoder_series *s, int64_t value, int64_t residual)
{
    int64_t predictions[4];
    decoder_predictions(s, predictions);
    value = decoder_clamp(value, 1 << 23);
    for (int i = 0; i < 4; i++) {
        const int64_t off = llabs(value - predictions[i]);
        s->errors[i] += 4 * (off < 1 << 20 ? off : 1 << 20) - (s->errors[i] >> 2);
    }
    s->smooth += (value * 64 - s->smooth) >> 2;
    s->before = s->last;
    s->last = value;
    s->residual = residual;
}

static inline int32_t decoder_wrap(int64_t value)
{
    return (int32_t)(uint32_t)(uint64_t)value;
}

static inline int32_t decoder_predicted(struct log_decoder *d, enum decoder_kind kind,
                                        struct decoder_series *s, bool driven)
{
    int64_t predictions[4];
    int best = 0;
    decoder_predictions(s, predictions);
    for (int i = 1; i < 4; i++) {
        best = s->errors[i] < s->errors[best] ? i : best;
    }
    const int64_t size = llabs(s->residual);
    const int64_t known = size < 2 ? size : size < 4 ? 2 : 3;
    const int64_t residual = decoder_number(d, kind, s->last == 0 && s->before == 0 ? 4 + driven : known);
    const int32_t value = decoder_wrap(predictions[best] + residual);
    decoder_update(s, value, residual);
    return value;
}

static inline int64_t decoder_divide(int64_t numerator, int64_t divisor)
{
    const int64_t size = (llabs(numerator) + divisor / 2) / divisor;
    return numerator < 0 ? -size : size;
}

static inline int64_t decoder_speed(const struct log_decoder *d, int64_t counts, uint32_t interval)
{
    const int64_t shift = -(d->exponent + 14);
    if (interval == 0 || interval > 65535 || shift < 0 || shift > 39) {
        return 0;
    }
    const int64_t speed = decoder_divide(counts * (d->mantissa * 1000000 >> 14), (int64_t)interval << shift);
    return speed > 32767 ? 32767 : speed < -32768 ? -32768 : speed;
}

static inline int64_t decoder_heading(const struct log_decoder *d, int32_t difference)
{
    return llabs((int64_t)difference) <= d->max_counts ? difference * d->turn : 0;
}

static inline int32_t decoder_heading_e4(int64_t q40)
{
    const int64_t e4 =
        decoder_divide(decoder_clamp(q40 >> 20, INT64_C(1) << 36) * 62831853, INT64_C(1000) << 20);
    return (int32_t)(e4 > INT32_MAX ? INT32_MAX : e4 < INT32_MIN ? INT32_MIN : e4);
}

static inline int64_t decoder_sine(uint32_t phase)
{
    const uint32_t quadrant = (phase + 0x20000000) >> 30;
    const int64_t x = ((int64_t)(int32_t)(phase - (quadrant << 30)) * 1686629713) >> 30;
    const int64_t z = x * x >> 30;
    int64_t value;
    if (quadrant & 1) {
        value = 44739243 + (z * -1491308 >> 30);
        value = -536870912 + (z * value >> 30);
        value = ((1 << 30) + (z * value >> 30)) >> 6;
    } else {
        value = 8947849 + (z * -213044 >> 30);
        value = -178956971 + (z * value >> 30);
        value = z * value >> 30;
        value = (x + (x * value >> 30)) >> 6;
    }
    return quadrant & 2 ? -value : value;
}

static inline int32_t decoder_position(struct log_decoder *d, int axis, int64_t way, bool still)
{
    int64_t at = decoder_clamp(d->axes[axis] + way, INT64_C(1) << 53);
    const int64_t thousand = (at >> 10) * 1000;
    const int64_t expected = (thousand + (1 << 21)) >> 22;
    const int64_t eighths = llabs(thousand - expected * (1 << 22)) >> 19;
    const int64_t residual = decoder_number(d, D_POSITION, still ? 0 : 1 + (eighths < 3 ? eighths : 3));
    const int32_t value = decoder_wrap(expected + residual);
    if (residual != 0) {
        const int64_t twice = 2 * (int64_t)value + (residual > 0 ? -1 : 1);
        at = decoder_clamp((twice * 1099511628 >> 9) + (residual > 0 ? 2048 : -2048), INT64_C(1) << 53);
    }
    d->axes[axis] = at;
    return value;
}

static inline void decoder_pose(struct log_decoder *d, int64_t row[16])
{
    const int64_t *const before = d->before;
    const int32_t left = decoder_wrap(row[8] - before[8]);
    const int32_t right = decoder_wrap(row[9] - before[9]);
    const uint32_t interval = (uint32_t)(row[0] - before[0]);
    const int64_t heading = decoder_heading(d, decoder_wrap(row[9] - row[8]));
    row[10] = decoder_speed(d, left, interval);
    row[11] = decoder_speed(d, right, interval);
    row[14] = decoder_wrap(decoder_heading_e4(heading) + d->turned);
    if (decoder_read(d, &d->differs)) {
        row[10] = decoder_wrap(row[10] + decoder_number(d, D_SPEED, 0));
        row[11] = decoder_wrap(row[11] + decoder_number(d, D_SPEED, 0));
        const int64_t residual = decoder_number(d, D_HEADING, 0);
        row[14] = decoder_wrap(row[14] + residual);
        d->turned = decoder_wrap(d->turned + residual);
    }
    const int64_t half = decoder_heading(d, decoder_wrap((int64_t)right - left)) >> 1;
    const uint32_t phase = (uint32_t)(uint64_t)((heading + d->turned * 17499069 - half) >> 8);
    const int64_t shift = d->exponent + 31;
    const int64_t limit = INT64_C(1) << 38;
    int64_t way = ((int64_t)left + right) * d->mantissa;
    way = shift > 0 ? decoder_clamp(way, limit) * (INT64_C(1) << (shift < 20 ? shift : 20))
                    : way >> (-shift < 62 ? -shift : 62);
    way = decoder_clamp(way, limit);
    const bool still = (int64_t)left + right == 0;
    row[12] = decoder_position(d, 0, way * decoder_sine(phase + 0x40000000) >> 24, still);
    row[13] = decoder_position(d, 1, way * decoder_sine(phase) >> 24, still);
}

/* The next record's words. */
static inline void log_decoder_next(struct log_decoder *d, uint32_t words[16])
{
    static const enum decoder_kind state[] = {D_MODE, D_SEGMENT, D_FAULTS, D_COMMAND, D_COMMAND};
    int64_t row[16];
    memcpy(row, d->before, sizeof row);
    row[0] = (uint32_t)((int64_t)(1000 * d->record / d->rate) + decoder_number(d, D_TIME, 0));
    if (decoder_read(d, &d->changed)) {
        for (int i = 0; i < 5; i++) {
            row[1 + i] = decoder_wrap(row[1 + i] + decoder_number(d, state[i], 0));
        }
    }
    for (int wheel = 0; wheel < 2; wheel++) {
        const int32_t moved = decoder_predicted(d, D_TRAVEL, &d->travel[wheel], row[4 + wheel] != 0);
        row[8 + wheel] = decoder_wrap(row[8 + wheel] + moved);
    }
    for (int wheel = 0; wheel < 2; wheel++) {
        const int64_t command = row[4 + wheel];
        if (row[1] == PROTO_MODE_VELOCITY) {
            row[6 + wheel] = decoder_predicted(d, D_HELD, &d->effort[wheel], command != 0);
        } else {
            const int64_t residual = decoder_number(d, D_SET, 0);
            row[6 + wheel] = decoder_wrap((row[1] == PROTO_MODE_EFFORT ? command : 0) + residual);
            decoder_update(&d->effort[wheel], row[6 + wheel], residual);
        }
    }
    decoder_pose(d, row);
    row[15] = decoder_predicted(d, D_BATTERY, &d->battery, false);
    d->record = (uint32_t)(d->record + 1);
    memcpy(d->before, row, sizeof row);
    for (int i = 0; i < 16; i++) {
        words[i] = (uint32_t)(uint64_t)row[i];
    }
}

/* Decodes one sealed block into `out`; returns the number of records, or -1 when the block is not sound. */
static inline int log_decoder_block(const uint8_t *block, uint32_t cell, uint16_t log_id,
                                    struct proto_log_record *out, int capacity)
{
    struct proto_log_header header;
    struct log_decoder decoder;
    uint32_t words[16];
    if (!proto_log_header_decode(&header, block, PROTO_LOG_HEADER_SIZE) || header.cell != cell ||
        header.log_id != log_id || header.version != 2 || header.used > PROTO_LOG_BLOCK_LIMIT ||
        header.used < PROTO_LOG_HEADER_SIZE || header.records > capacity) {
        return -1;
    }
    for (unsigned i = header.used; i % PROTO_LOG_CELL_SIZE != 0; i++) {
        if (block[i] != 0) {
            return -1;
        }
    }
    const uint8_t *const body = block + PROTO_LOG_HEADER_SIZE;
    const size_t length = (size_t)header.used - PROTO_LOG_HEADER_SIZE;
    if (crc32_update(crc32_update(0, block, PROTO_LOG_HEADER_SIZE - 4), body, length) != header.crc32) {
        return -1;
    }
    log_decoder_start(&decoder, header.metres_per_count, header.turns_per_count, header.rate_hz,
                      header.first_record, body, length);
    for (int i = 0; i < header.records; i++) {
        log_decoder_next(&decoder, words);
        proto_log_record_from_words(&out[i], words);
    }
    return header.records;
}

/* Bytes that the block takes in the ring. */
static inline uint32_t log_decoder_span(const uint8_t *block)
{
    const uint32_t used = block[6] + 256u * block[7];
    return (used + PROTO_LOG_CELL_SIZE - 1u) / PROTO_LOG_CELL_SIZE * PROTO_LOG_CELL_SIZE;
}

#endif
