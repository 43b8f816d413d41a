/* Every request is answered once, every bad one is refused by name, and a refused one moves nothing. */
#include "fixture.h"

#include "random.h"

void setUp(void)
{
    fixture_power_up();
}

void tearDown(void)
{
}

static const struct proto_segment short_drive = {PROTO_SEGMENT_KIND_EFFORT, 100, 0.3f, 0.3f};

static void ask_words(uint8_t id, const uint16_t *words, size_t count)
{
    uint8_t payload[16];
    for (size_t i = 0; i < count; i++) {
        payload[2 * i] = (uint8_t)(words[i] & 0xFFu);
        payload[2 * i + 1] = (uint8_t)(words[i] >> 8);
    }
    fixture_ask(id, payload, 2 * count);
}

static void ask_log_read(uint32_t offset, uint16_t length)
{
    const struct proto_log_read_request request = {.offset = offset, .length = length};
    uint8_t payload[PROTO_LOG_READ_REQUEST_SIZE];
    fixture_ask(PROTO_ID_LOG_READ, payload, proto_log_read_request_encode(&request, payload, sizeof payload));
}

static void ask_log_digest(uint32_t offset, uint32_t length)
{
    const struct proto_log_digest_request request = {.offset = offset, .length = length};
    uint8_t payload[PROTO_LOG_DIGEST_REQUEST_SIZE];
    fixture_ask(PROTO_ID_LOG_DIGEST, payload,
                proto_log_digest_request_encode(&request, payload, sizeof payload));
}

static void hello_tells_who_is_there_and_what_it_holds(void)
{
    struct proto_hello_reply hello;
    const uint8_t payload[PROTO_HELLO_REQUEST_SIZE] = {1, 0, 0,
                                                       0, 0, 0}; /* another schema: answered all the same */
    memset(fixture.board.identity.board_id, 0x5A, 12);
    fixture.board.identity.boot_id = 99;
    controller_init(&fixture.controller);
    fixture_arm();
    fixture_ask(PROTO_ID_HELLO, payload, sizeof payload);
    TEST_ASSERT_EQUAL_HEX8(PROTO_ID_HELLO | PROTO_REPLY_BIT, fixture.reply.id);
    TEST_ASSERT_TRUE(proto_hello_reply_decode(&hello, fixture.reply.payload, fixture.reply.payload_length));
    TEST_ASSERT_EQUAL_UINT16(PROTO_VERSION, hello.protocol_version);
    TEST_ASSERT_EQUAL_HEX32(PROTO_SCHEMA_HASH, hello.schema_hash);
    TEST_ASSERT_EACH_EQUAL_HEX8(0x5A, hello.board_id, 12);
    TEST_ASSERT_EQUAL_UINT32(99, hello.boot_id);
    TEST_ASSERT_EQUAL_STRING("host", hello.board_name);
    TEST_ASSERT_EQUAL_UINT16(1000, hello.tick_hz);
    TEST_ASSERT_EQUAL_UINT16(PROTO_PARAMETER_COUNT, hello.parameter_count);
    TEST_ASSERT_EQUAL_UINT8(PROTO_RESET_CAUSE_POWER_ON, hello.reset_cause);
    TEST_ASSERT_EQUAL_UINT8(PROTO_CLOCK_SOURCE_CRYSTAL_PLL, hello.clock_source);
}

static void hello_of_a_later_version_may_be_longer(void)
{
    const uint8_t payload[20] = {9, 0};
    fixture_ask(PROTO_ID_HELLO, payload, sizeof payload);
    TEST_ASSERT_EQUAL_HEX8(PROTO_ID_HELLO | PROTO_REPLY_BIT, fixture.reply.id);
    fixture_ask(PROTO_ID_HELLO, payload, 5);
    fixture_expect_refused(PROTO_REFUSAL_REASON_BAD_LENGTH, 5);
}

