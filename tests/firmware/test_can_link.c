/* Over CAN a board accepts the same requests as over serial, keeps their order, and broadcasts its status. */
#include "fixture.h"

#include "isotp.h"

/* A host on the bus: one channel to the board under test. */
static struct isotp host;
static uint8_t heard[FRAME_MAX_PLAIN];
static uint8_t said[FRAME_MAX_PLAIN];
static struct hal_can_frame broadcasts[HAL_HOST_CAN_FRAMES]; /* all frames that are no replies */
static size_t broadcast_count;
static struct frame replies[32];
static uint8_t reply_bytes[32][FRAME_MAX_PLAIN];
static size_t reply_count;
static uint8_t node;
static bool slow; /* the host sends no flow control for replies for now */
static struct hal_can_frame held;

void setUp(void)
{
    fixture_power_up();
    isotp_init(&host, heard, sizeof heard, 0);
    broadcast_count = 0;
    reply_count = 0;
    node = 1;
    slow = false;
    controller_poll(&fixture.controller); /* joins */
}

void tearDown(void)
{
}

static void take_reply(const struct hal_can_frame *frame)
{
    size_t length;
    if (slow && frame->data[0] >> 4 == 1) { /* a first frame waits for flow control */
        held = *frame;
        return;
    }
    if (isotp_receive(&host, frame->data, frame->length, fixture.controller.robot.now_ms, &length)) {
        TEST_ASSERT_LESS_THAN(32, reply_count);
        memcpy(reply_bytes[reply_count], heard, length);
        TEST_ASSERT_TRUE(frame_open(reply_bytes[reply_count], length, &replies[reply_count]));
        reply_count++;
    }
}

static void put(uint16_t id, const void *data, size_t length)
{
    struct hal_can_frame frame = {.id = id, .length = (uint8_t)length};
    memcpy(frame.data, data, length);
    TEST_ASSERT_LESS_THAN(HAL_HOST_CAN_FRAMES, fixture.board.can_received_count);
    fixture.board.can_received[fixture.board.can_received_count++] = frame;
}

/* Frames on the bus reach the other side, both ways. */
static void exchange(void)
{
    struct hal_can_frame frame;
    for (size_t i = 0; i < fixture.board.can_sent_count; i++) {
        if (fixture.board.can_sent[i].id == PROTO_CAN_BOARD_TO_HOST + node) {
            take_reply(&fixture.board.can_sent[i]);
        } else {
            broadcasts[broadcast_count++] = fixture.board.can_sent[i];
        }
    }
    fixture.board.can_sent_count = 0;
    while ((frame.length = (uint8_t)isotp_next_frame(&host, frame.data, fixture.controller.robot.now_ms)) >
           0) {
        put((uint16_t)(PROTO_CAN_HOST_TO_BOARD + node), frame.data, frame.length);
    }
}

static void run_bus(uint32_t ms)
{
    for (uint32_t i = 0; i < ms; i++) {
        exchange();
        fixture_run(1);
    }
    exchange();
}

/* Hands a request to the host's channel, and runs the bus until the whole of it is with the board. */
static void say(uint8_t id, uint16_t sequence, const void *payload, size_t length)
{
    const size_t plain = FRAME_HEADER_SIZE + length + FRAME_CRC_SIZE;
    said[0] = id;
    said[1] = (uint8_t)(sequence & 0xFFu);
    said[2] = (uint8_t)(sequence >> 8);
    if (length > 0) {
        memcpy(said + FRAME_HEADER_SIZE, payload, length);
    }
    const uint32_t crc = crc32_update(0, said, plain - FRAME_CRC_SIZE);
    for (size_t i = 0; i < FRAME_CRC_SIZE; i++) {
        said[plain - FRAME_CRC_SIZE + i] = (uint8_t)(crc >> (8 * i));
    }
    TEST_ASSERT_TRUE(isotp_send(&host, said, plain));
    for (int i = 0; i < 400 && !isotp_is_idle(&host); i++) {
        exchange();
        controller_poll(&fixture.controller);
    }
    TEST_ASSERT_TRUE(isotp_is_idle(&host));
    controller_poll(&fixture.controller);
}

