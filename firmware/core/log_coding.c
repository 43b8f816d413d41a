/* Lossless coding of log records: a prediction of each field, and the coded residual. */
#include "log_coding.h"

#include <string.h>

/* Places of the fields in a record's words. */
enum {
    WORD_TIME,
    WORD_MODE,
    WORD_SEGMENT,
    WORD_FAULTS,
    WORD_COMMAND,
    WORD_EFFORT = WORD_COMMAND + 2,
    WORD_COUNTS = WORD_EFFORT + 2,
    WORD_SPEED = WORD_COUNTS + 2,
    WORD_POSITION = WORD_SPEED + 2,
    WORD_HEADING = WORD_POSITION + 2,
    WORD_BATTERY,
};
_Static_assert(WORD_BATTERY + 1 == PROTO_LOG_FIELD_COUNT, "the schema's fields are these");

/* 2^40 turns / 62831.853, the other way round than log_replay_heading_e4. */
static const int64_t turn_q40_per_e4 = 17499069;

void log_coder_start(struct log_coder *coder, const struct log_format *format, uint32_t first_record,
                     uint8_t *out, size_t capacity)
{
    memset(coder, 0, sizeof *coder);
    range_coder_start(&coder->coder, out, capacity);
    log_replay_start(&coder->replay, &format->geometry);
    coder->rate_hz = format->rate_hz;
    coder->record = first_record;
}

/* Position of the highest bit that is set; `value` is not 0. */
static uint32_t top_bit(uint32_t value)
{
    uint32_t bit = 0;
    while ((value >> bit) > 1u) {
        bit++;
    }
    return bit;
}

/* The length as that many ones, then the bits below the highest; long numbers are rare and go as they are. */
static void code_size(struct range_coder *coder, struct log_number *number, uint32_t size)
{
    const uint32_t length = top_bit(size);
    const bool is_long = length >= (uint32_t)LOG_LENGTHS;
    const uint32_t ones = is_long ? (uint32_t)LOG_LENGTHS : length;
    for (uint32_t i = 0; i < ones; i++) {
        range_coder_bit(coder, &number->more[i], true);
    }
    if (is_long) {
        range_coder_plain(coder, length, 5);
        range_coder_plain(coder, size, length);
    } else {
        range_coder_bit(coder, &number->more[length], false);
        if (length > 0) {
            range_coder_bit(coder, &number->top[length], ((size >> (length - 1u)) & 1u) != 0);
            range_coder_plain(coder, size, length - 1u);
        }
    }
}

/* Codes how far a value lies from what was expected, modulo 2^32; returns that. */
static int32_t code_number(struct log_coder *coder, enum log_kind kind, uint32_t context, uint32_t value,
                           uint32_t expected)
{
    struct log_number *const number = &coder->numbers[kind];
    const uint32_t residual = value - expected;
    const bool negative = (residual >> 31) != 0;
    range_coder_bit(&coder->coder, &number->zero[context], residual != 0);
    if (residual != 0) {
        range_coder_bit(&coder->coder, &number->sign, negative);
        code_size(&coder->coder, number, negative ? 0u - residual : residual);
    }
    return (int32_t)residual;
}

static void code_predicted(struct log_coder *coder, enum log_kind kind, struct log_predictor *predictor,
                           bool driven, uint32_t value)
{
    const uint32_t context = log_predictor_context(predictor, driven);
    const int32_t residual =
        code_number(coder, kind, context, value, (uint32_t)log_predictor_next(predictor));
    log_predictor_update(predictor, (int32_t)value, residual);
}

/* Record k of a log stands at floor(1000 k / rate). */
static void code_time(struct log_coder *coder, uint32_t t_ms)
{
    const uint64_t rate = coder->rate_hz != 0 ? coder->rate_hz : 1u;
    (void)code_number(coder, LOG_KIND_TIME, 0, t_ms, (uint32_t)(UINT64_C(1000) * coder->record / rate));
}

/* Mode, segment, faults and command change seldom, and often together. */
static void code_state(struct log_coder *coder, const uint32_t words[PROTO_LOG_FIELD_COUNT])
{
    static const enum log_kind kinds[] = {LOG_KIND_MODE, LOG_KIND_SEGMENT, LOG_KIND_FAULTS, LOG_KIND_COMMAND,
                                          LOG_KIND_COMMAND};
    const bool changed =
        memcmp(&words[WORD_MODE], &coder->last[WORD_MODE], (WORD_EFFORT - WORD_MODE) * sizeof words[0]) != 0;
    range_coder_bit(&coder->coder, &coder->same, changed);
    if (changed) {
        for (uint32_t i = 0; i < (uint32_t)(WORD_EFFORT - WORD_MODE); i++) {
            (void)code_number(coder, kinds[i], 0, words[WORD_MODE + i], coder->last[WORD_MODE + i]);
        }
    }
}