/* The hello reply of a board with this identity. */
static struct proto_hello_reply hello_of(uint8_t reset_flags, bool clock_fallback, uint32_t cpu_hz)
{
    struct proto_hello_reply hello;
    const uint8_t payload[PROTO_HELLO_REQUEST_SIZE] = {0};
    fixture.board.identity.reset_cause = reset_flags;
    fixture.board.identity.clock_fallback = clock_fallback;
    fixture.board.identity.cpu_hz = cpu_hz;
    controller_init(&fixture.controller);
    fixture_arm();
    fixture_ask(PROTO_ID_HELLO, payload, sizeof payload);
    TEST_ASSERT_TRUE(proto_hello_reply_decode(&hello, fixture.reply.payload, fixture.reply.payload_length));
    return hello;
}

static uint8_t reset_cause_for(uint8_t flags)
{
    return hello_of(flags, false, 168000000).reset_cause;
}

static void reset_cause_is_read_from_the_flags_of_the_reference_manual(void)
{
    TEST_ASSERT_EQUAL_UINT8(PROTO_RESET_CAUSE_UNKNOWN, reset_cause_for(0x00));
    TEST_ASSERT_EQUAL_UINT8(PROTO_RESET_CAUSE_POWER_ON, reset_cause_for(0x0E));
    TEST_ASSERT_EQUAL_UINT8(PROTO_RESET_CAUSE_PIN, reset_cause_for(0x04));
    TEST_ASSERT_EQUAL_UINT8(PROTO_RESET_CAUSE_SOFTWARE, reset_cause_for(0x14));
    TEST_ASSERT_EQUAL_UINT8(PROTO_RESET_CAUSE_WATCHDOG, reset_cause_for(0x24));
    TEST_ASSERT_EQUAL_UINT8(PROTO_RESET_CAUSE_BROWN_OUT, reset_cause_for(0x06));
    TEST_ASSERT_EQUAL_UINT8(PROTO_RESET_CAUSE_LOW_POWER, reset_cause_for(0x84));
}

static void clock_source_tells_a_fallback_with_the_pll_from_one_without(void)
{
    TEST_ASSERT_EQUAL_UINT8(PROTO_CLOCK_SOURCE_CRYSTAL_PLL, hello_of(0, false, 168000000).clock_source);
    TEST_ASSERT_EQUAL_UINT8(PROTO_CLOCK_SOURCE_INTERNAL_PLL, hello_of(0, true, 168000000).clock_source);
    TEST_ASSERT_EQUAL_UINT8(PROTO_CLOCK_SOURCE_INTERNAL, hello_of(0, true, 16000000).clock_source);
}

static void parameters_are_listed_read_and_changed(void)
{
    for (uint16_t i = 0; i < PROTO_PARAMETER_COUNT; i++) {
        struct proto_param_list_reply listed;
        ask_words(PROTO_ID_PARAM_LIST, &i, 1);
        TEST_ASSERT_TRUE(
            proto_param_list_reply_decode(&listed, fixture.reply.payload, fixture.reply.payload_length));
        TEST_ASSERT_EQUAL_STRING(proto_parameters[i].name, listed.name);
        TEST_ASSERT_EQUAL_STRING(proto_parameters[i].unit, listed.unit);
        TEST_ASSERT_EQUAL_FLOAT(proto_parameters[i].default_value, listed.value);
        /* Both ends of the range are inside it. */
        fixture_set_parameter(i, listed.minimum);
        fixture_expect_accepted();
        fixture_set_parameter(i, listed.maximum);
        fixture_expect_accepted();
        struct proto_param_get_reply read;
        ask_words(PROTO_ID_PARAM_GET, &i, 1);
        TEST_ASSERT_TRUE(
            proto_param_get_reply_decode(&read, fixture.reply.payload, fixture.reply.payload_length));
        TEST_ASSERT_EQUAL_UINT16(i, read.index);
        TEST_ASSERT_EQUAL_FLOAT(listed.maximum, read.value);
    }
}