static const struct frame *ask(uint8_t id, const void *payload, size_t length)
{
    const size_t before = reply_count;
    fixture.sequence++;
    say(id, fixture.sequence, payload, length);
    for (int i = 0; i < 400 && reply_count == before; i++) {
        exchange();
        controller_poll(&fixture.controller);
    }
    TEST_ASSERT_EQUAL_MESSAGE(before + 1, reply_count, "no reply over CAN");
    TEST_ASSERT_EQUAL_UINT16(fixture.sequence, replies[before].sequence);
    return &replies[before];
}

static struct proto_status_reply ask_status(void)
{
    struct proto_status_reply status;
    const struct frame *const reply = ask(PROTO_ID_STATUS, NULL, 0);
    TEST_ASSERT_TRUE(proto_status_reply_decode(&status, reply->payload, reply->payload_length));
    return status;
}

static void set_effort_over_can(float left, float right)
{
    const struct proto_set_effort_request request = {.left = left, .right = right};
    uint8_t payload[PROTO_SET_EFFORT_REQUEST_SIZE];
    const size_t length = proto_set_effort_request_encode(&request, payload, sizeof payload);
    TEST_ASSERT_EQUAL_HEX8(PROTO_ID_SET_EFFORT | PROTO_REPLY_BIT,
                           ask(PROTO_ID_SET_EFFORT, payload, length)->id);
}

/* From here on the first reply of several frames stays where it is, and what follows waits behind it. */
static void hold_replies(void)
{
    slow = true;
    held.length = 0;
}

static void release_replies(void)
{
    slow = false;
    if (held.length > 0) {
        take_reply(&held);
    }
}

static size_t count_broadcasts(uint16_t id)
{
    size_t count = 0;
    for (size_t i = 0; i < broadcast_count; i++) {
        count += broadcasts[i].id == id;
    }
    return count;
}

static void it_joins_as_its_node_at_its_bit_rate(void)
{
    TEST_ASSERT_EQUAL_UINT32(1000000, fixture.board.can_bits_per_s);
    TEST_ASSERT_EQUAL_HEX16(PROTO_CAN_HOST_TO_BOARD + 1, fixture.board.can_ids[0]);
    TEST_ASSERT_EQUAL_HEX16(PROTO_CAN_HOST_TO_BOARD, fixture.board.can_ids[1]);
    fixture_set_parameter(PROTO_PARAMETER_CAN_NODE, 5.0f);
    fixture_set_parameter(PROTO_PARAMETER_CAN_BITRATE_KBPS, 500.0f);
    controller_poll(&fixture.controller);
    TEST_ASSERT_EQUAL_UINT32(500000, fixture.board.can_bits_per_s);
    TEST_ASSERT_EQUAL_HEX16(PROTO_CAN_HOST_TO_BOARD + 5, fixture.board.can_ids[0]);
    node = 5;
    (void)ask_status();
}

static void a_node_changed_over_can_is_confirmed_under_the_old_number(void)
{
    const struct proto_param_set_request request = {.index = PROTO_PARAMETER_CAN_NODE, .value = 9.0f};
    uint8_t payload[PROTO_PARAM_SET_REQUEST_SIZE];
    const size_t length = proto_param_set_request_encode(&request, payload, sizeof payload);
    TEST_ASSERT_EQUAL_HEX8(PROTO_ID_PARAM_SET | PROTO_REPLY_BIT,
                           ask(PROTO_ID_PARAM_SET, payload, length)->id);
    controller_poll(&fixture.controller);
    TEST_ASSERT_EQUAL_HEX16(PROTO_CAN_HOST_TO_BOARD + 9, fixture.board.can_ids[0]);
    node = 9;
    (void)ask_status();
}

