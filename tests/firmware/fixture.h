/* A controller on the in-memory board, with two simple motors, and a host that sends requests and reads
 * replies. */
#ifndef FIXTURE_H
#define FIXTURE_H

#include <math.h>
#include <string.h>

#include "controller.h"
#include "crc32.h"
#include "hal_host.h"
#include "requests.h"
#include "unity.h"

/* One wheel: first order from effort to speed, with dry friction; its parameters set what lies between. */
struct fixture_motor {
    double gain_mps;
    double time_constant_s;
    double friction; /* effort */
    double speed_mps;
    double travel_m;
};

struct fixture {
    struct hal_host board;
    struct controller controller;
    struct fixture_motor motor[HAL_WHEELS];
    bool motors_turn; /* false: counts are whatever the test sets */
    uint16_t sequence;
    /* The last reply. */
    struct frame_decoder decoder;
    struct frame reply;
    uint32_t replies;
};

static struct fixture fixture;

enum { FIXTURE_COUNTS_PER_REV = 2400 };

static inline double fixture_metres_per_count(void)
{
    return 2.0 * 3.14159265358979323846 * 0.0635 / FIXTURE_COUNTS_PER_REV;
}

/* The same controller after power-up, on a robot at rest, which nobody has armed. */
static inline void fixture_power_up_unarmed(void)
{
    memset(&fixture, 0, sizeof fixture);
    hal_host_init(&fixture.board);
    hal_host_select(&fixture.board);
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        fixture.motor[wheel] =
            (struct fixture_motor){.gain_mps = 1.5, .time_constant_s = 0.33, .friction = 0.02};
    }
    fixture.motors_turn = true;
    controller_init(&fixture.controller);
}

static inline void fixture_turn_motor(struct fixture_motor *motor, double effort)
{
    const double step_s = 0.001;
    double drive = effort;
    if (fabs(motor->speed_mps) < 1e-4 && fabs(effort) <= motor->friction) {
        motor->speed_mps = 0.0;
        return;
    }
    const double direction = fabs(motor->speed_mps) >= 1e-4 ? motor->speed_mps : effort;
    drive -= direction > 0.0 ? motor->friction : -motor->friction;
    const double before = motor->speed_mps;
    motor->speed_mps += (motor->gain_mps * drive - motor->speed_mps) * step_s / motor->time_constant_s;
    if (before * motor->speed_mps < 0.0) {
        motor->speed_mps = 0.0;
    }
    motor->travel_m += motor->speed_mps * step_s;
}

/* A tick to which the main loop does not get round. */
static inline void fixture_tick(void)
{
    for (int wheel = 0; fixture.motors_turn && wheel < HAL_WHEELS; wheel++) {
        fixture_turn_motor(&fixture.motor[wheel], fixture.board.effort_e4[wheel] / 10000.0);
        fixture.board.sample.counts[wheel] =
            (int32_t)floor(fixture.motor[wheel].travel_m / fixture_metres_per_count());
    }
    controller_tick(&fixture.controller);
}

/* `count` milliseconds: the wheels turn under the effort of the moment, then the tick, then the main loop. */
static inline void fixture_run(uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        fixture_tick();
        controller_poll(&fixture.controller);
    }
}

/* Reads what the controller has sent; true when a frame was among it (the last one is in fixture.reply). */
static inline bool fixture_hear(void)
{
    static uint8_t bytes[HAL_HOST_SEND_SIZE];
    const size_t length = hal_host_take_sent(&fixture.board, bytes, sizeof bytes);
    bool heard = false;
    for (size_t i = 0; i < length; i++) {
        if (frame_decoder_push(&fixture.decoder, bytes[i], &fixture.reply)) {
            heard = true;
            fixture.replies++;
        }
    }
    return heard;
}

static inline void fixture_say(uint8_t id, uint16_t sequence, const void *payload, size_t length)
{
    static uint8_t bytes[FRAME_MAX_CODED];
    const size_t size = frame_encode(id, sequence, payload, length, bytes, sizeof bytes);
    TEST_ASSERT_NOT_EQUAL(0, size);
    TEST_ASSERT_EQUAL(size, hal_host_receive(&fixture.board, bytes, size));
}