static void bad_parameter_values_are_refused_and_the_old_ones_stay(void)
{
    const float bad[] = {0.0f, 10.0f, -1.0f};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        fixture_set_parameter(PROTO_PARAMETER_WHEEL_RADIUS_M, bad[i]);
        fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    }
    fixture_set_parameter(PROTO_PARAMETER_WHEEL_RADIUS_M, NAN);
    fixture_expect_refused(PROTO_REFUSAL_REASON_NOT_FINITE, 1);
    fixture_set_parameter(PROTO_PARAMETER_WHEEL_RADIUS_M, INFINITY);
    fixture_expect_refused(PROTO_REFUSAL_REASON_NOT_FINITE, 1);
    fixture_set_parameter(PROTO_PARAMETER_LOG_RATE_HZ, 20.5f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    fixture_set_parameter(PROTO_PARAMETER_MOTOR_LEFT_REVERSED, 0.5f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    TEST_ASSERT_EQUAL_FLOAT(0.0635f,
                            fixture.controller.robot.parameters.values[PROTO_PARAMETER_WHEEL_RADIUS_M]);
}

static void parameters_do_not_change_while_the_robot_moves(void)
{
    fixture_set_effort(0.1f, 0.1f);
    fixture_set_parameter(PROTO_PARAMETER_EFFORT_LIMIT, 0.5f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_LIVE);
    fixture_stop();
    fixture_run(2000);
    fixture_start(fixture_upload(&short_drive, 1, 0));
    fixture_set_parameter(PROTO_PARAMETER_EFFORT_LIMIT, 0.5f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
}

static uint64_t time_us(void)
{
    static const uint8_t padding[PROTO_TIME_REQUEST_SIZE] = {1, 2, 3};
    struct proto_time_reply reply;
    fixture_ask(PROTO_ID_TIME, padding, sizeof padding);
    TEST_ASSERT_TRUE(proto_time_reply_decode(&reply, fixture.reply.payload, fixture.reply.payload_length));
    TEST_ASSERT_LESS_THAN_UINT16(1000, reply.after_us);
    return (uint64_t)reply.uptime_ms * 1000u + reply.after_us;
}

static void device_time_is_told_to_the_microsecond_and_never_runs_ahead_of_its_ticks(void)
{
    fixture_run(7);
    TEST_ASSERT_EQUAL_UINT64(7000, time_us());
    fixture.board.after_tick_us = 345;
    TEST_ASSERT_EQUAL_UINT64(7345, time_us());
    fixture.board.after_tick_us = 999;
    TEST_ASSERT_EQUAL_UINT64(7999, time_us());
    fixture.board.after_tick_us = 250000; /* as after a save, before the next tick */
    TEST_ASSERT_EQUAL_UINT64(7999, time_us());
    fixture.board.after_tick_us = 0;
    fixture_run(1);
    TEST_ASSERT_EQUAL_UINT64(8000, time_us());
}

static void unknown_requests_are_refused_by_their_id(void)
{
    uint32_t known = 0;
    for (unsigned id = 0; id < 0x80; id++) {
        fixture_ask((uint8_t)id, NULL, 0);
        if (fixture.reply.id == PROTO_ID_REFUSAL &&
            fixture_refusal().reason == PROTO_REFUSAL_REASON_UNKNOWN_REQUEST) {
            TEST_ASSERT_EQUAL_UINT8(id, fixture_refusal().request_id);
            TEST_ASSERT_EQUAL_UINT32(id, fixture_refusal().detail);
        } else {
            known++;
        }
    }
    TEST_ASSERT_EQUAL_UINT32(36, known);
}

static void every_request_of_a_wrong_length_is_refused(void)
{
    static const struct {
        uint8_t id;
        size_t length;
    } right[] = {
        {PROTO_ID_STATUS, 0},       {PROTO_ID_CLEAR_FAULTS, 0}, {PROTO_ID_PARAM_LIST, 2},
        {PROTO_ID_PARAM_GET, 2},    {PROTO_ID_PARAM_SET, 6},    {PROTO_ID_SEQ_BEGIN, 4},
        {PROTO_ID_SEQ_COMMIT, 4},   {PROTO_ID_SEQ_START, 5},    {PROTO_ID_SEQ_ABORT, 0},
        {PROTO_ID_SEQ_STATE, 0},    {PROTO_ID_LOG_LIST, 2},     {PROTO_ID_LOG_READ, 6},
        {PROTO_ID_LOG_DIGEST, 8},   {PROTO_ID_LOG_ERASE, 0},    {PROTO_ID_SET_EFFORT, 8},
        {PROTO_ID_SET_VELOCITY, 8}, {PROTO_ID_CAN_STATE, 0},    {PROTO_ID_TIME, 6},
        {PROTO_ID_ARM, 4},
    };
    static const uint8_t zeros[PROTO_MAX_PAYLOAD];
    for (size_t i = 0; i < sizeof right / sizeof right[0]; i++) {
        fixture_ask(right[i].id, zeros, right[i].length + 1);
        fixture_expect_refused(PROTO_REFUSAL_REASON_BAD_LENGTH, (uint32_t)right[i].length + 1);
        fixture_ask(right[i].id, zeros, PROTO_MAX_PAYLOAD);
        fixture_expect_refused(PROTO_REFUSAL_REASON_BAD_LENGTH, PROTO_MAX_PAYLOAD);
        if (right[i].length > 0) {
            fixture_ask(right[i].id, zeros, right[i].length - 1);
            fixture_expect_refused(PROTO_REFUSAL_REASON_BAD_LENGTH, (uint32_t)right[i].length - 1);
        }
    }
    fixture_begin_upload(3, 0);
    const size_t bad_segments[] = {0, 1, 2, 3, 14, 16, 100};
    for (size_t i = 0; i < sizeof bad_segments / sizeof bad_segments[0]; i++) {
        fixture_ask(PROTO_ID_SEQ_SEGMENTS, zeros, bad_segments[i]);
        fixture_expect_refused(PROTO_REFUSAL_REASON_BAD_LENGTH, (uint32_t)bad_segments[i]);
    }
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_IDLE, fixture_status().state);
}

static void unknown_parameters_are_refused_by_their_index(void)
{
    const uint16_t index = PROTO_PARAMETER_COUNT;
    ask_words(PROTO_ID_PARAM_LIST, &index, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_UNKNOWN_PARAMETER, index);
    ask_words(PROTO_ID_PARAM_GET, &index, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_UNKNOWN_PARAMETER, index);
    fixture_set_parameter(0xFFFF, 1.0f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_UNKNOWN_PARAMETER, 0xFFFF);
}

/* Fills the ring until its first blocks are gone. */
static void wrap_ring(void)
{
    const struct proto_segment minutes = {PROTO_SEGMENT_KIND_EFFORT, 600000, 0.0f, 0.0f};
    fixture_start(fixture_upload(&minutes, 1, 200));
    while (log_oldest_offset(&fixture.controller.robot.log) == 0) {
        fixture.board.sample.battery_mv = (uint16_t)(11000 + random_below(2000));
        fixture_run(1);
    }
}

static void reading_outside_the_log_is_refused_by_name(void)
{
    ask_log_read(0, 512);
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_BEYOND_END, 0);
    wrap_ring();
    const uint32_t oldest = fixture_list_logs(0).oldest_offset;
    const uint32_t end = fixture_list_logs(0).end_offset;
    TEST_ASSERT_TRUE(oldest > 0 && end > oldest);
    ask_log_read(oldest - 1, 100);
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_GONE, oldest);
    ask_log_read(end, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_BEYOND_END, end);
    ask_log_read(0x7FFFFFFF, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_BEYOND_END, end);
    ask_log_read(oldest, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    ask_log_read(oldest, 1021);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    ask_log_read(oldest, 1020);
    fixture_expect_accepted();
    TEST_ASSERT_EQUAL(1024, fixture.reply.payload_length);
    ask_log_read(end - 3, 1020); /* what there is */
    fixture_expect_accepted();
    TEST_ASSERT_EQUAL(4 + 3, fixture.reply.payload_length);
    ask_log_digest(oldest - 1, 10);
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_GONE, oldest);
    ask_log_digest(oldest, end - oldest + 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_BEYOND_END, end);
    ask_log_digest(oldest, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    fixture_ask(PROTO_ID_LOG_ERASE, NULL, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0);
}

