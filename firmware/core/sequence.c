/* The uploaded sequence: timed segments that the board runs by itself, to the millisecond. */
#include "sequence.h"

#include "crc32.h"
#include "rounding.h"

struct refusal sequence_begin(struct sequence *sequence, uint16_t segment_count, uint16_t log_rate_hz)
{
    if (segment_count == 0) {
        return refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    }
    if (segment_count > PROTO_MAX_SEGMENTS) {
        return refused(PROTO_REFUSAL_REASON_SEQUENCE_TOO_LONG, PROTO_MAX_SEGMENTS);
    }
    if (log_rate_hz > SEQUENCE_FASTEST_LOG_HZ) {
        return refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    }
    sequence->state = PROTO_SEQUENCE_STATE_RECEIVING;
    sequence->segment_count = segment_count;
    sequence->received = 0;
    sequence->log_rate_hz = log_rate_hz;
    sequence->crc = 0;
    sequence->duration_ms = 0;
    sequence->current = 0;
    sequence->elapsed_ms = 0;
    return accepted();
}

static struct refusal check_segment(const struct proto_segment *segment, const struct tuning *tuning,
                                    uint32_t index)
{
    struct wheel_command command;
    if (segment->kind >= PROTO_SEGMENT_KIND_COUNT) {
        return refused(PROTO_REFUSAL_REASON_UNKNOWN_SEGMENT_KIND, index);
    }
    if (segment->duration_ms == 0 || segment->duration_ms > SEQUENCE_LONGEST_SEGMENT_MS) {
        return refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, index);
    }
    struct refusal verdict = command_check(tuning, segment->kind, segment->a, segment->b, &command);
    verdict.detail = index;
    return verdict;
}

struct refusal sequence_append(struct sequence *sequence, const struct tuning *tuning, uint16_t first,
                               const uint8_t *packed, size_t count)
{
    if (sequence->state != PROTO_SEQUENCE_STATE_RECEIVING) {
        return refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, sequence->state);
    }
    if (first != sequence->received) {
        return refused(PROTO_REFUSAL_REASON_SEQUENCE_GAP, sequence->received);
    }
    if (count > (size_t)(sequence->segment_count - sequence->received)) {
        return refused(PROTO_REFUSAL_REASON_SEQUENCE_TOO_LONG, sequence->segment_count);
    }
    /* Slots from `received` on are free, so that a refusal half-way leaves the sequence unchanged. */
    uint32_t duration_ms = sequence->duration_ms;
    for (size_t i = 0; i < count; i++) {
        struct proto_segment *const slot = &sequence->segments[first + i];
        (void)proto_segment_decode(slot, packed + i * PROTO_SEGMENT_SIZE, PROTO_SEGMENT_SIZE);
        const struct refusal verdict = check_segment(slot, tuning, (uint32_t)(first + i));
        if (verdict.reason != REFUSAL_NONE) {
            return verdict;
        }
        duration_ms += slot->duration_ms;
    }
    sequence->received = (uint16_t)(sequence->received + count);
    sequence->duration_ms = duration_ms;
    sequence->crc = crc32_update(sequence->crc, packed, count * PROTO_SEGMENT_SIZE);
    return accepted();
}

static bool is_committed(const struct sequence *sequence)
{
    return sequence->state == PROTO_SEQUENCE_STATE_READY || sequence->state == PROTO_SEQUENCE_STATE_DONE ||
           sequence->state == PROTO_SEQUENCE_STATE_ABORTED;
}

struct refusal sequence_commit(struct sequence *sequence, uint32_t crc)
{
    const bool receiving = sequence->state == PROTO_SEQUENCE_STATE_RECEIVING;
    if (!receiving && !is_committed(sequence)) {
        return refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, sequence->state);
    }
    if (sequence->received < sequence->segment_count) {
        return refused(PROTO_REFUSAL_REASON_SEQUENCE_INCOMPLETE, sequence->received);
    }
    if (crc != sequence->crc) {
        return refused(PROTO_REFUSAL_REASON_SEQUENCE_BAD_CRC, sequence->crc);
    }
    if (receiving) {
        sequence->state = PROTO_SEQUENCE_STATE_READY;
    }
    return accepted();
}