static void a_bus_that_takes_nothing_does_not_hold_up_a_new_node(void)
{
    fixture.board.can_room = 0;
    say(PROTO_ID_STATUS, 1, NULL, 0);
    fixture_set_parameter(PROTO_PARAMETER_CAN_NODE, 9.0f);
    controller_poll(&fixture.controller);
    TEST_ASSERT_EQUAL_HEX16(PROTO_CAN_HOST_TO_BOARD + 9, fixture.board.can_ids[0]);
}

static void requests_are_answered_as_over_serial(void)
{
    static const uint8_t hello[PROTO_HELLO_REQUEST_SIZE] = {1};
    const struct frame *const reply = ask(PROTO_ID_HELLO, hello, sizeof hello);
    fixture_ask(PROTO_ID_HELLO, hello, sizeof hello);
    TEST_ASSERT_EQUAL_HEX8(fixture.reply.id, reply->id);
    TEST_ASSERT_EQUAL(fixture.reply.payload_length, reply->payload_length);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(fixture.reply.payload, reply->payload, reply->payload_length);
}

static void a_long_upload_arrives_over_can(void)
{
    static uint8_t payload[PROTO_MAX_PAYLOAD];
    enum { SEGMENTS = (PROTO_MAX_PAYLOAD - 2) / PROTO_SEGMENT_SIZE };
    for (size_t i = 0; i < SEGMENTS; i++) {
        const struct proto_segment segment = {PROTO_SEGMENT_KIND_EFFORT, 100, 0.3f, 0.3f};
        (void)proto_segment_encode(&segment, payload + 2 + i * PROTO_SEGMENT_SIZE, PROTO_SEGMENT_SIZE);
    }
    fixture_begin_upload(SEGMENTS, 0);
    const struct frame *const reply =
        ask(PROTO_ID_SEQ_SEGMENTS, payload, (size_t)2 + (size_t)SEGMENTS * PROTO_SEGMENT_SIZE);
    TEST_ASSERT_EQUAL_HEX8(PROTO_ID_SEQ_SEGMENTS | PROTO_REPLY_BIT, reply->id);
}

static void a_change_is_made_once_per_request_on_each_side(void)
{
    set_effort_over_can(0.3f, 0.3f);
    fixture_stop();
    /* The same request again, as after a lost reply: confirmed, not carried out. */
    fixture.sequence = (uint16_t)(fixture.sequence - 2);
    set_effort_over_can(0.3f, 0.3f);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_IDLE, fixture_status().state);
}

static void a_call_is_answered_within_the_time_that_spreads_the_boards(void)
{
    const uint8_t call = PROTO_ID_HELLO;
    uint32_t after_ms[2];
    for (uint8_t board = 0; board < 2; board++) {
        struct proto_can_announce announced;
        const uint8_t id[12] = {board};
        setUp();
        memcpy(fixture.board.identity.board_id, id, sizeof id);
        controller_init(&fixture.controller);
        fixture_arm();
        controller_poll(&fixture.controller);
        fixture_set_parameter(PROTO_PARAMETER_CAN_STATUS_HZ, 0.0f);
        put(PROTO_CAN_HOST_TO_BOARD, &call, 1);
        after_ms[board] = 0;
        for (; after_ms[board] <= 64 && broadcast_count == 0; after_ms[board]++) {
            run_bus(1);
        }
        TEST_ASSERT_EQUAL(1, broadcast_count);
        TEST_ASSERT_EQUAL_HEX16(PROTO_CAN_ANNOUNCE_BASE + 1, broadcasts[0].id);
        TEST_ASSERT_TRUE(proto_can_announce_decode(&announced, broadcasts[0].data, broadcasts[0].length));
        TEST_ASSERT_EQUAL_HEX32(PROTO_SCHEMA_HASH, announced.schema_hash);
        TEST_ASSERT_EQUAL_HEX32(crc32_update(0, id, sizeof id), announced.board);
        run_bus(200);
        TEST_ASSERT_EQUAL(1, broadcast_count);
    }
    TEST_ASSERT_NOT_EQUAL(after_ms[0], after_ms[1]);
}