static void digest_is_the_crc_of_the_bytes_that_are_read(void)
{
    static uint8_t bytes[HAL_LOG_MEMORIES * HAL_HOST_LOG_SIZE];
    struct proto_log_digest_reply digest;
    wrap_ring();
    fixture_stop();
    fixture_run(1);
    const struct proto_log_list_reply list = fixture_list_logs(0);
    const uint32_t oldest = list.oldest_offset;
    const uint32_t size = list.end_offset - oldest;
    fixture_read_log(oldest, bytes, size);
    ask_log_digest(oldest, size);
    TEST_ASSERT_TRUE(
        proto_log_digest_reply_decode(&digest, fixture.reply.payload, fixture.reply.payload_length));
    TEST_ASSERT_EQUAL_HEX32(crc32_update(0, bytes, size), digest.crc32);
    /* The bytes on the link are those in memory. */
    const uint32_t first_cells = (uint32_t)fixture.board.log_memory_size[0] / PROTO_LOG_CELL_SIZE;
    for (uint32_t i = 0; i < size; i += PROTO_LOG_CELL_SIZE) {
        const uint32_t cell = (oldest + i) / PROTO_LOG_CELL_SIZE % fixture.controller.robot.log.cells;
        const uint8_t *const held =
            cell < first_cells ? fixture.board.log_memory[0] + cell * PROTO_LOG_CELL_SIZE
                               : fixture.board.log_memory[1] + (cell - first_cells) * PROTO_LOG_CELL_SIZE;
        TEST_ASSERT_EQUAL_INT(0, memcmp(bytes + i, held, PROTO_LOG_CELL_SIZE));
    }
}