/* One request and its reply, without a tick in between. */
static inline void fixture_ask(uint8_t id, const void *payload, size_t length)
{
    fixture.sequence++;
    fixture_say(id, fixture.sequence, payload, length);
    controller_poll(&fixture.controller);
    TEST_ASSERT_TRUE_MESSAGE(fixture_hear(), "no reply");
    TEST_ASSERT_EQUAL_UINT16(fixture.sequence, fixture.reply.sequence);
}

/* The refusal of the last request; reason 0 when it was accepted. */
static inline struct proto_refusal fixture_refusal(void)
{
    struct proto_refusal refusal = {0};
    if (fixture.reply.id == PROTO_ID_REFUSAL) {
        TEST_ASSERT_TRUE(proto_refusal_decode(&refusal, fixture.reply.payload, fixture.reply.payload_length));
    }
    return refusal;
}

static inline void fixture_expect_accepted(void)
{
    const struct proto_refusal refusal = fixture_refusal();
    TEST_ASSERT_EQUAL_STRING_MESSAGE("?", proto_refusal_reason_name(refusal.reason), "refused");
}

static inline void fixture_expect_refused(enum proto_refusal_reason reason, uint32_t detail)
{
    const struct proto_refusal refusal = fixture_refusal();
    TEST_ASSERT_EQUAL_STRING(proto_refusal_reason_name(reason), proto_refusal_reason_name(refusal.reason));
    TEST_ASSERT_EQUAL_UINT32(detail, refusal.detail);
}

static inline struct proto_status_reply fixture_status(void)
{
    struct proto_status_reply status;
    fixture_ask(PROTO_ID_STATUS, NULL, 0);
    TEST_ASSERT_TRUE(proto_status_reply_decode(&status, fixture.reply.payload, fixture.reply.payload_length));
    return status;
}

static inline void fixture_set_effort(float left, float right)
{
    const struct proto_set_effort_request request = {.left = left, .right = right};
    uint8_t payload[PROTO_SET_EFFORT_REQUEST_SIZE];
    fixture_ask(PROTO_ID_SET_EFFORT, payload,
                proto_set_effort_request_encode(&request, payload, sizeof payload));
}

static inline void fixture_set_velocity(float left, float right)
{
    const struct proto_set_velocity_request request = {.left = left, .right = right};
    uint8_t payload[PROTO_SET_VELOCITY_REQUEST_SIZE];
    fixture_ask(PROTO_ID_SET_VELOCITY, payload,
                proto_set_velocity_request_encode(&request, payload, sizeof payload));
}

static inline void fixture_set_parameter(uint16_t index, float value)
{
    const struct proto_param_set_request request = {.index = index, .value = value};
    uint8_t payload[PROTO_PARAM_SET_REQUEST_SIZE];
    fixture_ask(PROTO_ID_PARAM_SET, payload,
                proto_param_set_request_encode(&request, payload, sizeof payload));
}

static inline void fixture_stop(void)
{
    fixture_ask(PROTO_ID_STOP, NULL, 0);
}

static inline void fixture_begin_upload(uint16_t segment_count, uint16_t log_rate_hz)
{
    const struct proto_seq_begin_request request = {.segment_count = segment_count,
                                                    .log_rate_hz = log_rate_hz};
    uint8_t payload[PROTO_SEQ_BEGIN_REQUEST_SIZE];
    fixture_ask(PROTO_ID_SEQ_BEGIN, payload,
                proto_seq_begin_request_encode(&request, payload, sizeof payload));
}

/* Packs segments as on the wire; returns their size. */
static inline size_t fixture_pack(const struct proto_segment *segments, size_t count, uint8_t *out)
{
    for (size_t i = 0; i < count; i++) {
        (void)proto_segment_encode(&segments[i], out + i * PROTO_SEGMENT_SIZE, PROTO_SEGMENT_SIZE);
    }
    return count * PROTO_SEGMENT_SIZE;
}

static inline void fixture_send_segments(uint16_t first, const struct proto_segment *segments, size_t count)
{
    static uint8_t payload[PROTO_MAX_PAYLOAD];
    payload[0] = (uint8_t)(first & 0xFFu);
    payload[1] = (uint8_t)(first >> 8);
    fixture_ask(PROTO_ID_SEQ_SEGMENTS, payload, 2 + fixture_pack(segments, count, payload + 2));
}

static inline void fixture_ask_u32(uint8_t id, uint32_t value)
{
    const uint8_t payload[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16),
                                (uint8_t)(value >> 24)};
    fixture_ask(id, payload, sizeof payload);
}