static void a_call_to_stop_stops_and_other_calls_do_nothing(void)
{
    static const uint8_t stop = PROTO_ID_STOP, status = PROTO_ID_STATUS;
    set_effort_over_can(0.3f, 0.3f);
    put(PROTO_CAN_HOST_TO_BOARD, &status, 1);
    put(PROTO_CAN_HOST_TO_BOARD, &status, 0);
    run_bus(2);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_LIVE, ask_status().state);
    put(PROTO_CAN_HOST_TO_BOARD, &stop, 1);
    controller_poll(&fixture.controller);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_IDLE, ask_status().state);
}

static void a_message_with_a_wrong_crc_is_dropped_and_counted(void)
{
    const uint8_t bad[8] = {0x07, PROTO_ID_STOP, 1, 0, 9, 9, 9, 9};
    put((uint16_t)(PROTO_CAN_HOST_TO_BOARD + 1), bad, sizeof bad);
    controller_poll(&fixture.controller);
    TEST_ASSERT_EQUAL_UINT32(1, ask_status().frames_dropped);
}

static void status_is_broadcast_as_often_as_asked(void)
{
    fixture_set_parameter(PROTO_PARAMETER_CAN_STATUS_HZ, 50.0f);
    run_bus(1000);
    TEST_ASSERT_UINT32_WITHIN(1, 50, count_broadcasts(PROTO_CAN_STATUS_BASE + 1));
    TEST_ASSERT_UINT32_WITHIN(1, 50, count_broadcasts(PROTO_CAN_MOTION_BASE + 1));
    broadcast_count = 0;
    fixture_set_parameter(PROTO_PARAMETER_CAN_STATUS_HZ, 0.0f);
    run_bus(1000);
    TEST_ASSERT_EQUAL(0, broadcast_count);
    fixture.board.can_room = 1; /* not both frames: neither */
    fixture_set_parameter(PROTO_PARAMETER_CAN_STATUS_HZ, 50.0f);
    run_bus(100);
    TEST_ASSERT_EQUAL(0, broadcast_count);
}

static void a_broadcast_says_what_the_wheels_do_and_what_is_wrong(void)
{
    struct proto_can_status how;
    struct proto_can_motion motion;
    set_effort_over_can(0.4f, 0.2f);
    run_bus(800); /* the host stops sending: motion before the time-out, a fault and braked wheels after it */
    const size_t last = broadcast_count - 1;
    TEST_ASSERT_TRUE(proto_can_status_decode(&how, broadcasts[last - 1].data, broadcasts[last - 1].length));
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_HOST_SILENT, how.faults);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_STOPPED, how.state);
    TEST_ASSERT_EQUAL_UINT16(12000, how.battery);
    bool moved = false;
    for (size_t i = 1; i <= last; i += 2) {
        TEST_ASSERT_TRUE(proto_can_motion_decode(&motion, broadcasts[i].data, broadcasts[i].length));
        moved = moved || (motion.effort_left == 4000 && motion.effort_right == 2000 &&
                          motion.speed_left > motion.speed_right && motion.speed_right > 50);
    }
    TEST_ASSERT_TRUE(moved);
}

static void make_logs(uint32_t count)
{
    const struct proto_segment segment = {PROTO_SEGMENT_KIND_EFFORT, 40, 0.0f, 0.0f};
    const uint32_t crc = fixture_upload(&segment, 1, 200);
    for (uint32_t i = 0; i < count; i++) {
        (void)fixture_start(crc);
        fixture_run(60);
    }
}

