/* For all uploads, an accepted sequence is within the limits, and a running one ends on time.
 *
 * Input: number of segments u16, log rate u16, then frames: index u16, count u8, packed segments. */
#include <string.h>

#include "crc32.h"
#include "rig.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void begin(struct rig_input *input)
{
    const struct proto_seq_begin_request request = {.segment_count = rig_u16(input),
                                                    .log_rate_hz = rig_u16(input)};
    uint8_t payload[PROTO_SEQ_BEGIN_REQUEST_SIZE];
    rig_ask(PROTO_ID_SEQ_BEGIN, payload, proto_seq_begin_request_encode(&request, payload, sizeof payload));
}

/* One frame of segments as the input has them; the CRC goes on when they are accepted. */
static uint32_t send_segments(struct rig_input *input, uint32_t crc)
{
    static uint8_t payload[PROTO_MAX_PAYLOAD];
    const uint8_t *packed;
    const uint16_t first = rig_u16(input);
    const size_t wish = (size_t)rig_u8(input) % 64u * PROTO_SEGMENT_SIZE;
    const size_t length = rig_bytes(input, wish, &packed);
    payload[0] = (uint8_t)first;
    payload[1] = (uint8_t)(first >> 8);
    memcpy(payload + 2, packed, length);
    rig_ask(PROTO_ID_SEQ_SEGMENTS, payload, length + 2);
    return rig.accepted ? crc32_update(crc, packed, length) : crc;
}

static void ask_u32(uint8_t id, uint32_t value)
{
    const uint8_t payload[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16),
                                (uint8_t)(value >> 24)};
    rig_ask(id, payload, sizeof payload);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    enum { LONGEST_WATCHED_MS = 4000 };
    struct rig_input input = {.at = data, .left = size};
    const struct sequence *const sequence = &rig.controller.robot.sequence;
    uint32_t crc = 0;
    rig_power_up();
    rig_tick();
    begin(&input);
    for (int frame = 0; frame < 8 && input.left > 0; frame++) {
        crc = send_segments(&input, crc);
    }
    const bool complete =
        sequence->state == PROTO_SEQUENCE_STATE_RECEIVING && sequence->received == sequence->segment_count;
    ask_u32(PROTO_ID_SEQ_COMMIT, ~crc);
    RIG_REQUIRE(!rig.accepted);
    ask_u32(PROTO_ID_SEQ_COMMIT, crc);
    RIG_REQUIRE(rig.accepted == complete);
    {
        const uint8_t payload[5] = {(uint8_t)crc, (uint8_t)(crc >> 8), (uint8_t)(crc >> 16),
                                    (uint8_t)(crc >> 24), 1};
        rig_ask(PROTO_ID_SEQ_START, payload, sizeof payload);
    }
    RIG_REQUIRE(rig.accepted == complete);
    if (!complete) {
        rig_tick();
        return 0;
    }

    uint32_t duration_ms = 0;
    for (uint32_t i = 0; i < sequence->segment_count; i++) {
        RIG_REQUIRE(sequence->segments[i].duration_ms > 0);
        duration_ms += sequence->segments[i].duration_ms;
    }
    RIG_REQUIRE(duration_ms == sequence->duration_ms);
    rig_tick(); /* time zero */
    for (uint32_t ms = 1; ms < duration_ms && ms < LONGEST_WATCHED_MS; ms++) {
        rig_tick();
        /* A velocity sequence on wheels that do not turn may be stopped by the supervisor, never by itself.
         */
        RIG_REQUIRE(sequence->state == PROTO_SEQUENCE_STATE_RUNNING ||
                    rig.controller.robot.supervisor.latched != 0);
    }
    if (duration_ms <= LONGEST_WATCHED_MS) {
        rig_tick();
        RIG_REQUIRE(sequence->state != PROTO_SEQUENCE_STATE_RUNNING && !rig.may_move);
    }
    return 0;
}