static void log_list_comes_in_parts(void)
{
    enum { LOGS = 300 }; /* more than a byte counts */
    const uint32_t crc = fixture_upload(&short_drive, 1, 0);
    fixture_set_parameter(PROTO_PARAMETER_EFFORT_LIMIT, 0.5f);
    fixture.motors_turn = false;
    for (int i = 0; i < LOGS; i++) {
        fixture_start(crc);
        fixture_run(102);
    }
    uint16_t expected_id = 1;
    for (uint16_t first = 0; first < LOGS;) {
        const struct proto_log_list_reply list = fixture_list_logs(first);
        TEST_ASSERT_EQUAL_UINT16(LOGS, list.total);
        TEST_ASSERT_TRUE(list.entries_count > 0);
        for (size_t i = 0; i < list.entries_count; i++) {
            struct proto_log_entry entry;
            TEST_ASSERT_TRUE(proto_log_entry_decode(&entry, list.entries + i * PROTO_LOG_ENTRY_SIZE,
                                                    PROTO_LOG_ENTRY_SIZE));
            TEST_ASSERT_EQUAL_UINT16(expected_id, entry.log_id);
            TEST_ASSERT_EQUAL_HEX32(crc, entry.sequence_crc);
            expected_id++;
        }
        first = (uint16_t)(first + list.entries_count);
    }
    TEST_ASSERT_EQUAL(0, fixture_list_logs(LOGS).entries_count);
    TEST_ASSERT_EQUAL(0, fixture_list_logs(UINT16_MAX).entries_count);
    fixture_ask(PROTO_ID_LOG_ERASE, NULL, 0);
    fixture_expect_accepted();
    TEST_ASSERT_EQUAL_UINT16(0, fixture_list_logs(0).total);
}

static void live_drive_has_a_log_of_its_own(void)
{
    fixture_set_effort(0.2f, 0.2f);
    for (int i = 0; i < 10; i++) {
        fixture_run(100);
        fixture_set_effort(0.2f, 0.2f);
    }
    fixture_stop();
    fixture_run(1);
    const struct proto_log_entry entry = fixture_newest_log();
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_STOPPED, entry.end);
    TEST_ASSERT_EQUAL_HEX32(0, entry.sequence_crc);
    TEST_ASSERT_EQUAL_UINT32(21, entry.record_count);
}