static void code_effort(struct log_coder *coder, const uint32_t words[PROTO_LOG_FIELD_COUNT], uint32_t wheel)
{
    const uint32_t value = words[WORD_EFFORT + wheel];
    const uint32_t command = words[WORD_COMMAND + wheel];
    if (words[WORD_MODE] == (uint32_t)PROTO_MODE_VELOCITY) {
        code_predicted(coder, LOG_KIND_EFFORT_HELD, &coder->effort[wheel], command != 0, value);
    } else {
        const uint32_t known = words[WORD_MODE] == (uint32_t)PROTO_MODE_EFFORT ? command : 0u;
        const int32_t residual = code_number(coder, LOG_KIND_EFFORT_SET, 0, value, known);
        log_predictor_update(&coder->effort[wheel], (int32_t)value, residual);
    }
}

/* Speeds and heading follow from counts; one bit says so. */
static void code_replayed(struct log_coder *coder, const uint32_t words[PROTO_LOG_FIELD_COUNT],
                          const int32_t moved[2], int64_t heading_q40)
{
    const uint32_t interval_ms = words[WORD_TIME] - coder->last[WORD_TIME];
    const uint32_t left = (uint32_t)(int32_t)log_replay_speed(&coder->replay, moved[0], interval_ms);
    const uint32_t right = (uint32_t)(int32_t)log_replay_speed(&coder->replay, moved[1], interval_ms);
    const uint32_t heading = (uint32_t)log_replay_heading_e4(heading_q40) + (uint32_t)coder->turned_e4;
    const bool differs =
        words[WORD_SPEED] != left || words[WORD_SPEED + 1] != right || words[WORD_HEADING] != heading;
    range_coder_bit(&coder->coder, &coder->replayed, differs);
    if (differs) {
        (void)code_number(coder, LOG_KIND_SPEED, 0, words[WORD_SPEED], left);
        (void)code_number(coder, LOG_KIND_SPEED, 0, words[WORD_SPEED + 1], right);
        const int32_t residual = code_number(coder, LOG_KIND_HEADING, 0, words[WORD_HEADING], heading);
        coder->turned_e4 = (int32_t)((uint32_t)coder->turned_e4 + (uint32_t)residual);
    }
}

/* Odometry once more, with one step from record to record. */
static void code_position(struct log_coder *coder, const uint32_t words[PROTO_LOG_FIELD_COUNT],
                          const int32_t moved[2], int64_t heading_q40)
{
    const int64_t sum = (int64_t)moved[0] + moved[1];
    const int32_t difference = (int32_t)((uint32_t)moved[1] - (uint32_t)moved[0]);
    const int64_t middle_q40 = heading_q40 + coder->turned_e4 * turn_q40_per_e4 -
                               (log_replay_heading(&coder->replay, difference) >> 1);
    int64_t way_q32[2];
    log_replay_way(&coder->replay, sum, (uint32_t)(uint64_t)(middle_q40 >> 8), way_q32);
    for (uint32_t i = 0; i < 2u; i++) {
        struct log_axis *const axis = &coder->axes[i];
        log_axis_step(axis, way_q32[i]);
        const uint32_t context = sum == 0 ? 0u : log_axis_context(axis);
        const uint32_t value = words[WORD_POSITION + i];
        const int32_t residual =
            code_number(coder, LOG_KIND_POSITION, context, value, (uint32_t)log_axis_mm(axis));
        log_axis_correct(axis, (int32_t)value, residual);
    }
}

void log_coder_add(struct log_coder *coder, const struct proto_log_record *record)
{
    uint32_t words[PROTO_LOG_FIELD_COUNT];
    int32_t moved[2];
    proto_log_record_to_words(record, words);
    code_time(coder, words[WORD_TIME]);
    code_state(coder, words);
    for (uint32_t wheel = 0; wheel < 2u; wheel++) {
        const uint32_t travel = words[WORD_COUNTS + wheel] - coder->last[WORD_COUNTS + wheel];
        moved[wheel] = (int32_t)travel;
        code_predicted(coder, LOG_KIND_TRAVEL, &coder->travel[wheel], words[WORD_COMMAND + wheel] != 0,
                       travel);
    }
    for (uint32_t wheel = 0; wheel < 2u; wheel++) {
        code_effort(coder, words, wheel);
    }
    const uint32_t difference = words[WORD_COUNTS + 1] - words[WORD_COUNTS];
    const int64_t heading_q40 = log_replay_heading(&coder->replay, (int32_t)difference);
    code_replayed(coder, words, moved, heading_q40);
    code_position(coder, words, moved, heading_q40);
    code_predicted(coder, LOG_KIND_BATTERY, &coder->battery, false, words[WORD_BATTERY]);
    memcpy(coder->last, words, sizeof coder->last);
    coder->record++;
}

size_t log_coder_size(const struct log_coder *coder)
{
    return coder->coder.size;
}

size_t log_coder_finish(struct log_coder *coder)
{
    return range_coder_finish(&coder->coder);
}