struct refusal sequence_check(const struct sequence *sequence, const struct tuning *tuning, uint32_t crc)
{
    if (!is_committed(sequence)) {
        return refused(PROTO_REFUSAL_REASON_SEQUENCE_EMPTY, sequence->state);
    }
    if (crc != sequence->crc) {
        return refused(PROTO_REFUSAL_REASON_SEQUENCE_BAD_CRC, sequence->crc);
    }
    /* A limit may have been lowered since the upload. */
    for (uint32_t i = 0; i < sequence->segment_count; i++) {
        const struct refusal verdict = check_segment(&sequence->segments[i], tuning, i);
        if (verdict.reason != REFUSAL_NONE) {
            return verdict;
        }
    }
    return accepted();
}

static uint32_t segment_crc(uint32_t crc, const struct proto_segment *segment)
{
    uint8_t packed[PROTO_SEGMENT_SIZE];
    return crc32_update(crc, packed, proto_segment_encode(segment, packed, sizeof packed));
}

bool sequence_is_intact(const struct sequence *sequence)
{
    uint32_t crc = 0;
    for (uint32_t i = 0; i < sequence->segment_count; i++) {
        crc = segment_crc(crc, &sequence->segments[i]);
    }
    return crc == sequence->crc;
}

bool sequence_audit(struct sequence *sequence)
{
    if (sequence->audited >= sequence->segment_count) {
        const bool good = sequence->audit_crc == sequence->crc;
        sequence->audited = 0;
        sequence->audit_crc = 0;
        return good;
    }
    sequence->audit_crc = segment_crc(sequence->audit_crc, &sequence->segments[sequence->audited]);
    sequence->audited++;
    return true;
}

void sequence_start(struct sequence *sequence, uint16_t log_id)
{
    sequence->state = PROTO_SEQUENCE_STATE_RUNNING;
    sequence->log_id = log_id;
    sequence->current = 0;
    sequence->elapsed_ms = 0;
    sequence->audited = 0;
    sequence->audit_crc = 0;
    sequence->current_end_ms = sequence->segments[0].duration_ms;
}

enum sequence_event sequence_step(struct sequence *sequence)
{
    sequence->elapsed_ms++;
    if (sequence->elapsed_ms < sequence->current_end_ms) {
        return SEQUENCE_GOES_ON;
    }
    if (sequence->current + 1u >= sequence->segment_count) {
        sequence->state = PROTO_SEQUENCE_STATE_DONE;
        return SEQUENCE_FINISHED;
    }
    sequence->current++;
    sequence->current_end_ms += sequence->segments[sequence->current].duration_ms;
    return SEQUENCE_NEXT_SEGMENT;
}

void sequence_abort(struct sequence *sequence)
{
    if (sequence->state == PROTO_SEQUENCE_STATE_RUNNING) {
        sequence->state = PROTO_SEQUENCE_STATE_ABORTED;
    }
}

void sequence_forget_upload(struct sequence *sequence)
{
    if (sequence->state == PROTO_SEQUENCE_STATE_RECEIVING) {
        sequence->state = PROTO_SEQUENCE_STATE_EMPTY;
        sequence->segment_count = 0;
        sequence->received = 0;
        sequence->duration_ms = 0;
    }
}

struct wheel_command sequence_command(const struct sequence *sequence, const struct tuning *tuning)
{
    const struct proto_segment *const segment = &sequence->segments[sequence->current];
    struct wheel_command command;
    /* Checked when it was uploaded and again when it was started; parameters cannot change in between. */
    (void)command_check(tuning, segment->kind, segment->a, segment->b, &command);
    return command;
}