/* Sends the same frame again and returns the reply's payload length. */
static void repeat(uint8_t id, const void *payload, size_t length)
{
    fixture_say(id, fixture.sequence, payload, length);
    controller_poll(&fixture.controller);
    TEST_ASSERT_TRUE(fixture_hear());
    TEST_ASSERT_EQUAL_UINT16(fixture.sequence, fixture.reply.sequence);
}

static void repeated_start_is_not_carried_out_twice(void)
{
    const uint32_t crc = fixture_upload(&short_drive, 1, 0);
    const uint16_t id = fixture_start(crc);
    const uint8_t payload[5] = {(uint8_t)crc, (uint8_t)(crc >> 8), (uint8_t)(crc >> 16), (uint8_t)(crc >> 24),
                                1};
    fixture_run(5);
    repeat(PROTO_ID_SEQ_START, payload, 5); /* while it runs */
    TEST_ASSERT_EQUAL_HEX8(PROTO_ID_SEQ_START | PROTO_REPLY_BIT, fixture.reply.id);
    TEST_ASSERT_EQUAL_UINT16(id, fixture.reply.payload[0] | fixture.reply.payload[1] << 8);
    fixture_run(200);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    repeat(PROTO_ID_SEQ_START, payload, 5); /* long after: the reply again, and no motion */
    fixture_run(5);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    TEST_ASSERT_EQUAL_UINT16(1, fixture_list_logs(0).total);
}

static void repeated_segments_are_stored_once(void)
{
    uint8_t payload[2 + PROTO_SEGMENT_SIZE] = {0, 0};
    (void)fixture_pack(&short_drive, 1, payload + 2);
    fixture_begin_upload(2, 0);
    fixture_send_segments(0, &short_drive, 1);
    fixture_expect_accepted();
    repeat(PROTO_ID_SEQ_SEGMENTS, payload, sizeof payload);
    fixture_expect_accepted(); /* not a gap: it is the same frame */
    fixture_send_segments(1, &short_drive, 1);
    fixture_expect_accepted();
}

static void repeated_refusal_is_the_same_refusal(void)
{
    fixture.board.sample.battery_valid = false;
    fixture_run(1);
    const struct proto_set_effort_request request = {.left = 0.1f, .right = 0.1f};
    uint8_t payload[PROTO_SET_EFFORT_REQUEST_SIZE];
    (void)proto_set_effort_request_encode(&request, payload, sizeof payload);
    fixture_ask(PROTO_ID_SET_EFFORT, payload, sizeof payload);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_BATTERY_UNREAD);
    fixture.board.sample.battery_valid = true;
    fixture_run(1);
    repeat(PROTO_ID_SET_EFFORT, payload, sizeof payload);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_BATTERY_UNREAD);
    fixture_run(2);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
}

static void repeated_live_command_does_not_keep_the_drive_alive(void)
{
    const struct proto_set_effort_request request = {.left = 0.1f, .right = 0.1f};
    uint8_t payload[PROTO_SET_EFFORT_REQUEST_SIZE];
    (void)proto_set_effort_request_encode(&request, payload, sizeof payload);
    fixture_ask(PROTO_ID_SET_EFFORT, payload, sizeof payload);
    for (int i = 0; i < 10; i++) {
        fixture_run(50);
        repeat(PROTO_ID_SET_EFFORT, payload, sizeof payload);
    }
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_STOPPED, fixture_status().state);
}

static void repeated_stop_stops_again(void)
{
    fixture_stop();
    const uint16_t sequence = fixture.sequence;
    fixture_set_effort(0.2f, 0.2f);
    fixture_run(1);
    fixture.sequence = sequence;
    repeat(PROTO_ID_STOP, NULL, 0);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_IDLE, fixture_status().state);
}

static void same_request_with_a_new_number_is_a_new_request(void)
{
    const uint32_t crc = fixture_upload(&short_drive, 1, 0);
    TEST_ASSERT_EQUAL_UINT16(1, fixture_start(crc));
    fixture_run(3000);
    TEST_ASSERT_EQUAL_UINT16(2, fixture_start(crc));
}