static void say_log_list(uint16_t sequence)
{
    static const uint8_t first[PROTO_LOG_LIST_REQUEST_SIZE];
    say(PROTO_ID_LOG_LIST, sequence, first, sizeof first);
}

static void requests_wait_for_room_and_are_answered_in_order(void)
{
    make_logs(12);
    hold_replies();
    for (uint16_t i = 1; i <= 6; i++) {
        say_log_list(i);
    }
    say(PROTO_ID_STATUS, 7, NULL, 0);
    TEST_ASSERT_EQUAL(0, reply_count);
    release_replies();
    run_bus(100);
    TEST_ASSERT_EQUAL(7, reply_count);
    for (uint16_t i = 1; i <= 7; i++) {
        TEST_ASSERT_EQUAL_UINT16(i, replies[i - 1].sequence);
        TEST_ASSERT_NOT_EQUAL(PROTO_ID_REFUSAL, replies[i - 1].id);
    }
}

static void a_stop_goes_past_all_that_waits(void)
{
    make_logs(12);
    set_effort_over_can(0.3f, 0.3f);
    reply_count = 0;
    hold_replies();
    for (uint16_t i = 1; i <= 4; i++) {
        say_log_list(i);
    }
    say(PROTO_ID_STOP, 5, NULL, 0);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_IDLE, fixture.controller.robot.supervisor.state);
    release_replies();
    run_bus(100);
    TEST_ASSERT_EQUAL(5, reply_count);
    TEST_ASSERT_EQUAL_UINT16(1, replies[0].sequence);
    TEST_ASSERT_EQUAL_UINT16(5, replies[1].sequence);
}

static void more_requests_than_may_wait_are_lost(void)
{
    static const uint8_t long_one[CAN_LINK_WAITING_LONGEST];
    enum { ANSWERED = 1 + CAN_LINK_WAITING };
    make_logs(12);
    hold_replies();
    for (uint16_t i = 1; i <= ANSWERED + 3; i++) {
        say_log_list(i);
    }
    release_replies();
    run_bus(200);
    TEST_ASSERT_EQUAL(ANSWERED, reply_count);
    for (size_t i = 0; i < ANSWERED; i++) {
        TEST_ASSERT_EQUAL_UINT16(i + 1, replies[i].sequence);
    }
    reply_count = 0;
    hold_replies();
    say_log_list(1);
    say(PROTO_ID_SEQ_SEGMENTS, 2, long_one, sizeof long_one); /* too long to wait, but its refusal has room */
    say_log_list(3);
    say(PROTO_ID_SEQ_SEGMENTS, 4, long_one, sizeof long_one); /* may not overtake the one before it */
    release_replies();
    run_bus(100);
    TEST_ASSERT_EQUAL(3, reply_count);
    TEST_ASSERT_EQUAL_UINT16(1, replies[0].sequence);
    TEST_ASSERT_EQUAL_UINT16(2, replies[1].sequence);
    TEST_ASSERT_EQUAL_UINT16(3, replies[2].sequence);
}

static void a_reply_without_room_is_not_sent_in_part(void)
{
    static const uint8_t payload[PROTO_MAX_PAYLOAD];
    struct can_link *const can = &fixture.controller.can;
    can_link_send(can, 0x81, 1, payload, sizeof payload);
    can_link_send(can, 0x82, 2, payload, sizeof payload);
    can_link_send(can, 0x83, 3, payload, 10);
    run_bus(50);
    TEST_ASSERT_EQUAL(2, reply_count);
    TEST_ASSERT_EQUAL_HEX8(0x81, replies[0].id);
    TEST_ASSERT_EQUAL_HEX8(0x83, replies[1].id);
}

static struct proto_can_state_reply can_state(void)
{
    struct proto_can_state_reply state;
    fixture_ask(PROTO_ID_CAN_STATE, NULL, 0);
    TEST_ASSERT_TRUE(
        proto_can_state_reply_decode(&state, fixture.reply.payload, fixture.reply.payload_length));
    return state;
}