static inline void fixture_arm(void)
{
    fixture.controller.robot.supervisor.armed = true;
}

/* Powered up and armed. */
static inline void fixture_power_up(void)
{
    fixture_power_up_unarmed();
    fixture_arm();
}

/* Uploads and commits a whole sequence; returns its CRC. */
static inline uint32_t fixture_upload(const struct proto_segment *segments, size_t count,
                                      uint16_t log_rate_hz)
{
    static uint8_t packed[PROTO_MAX_SEGMENTS * PROTO_SEGMENT_SIZE];
    const size_t per_frame = (PROTO_MAX_PAYLOAD - 2) / PROTO_SEGMENT_SIZE;
    const uint32_t crc = crc32_update(0, packed, fixture_pack(segments, count, packed));
    fixture_begin_upload((uint16_t)count, log_rate_hz);
    fixture_expect_accepted();
    for (size_t first = 0; first < count; first += per_frame) {
        fixture_send_segments((uint16_t)first, segments + first,
                              count - first < per_frame ? count - first : per_frame);
        fixture_expect_accepted();
    }
    fixture_ask_u32(PROTO_ID_SEQ_COMMIT, crc);
    fixture_expect_accepted();
    return crc;
}

static inline void fixture_ask_start(uint32_t crc, uint8_t unattended)
{
    const struct proto_seq_start_request request = {.crc32 = crc, .unattended = unattended};
    uint8_t payload[PROTO_SEQ_START_REQUEST_SIZE];
    fixture_ask(PROTO_ID_SEQ_START, payload,
                proto_seq_start_request_encode(&request, payload, sizeof payload));
}

/* Starts the committed sequence, which then needs no host; returns its log's id. */
static inline uint16_t fixture_start(uint32_t crc)
{
    struct proto_seq_start_reply reply;
    fixture_ask_start(crc, 1);
    fixture_expect_accepted();
    TEST_ASSERT_TRUE(
        proto_seq_start_reply_decode(&reply, fixture.reply.payload, fixture.reply.payload_length));
    return reply.log_id;
}

static inline struct proto_log_list_reply fixture_list_logs(uint16_t first)
{
    struct proto_log_list_reply list;
    const struct proto_log_list_request request = {.first = first};
    uint8_t payload[PROTO_LOG_LIST_REQUEST_SIZE];
    fixture_ask(PROTO_ID_LOG_LIST, payload, proto_log_list_request_encode(&request, payload, sizeof payload));
    TEST_ASSERT_TRUE(proto_log_list_reply_decode(&list, fixture.reply.payload, fixture.reply.payload_length));
    return list;
}

/* The newest log's entry. */
static inline struct proto_log_entry fixture_newest_log(void)
{
    struct proto_log_entry entry;
    struct proto_log_list_reply list = fixture_list_logs(0);
    TEST_ASSERT_TRUE(list.total > 0);
    list = fixture_list_logs((uint16_t)(list.total - 1));
    TEST_ASSERT_EQUAL(1, list.entries_count);
    TEST_ASSERT_TRUE(proto_log_entry_decode(&entry, list.entries, PROTO_LOG_ENTRY_SIZE));
    return entry;
}

/* Reads `length` bytes of the log over the link, in frames of odd sizes. */
static inline void fixture_read_log(uint32_t offset, uint8_t *out, size_t length)
{
    size_t done = 0;
    while (done < length) {
        struct proto_log_read_reply reply;
        uint8_t payload[PROTO_LOG_READ_REQUEST_SIZE];
        const size_t wish = length - done < 1000 ? length - done : 1000;
        const struct proto_log_read_request request = {.offset = offset + (uint32_t)done,
                                                       .length = (uint16_t)wish};
        fixture_ask(PROTO_ID_LOG_READ, payload,
                    proto_log_read_request_encode(&request, payload, sizeof payload));
        fixture_expect_accepted();
        TEST_ASSERT_TRUE(
            proto_log_read_reply_decode(&reply, fixture.reply.payload, fixture.reply.payload_length));
        TEST_ASSERT_EQUAL_UINT32(request.offset, reply.offset);
        TEST_ASSERT_TRUE(reply.data_length > 0 && reply.data_length <= wish);
        memcpy(out + done, reply.data, reply.data_length);
        done += reply.data_length;
    }
}

#endif