static void host_that_starts_anew_is_not_answered_from_the_past(void)
{
    const uint8_t hello[PROTO_HELLO_REQUEST_SIZE] = {1};
    const uint32_t crc = fixture_upload(&short_drive, 1, 0);
    const uint16_t before = fixture.sequence;
    TEST_ASSERT_EQUAL_UINT16(1, fixture_start(crc));
    fixture_run(3000);
    fixture_ask(PROTO_ID_HELLO, hello, sizeof hello);
    fixture.sequence = before; /* the new host counts as the old one did: its start is the same frame */
    TEST_ASSERT_EQUAL_UINT16(2, fixture_start(crc));
    fixture_run(3);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
}

static void replies_of_another_board_are_no_requests(void)
{
    for (unsigned id = 0x80; id <= 0xFF; id++) {
        fixture_say((uint8_t)id, 1, NULL, 0);
        controller_poll(&fixture.controller);
        TEST_ASSERT_FALSE(fixture_hear());
    }
}

static void say_log_read(uint16_t sequence, uint32_t offset)
{
    const struct proto_log_read_request request = {.offset = offset, .length = 1000};
    uint8_t payload[PROTO_LOG_READ_REQUEST_SIZE];
    (void)proto_log_read_request_encode(&request, payload, sizeof payload);
    fixture_say(PROTO_ID_LOG_READ, sequence, payload, sizeof payload);
}

static void replies_come_in_the_order_of_the_requests(void)
{
    wrap_ring();
    fixture_stop();
    fixture_run(1);
    const uint32_t oldest = fixture_list_logs(0).oldest_offset;
    for (uint16_t i = 0; i < 3; i++) {
        say_log_read(i, oldest + 1000u * i);
    }
    uint16_t next = 0;
    for (int i = 0; i < 20000 && next < 60; i++) {
        fixture.board.line_room = 92; /* bytes in a millisecond at 921600 baud */
        controller_poll(&fixture.controller);
        if (fixture_hear()) {
            TEST_ASSERT_EQUAL_UINT16(next, fixture.reply.sequence);
            TEST_ASSERT_EQUAL(1004, fixture.reply.payload_length);
            next++;
            say_log_read((uint16_t)(next + 2), oldest + 1000u * (next + 2u)); /* always three under way */
        }
    }
    TEST_ASSERT_EQUAL_UINT16(60, next);
    fixture.board.line_room = SIZE_MAX;
}

static void request_without_room_for_its_reply_changes_nothing_and_can_be_repeated(void)
{
    const uint32_t crc = fixture_upload(&short_drive, 1, 0);
    const uint8_t payload[5] = {(uint8_t)crc, (uint8_t)(crc >> 8), (uint8_t)(crc >> 16), (uint8_t)(crc >> 24),
                                1};
    fixture.board.line_room = 0;
    for (uint16_t i = 0; i < 200; i++) {
        fixture_say(PROTO_ID_STATUS, i, NULL, 0);
        controller_poll(&fixture.controller);
    }
    fixture_say(PROTO_ID_SEQ_START, 1000, payload, sizeof payload);
    fixture_run(5);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    fixture.board.line_room = SIZE_MAX;
    controller_poll(&fixture.controller);
    TEST_ASSERT_TRUE(fixture_hear());
    TEST_ASSERT_TRUE(fixture.reply.sequence < 200);
    fixture_say(PROTO_ID_SEQ_START, 1000, payload, sizeof payload);
    fixture_run(5);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
}

static void stop_is_obeyed_and_answered_however_busy_the_line_is(void)
{
    fixture_set_effort(0.3f, 0.3f);
    fixture_run(200);
    fixture.board.line_room = 0;
    for (uint16_t i = 0; i < 300; i++) {
        const uint8_t first = 0;
        fixture_say(i % 2 == 0 ? PROTO_ID_LOG_LIST : PROTO_ID_STATUS, i, &first, i % 2 == 0 ? 1 : 0);
    }
    fixture_say(PROTO_ID_STOP, 1000, NULL, 0);
    controller_poll(&fixture.controller);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    fixture.board.line_room = SIZE_MAX;
    controller_poll(&fixture.controller);
    TEST_ASSERT_TRUE(fixture_hear());
    TEST_ASSERT_EQUAL_UINT16(1000, fixture.reply.sequence);
}