static void the_state_of_the_bus_is_told_over_serial(void)
{
    fixture.board.can_report = (struct hal_can_report){
        .state = PROTO_CAN_BUS_STATE_PASSIVE,
        .transmit_errors = 128,
        .receive_errors = 3,
        .last_error = 3,
        .sent = 10,
        .received = 20,
        .overruns = 30,
        .bus_offs = 40,
        .discarded = 50,
    };
    const struct proto_can_state_reply state = can_state();
    TEST_ASSERT_EQUAL_UINT8(1, state.node);
    TEST_ASSERT_EQUAL_UINT16(1000, state.bitrate_kbps);
    TEST_ASSERT_EQUAL_UINT8(PROTO_CAN_BUS_STATE_PASSIVE, state.bus_state);
    TEST_ASSERT_EQUAL_UINT8(128, state.transmit_errors);
    TEST_ASSERT_EQUAL_UINT8(3, state.receive_errors);
    TEST_ASSERT_EQUAL_UINT8(3, state.last_error);
    TEST_ASSERT_EQUAL_UINT32(10, state.frames_sent);
    TEST_ASSERT_EQUAL_UINT32(20, state.frames_received);
    TEST_ASSERT_EQUAL_UINT32(30, state.overruns);
    TEST_ASSERT_EQUAL_UINT32(40, state.bus_offs);
    TEST_ASSERT_EQUAL_UINT32(50, state.discarded);
}

static void leaving_a_bus_that_had_worked_is_a_fault_for_a_second_at_least(void)
{
    fixture.board.can_report.state = PROTO_CAN_BUS_STATE_BUS_OFF;
    fixture_run(10);
    TEST_ASSERT_EQUAL_HEX32(0, fixture_status().faults_active); /* no other node had been on the bus */
    fixture.board.can_report.received = 1;
    fixture_run(10);
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_CAN_BUS_OFF, fixture_status().faults_active);
    fixture_set_effort(0.2f, 0.2f);
    fixture_expect_accepted(); /* does not prevent driving */
    fixture.board.can_report.state = PROTO_CAN_BUS_STATE_ACTIVE;
    fixture_run(990);
    TEST_ASSERT_TRUE((fixture_status().faults_active & PROTO_FAULT_CAN_BUS_OFF) != 0);
    fixture_run(20);
    TEST_ASSERT_EQUAL_HEX32(0, fixture_status().faults_active & PROTO_FAULT_CAN_BUS_OFF);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(it_joins_as_its_node_at_its_bit_rate);
    RUN_TEST(a_node_changed_over_can_is_confirmed_under_the_old_number);
    RUN_TEST(a_bus_that_takes_nothing_does_not_hold_up_a_new_node);
    RUN_TEST(requests_are_answered_as_over_serial);
    RUN_TEST(a_long_upload_arrives_over_can);
    RUN_TEST(a_change_is_made_once_per_request_on_each_side);
    RUN_TEST(a_call_is_answered_within_the_time_that_spreads_the_boards);
    RUN_TEST(a_call_to_stop_stops_and_other_calls_do_nothing);
    RUN_TEST(a_message_with_a_wrong_crc_is_dropped_and_counted);
    RUN_TEST(status_is_broadcast_as_often_as_asked);
    RUN_TEST(a_broadcast_says_what_the_wheels_do_and_what_is_wrong);
    RUN_TEST(requests_wait_for_room_and_are_answered_in_order);
    RUN_TEST(a_stop_goes_past_all_that_waits);
    RUN_TEST(more_requests_than_may_wait_are_lost);
    RUN_TEST(a_reply_without_room_is_not_sent_in_part);
    RUN_TEST(the_state_of_the_bus_is_told_over_serial);
    RUN_TEST(leaving_a_bus_that_had_worked_is_a_fault_for_a_second_at_least);
    return UNITY_END();
}