static void status_tells_what_the_robot_does(void)
{
    fixture_set_velocity(0.3f, 0.4f);
    fixture_run(400);
    fixture_set_velocity(0.3f, 0.4f);
    fixture_run(400);
    const struct proto_status_reply status = fixture_status();
    TEST_ASSERT_EQUAL_UINT32(800, status.uptime_ms);
    TEST_ASSERT_EQUAL_UINT8(PROTO_MODE_VELOCITY, status.mode);
    TEST_ASSERT_EQUAL_UINT8(1, status.log_open);
    TEST_ASSERT_EQUAL_UINT16(12000, status.battery_mv);
    TEST_ASSERT_INT_WITHIN(15, 300, status.speed_mmps[0]);
    TEST_ASSERT_INT_WITHIN(15, 400, status.speed_mmps[1]);
    TEST_ASSERT_EQUAL_INT32(fixture.board.sample.counts[1], status.counts[1]);
    TEST_ASSERT_TRUE(status.x_mm > 200);
    TEST_ASSERT_TRUE(status.theta_e4 > 0);
}

static void damaged_frames_are_counted_and_answered_by_nothing(void)
{
    uint8_t bytes[64];
    const size_t size = frame_encode(PROTO_ID_STATUS, 9, NULL, 0, bytes, sizeof bytes);
    bytes[2] ^= 0x10;
    (void)hal_host_receive(&fixture.board, bytes, size);
    controller_poll(&fixture.controller);
    TEST_ASSERT_FALSE(fixture_hear());
    TEST_ASSERT_EQUAL_UINT32(1, fixture_status().frames_dropped);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(hello_tells_who_is_there_and_what_it_holds);
    RUN_TEST(hello_of_a_later_version_may_be_longer);
    RUN_TEST(reset_cause_is_read_from_the_flags_of_the_reference_manual);
    RUN_TEST(clock_source_tells_a_fallback_with_the_pll_from_one_without);
    RUN_TEST(parameters_are_listed_read_and_changed);
    RUN_TEST(bad_parameter_values_are_refused_and_the_old_ones_stay);
    RUN_TEST(parameters_do_not_change_while_the_robot_moves);
    RUN_TEST(device_time_is_told_to_the_microsecond_and_never_runs_ahead_of_its_ticks);
    RUN_TEST(unknown_requests_are_refused_by_their_id);
    RUN_TEST(every_request_of_a_wrong_length_is_refused);
    RUN_TEST(unknown_parameters_are_refused_by_their_index);
    RUN_TEST(reading_outside_the_log_is_refused_by_name);
    RUN_TEST(digest_is_the_crc_of_the_bytes_that_are_read);
    RUN_TEST(log_list_comes_in_parts);
    RUN_TEST(live_drive_has_a_log_of_its_own);
    RUN_TEST(repeated_start_is_not_carried_out_twice);
    RUN_TEST(repeated_segments_are_stored_once);
    RUN_TEST(repeated_refusal_is_the_same_refusal);
    RUN_TEST(repeated_live_command_does_not_keep_the_drive_alive);
    RUN_TEST(repeated_stop_stops_again);
    RUN_TEST(same_request_with_a_new_number_is_a_new_request);
    RUN_TEST(host_that_starts_anew_is_not_answered_from_the_past);
    RUN_TEST(replies_of_another_board_are_no_requests);
    RUN_TEST(replies_come_in_the_order_of_the_requests);
    RUN_TEST(request_without_room_for_its_reply_changes_nothing_and_can_be_repeated);
    RUN_TEST(stop_is_obeyed_and_answered_however_busy_the_line_is);
    RUN_TEST(status_tells_what_the_robot_does);
    RUN_TEST(damaged_frames_are_counted_and_answered_by_nothing);
    return UNITY_END();
}
