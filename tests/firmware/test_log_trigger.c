/* An armed log keeps the data around its trigger, cannot be read before it is complete, and takes no more
 * memory from older logs than what it keeps. */

#include "fixture.h"

#include "log_decoder.h"

void setUp(void);
void tearDown(void);

enum { MAX_RECORDS = 20000, INTERVAL_MS = 50 };

static struct proto_log_record records[MAX_RECORDS];

void setUp(void)
{
    fixture_power_up();
    fixture_run(300);
}

void tearDown(void)
{
}

static void ask_to_arm(struct proto_log_arm_request request)
{
    uint8_t payload[PROTO_LOG_ARM_REQUEST_SIZE];
    fixture_ask(PROTO_ID_LOG_ARM, payload, proto_log_arm_request_encode(&request, payload, sizeof payload));
}

static uint16_t armed(struct proto_log_arm_request request)
{
    struct proto_log_arm_reply reply;
    ask_to_arm(request);
    fixture_expect_accepted();
    TEST_ASSERT_TRUE(proto_log_arm_reply_decode(&reply, fixture.reply.payload, fixture.reply.payload_length));
    return reply.log_id;
}

static uint16_t arm_fault(uint32_t before_ms, uint32_t after_ms)
{
    return armed((struct proto_log_arm_request){
        .kind = PROTO_LOG_TRIGGER_KIND_FAULT, .before_ms = before_ms, .after_ms = after_ms});
}

static uint16_t arm_threshold(uint8_t signal, uint8_t edge, int32_t level, uint32_t before_ms,
                              uint32_t after_ms)
{
    return armed((struct proto_log_arm_request){.kind = PROTO_LOG_TRIGGER_KIND_THRESHOLD,
                                                .signal = signal,
                                                .edge = edge,
                                                .level = level,
                                                .before_ms = before_ms,
                                                .after_ms = after_ms});
}

static void disarm(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, armed((struct proto_log_arm_request){0}));
}

static struct proto_log_trigger_reply told(void)
{
    struct proto_log_trigger_reply reply;
    fixture_ask(PROTO_ID_LOG_TRIGGER, NULL, 0);
    TEST_ASSERT_TRUE(
        proto_log_trigger_reply_decode(&reply, fixture.reply.payload, fixture.reply.payload_length));
    return reply;
}

static void drive(float left, float right, uint32_t ms)
{
    for (uint32_t done = 0; done < ms; done += 100) {
        fixture_set_effort(left, right);
        fixture_expect_accepted();
        fixture_run(100);
    }
}

/* The host stops sending while it drives: a fault that stops, latched at the last tick of this. */
static void fall_silent(void)
{
    uint32_t waited = 0;
    while (fixture_status().state == PROTO_STATE_LIVE && waited < 5000) {
        fixture_run(1);
        waited++;
    }
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_STOPPED, fixture_status().state);
}

static void clear_faults(void)
{
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_accepted();
}

/* Decodes the whole of a log as it lies in the ring; returns the number of its records. */
static uint32_t decode(const struct proto_log_entry *entry)
{
    uint32_t count = 0;
    uint32_t cell = entry->first_cell;
    while (cell < entry->first_cell + entry->cell_count) {
        uint8_t block[PROTO_LOG_BLOCK_LIMIT] = {0};
        const uint32_t offset = cell * PROTO_LOG_CELL_SIZE;
        const uint32_t left = log_end_offset(&fixture.controller.robot.log) - offset;
        log_copy(&fixture.controller.robot.log, offset, block, left < sizeof block ? left : sizeof block);
        const int found =
            log_decoder_block(block, cell, entry->log_id, records + count, (int)(MAX_RECORDS - count));
        TEST_ASSERT_TRUE(found > 0);
        count += (uint32_t)found;
        cell += log_decoder_span(block) / PROTO_LOG_CELL_SIZE;
    }
    return count;
}

/* Records of the decoded log whose time lies in (from, to]. */
static uint32_t within(uint32_t count, uint32_t from_ms, uint32_t to_ms)
{
    uint32_t found = 0;
    for (uint32_t i = 0; i < count; i++) {
        found += records[i].t_ms > from_ms && records[i].t_ms <= to_ms ? 1u : 0u;
    }
    return found;
}

/* The newest log is the triggered one, and holds the requested span and little more. */
static void check_log(uint16_t log_id, uint32_t before_ms, uint32_t after_ms)
{
    const struct proto_log_trigger_reply trigger = told();
    const struct proto_log_entry entry = fixture_newest_log();
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_DONE, trigger.state);
    TEST_ASSERT_EQUAL_UINT16(log_id, trigger.log_id);
    TEST_ASSERT_EQUAL_UINT16(log_id, entry.log_id);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_TRIGGERED, entry.end);
    TEST_ASSERT_EQUAL_UINT32(entry.start_ms + trigger.fired_t_ms, trigger.fired_ms);
    const uint32_t count = decode(&entry);
    const uint32_t fired = trigger.fired_t_ms;
    TEST_ASSERT_TRUE(within(count, fired - before_ms, fired) >= before_ms / INTERVAL_MS);
    TEST_ASSERT_TRUE(within(count, fired, UINT32_MAX) >= after_ms / INTERVAL_MS);
    TEST_ASSERT_TRUE(records[count - 1].t_ms >= fired + after_ms);
    TEST_ASSERT_TRUE(records[count - 1].t_ms <= fired + after_ms + 1);
    const uint32_t block_ms = before_ms / 8 > 1000 ? before_ms / 8 : 1000;
    TEST_ASSERT_TRUE(fired - records[0].t_ms <= before_ms + block_ms);
    for (uint32_t i = 1; i < count; i++) {
        TEST_ASSERT_TRUE(records[i].t_ms > records[i - 1].t_ms);
        TEST_ASSERT_TRUE(records[i].t_ms - records[i - 1].t_ms <= INTERVAL_MS);
    }
}

static void fault_is_kept_with_what_went_before_and_came_after(void)
{
    const uint16_t log_id = arm_fault(5000, 2000);
    TEST_ASSERT_NOT_EQUAL(0, log_id);
    drive(0.3f, 0.3f, 20000);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_ARMED, told().state);
    TEST_ASSERT_EQUAL_UINT16(0, fixture_list_logs(0).total);
    fall_silent();
    struct proto_log_trigger_reply trigger = told();
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_FIRED, trigger.state);
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_HOST_SILENT, trigger.faults);
    fixture_run(1900);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_FIRED, told().state);
    TEST_ASSERT_EQUAL_UINT16(0, fixture_list_logs(0).total);
    fixture_run(200);
    check_log(log_id, 5000, 2000);
    TEST_ASSERT_EQUAL_UINT8(0, fixture_status().log_open);
}

static void triggered_log_shows_the_fault_from_its_time_on(void)
{
    (void)arm_fault(1000, 500);
    drive(0.3f, 0.3f, 3000);
    fall_silent();
    fixture_run(600);
    const struct proto_log_entry entry = fixture_newest_log();
    const uint32_t fired = told().fired_t_ms;
    const uint32_t count = decode(&entry);
    for (uint32_t i = 0; i < count; i++) {
        TEST_ASSERT_EQUAL_INT(records[i].t_ms >= fired, (records[i].faults & PROTO_FAULT_HOST_SILENT) != 0);
    }
}

static void signal_fires_where_it_crosses_the_level_and_not_where_it_is_beyond_from_the_start(void)
{
    fixture.motors_turn = false;
    fixture.board.sample.counts[0] = 500;
    fixture_run(50);
    const uint16_t above = arm_threshold(PROTO_SIGNAL_COUNTS_LEFT, PROTO_LOG_EDGE_ABOVE, 100, 200, 100);
    fixture_run(400);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_ARMED, told().state);
    fixture.board.sample.counts[0] = 100; /* at the level is not above it */
    fixture_run(400);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_ARMED, told().state);
    fixture.board.sample.counts[0] = 101;
    fixture_run(1);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_FIRED, told().state);
    TEST_ASSERT_EQUAL_INT32(101, told().value);
    TEST_ASSERT_EQUAL_HEX32(0, told().faults);
    TEST_ASSERT_EQUAL_UINT32(fixture_status().uptime_ms, told().fired_ms);
    fixture_run(150);
    check_log(above, 200, 100);
}

static void signal_may_fall_below_a_level(void)
{
    fixture.board.sample.battery_mv = 12000;
    const uint16_t log_id = arm_threshold(PROTO_SIGNAL_BATTERY, PROTO_LOG_EDGE_BELOW, 1150, 0, 0);
    fixture_run(300);
    fixture.board.sample.battery_mv = 11504;
    fixture_run(300);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_ARMED, told().state);
    fixture.board.sample.battery_mv = 11490;
    fixture_run(3);
    TEST_ASSERT_EQUAL_INT32(1149, told().value);
    check_log(log_id, 0, 0);
}

static void log_armed_for_an_hour_leaves_the_older_logs_alone(void)
{
    static const struct proto_segment segment = {PROTO_SEGMENT_KIND_EFFORT, 2000, 0.3f, 0.3f};
    const uint16_t first = fixture_start(fixture_upload(&segment, 1, 20));
    fixture_run(10000);
    const struct proto_log_entry before = fixture_newest_log();
    TEST_ASSERT_EQUAL_UINT16(first, before.log_id);
    const uint32_t oldest = log_oldest_offset(&fixture.controller.robot.log);
    const uint16_t log_id = arm_fault(3000, 1000);
    drive(0.35f, 0.3f, 3600000);
    const struct log *const log = &fixture.controller.robot.log;
    TEST_ASSERT_EQUAL_UINT32(oldest, log_oldest_offset(log));
    TEST_ASSERT_TRUE((log->end_cell - log->hidden_cell) * PROTO_LOG_CELL_SIZE < 1500);
    fall_silent();
    fixture_run(1100);
    check_log(log_id, 3000, 1000);
    TEST_ASSERT_EQUAL_UINT16(2, fixture_list_logs(0).total);
    TEST_ASSERT_EQUAL_UINT8(1, fixture_newest_log().truncated);
}

static void long_time_before_and_after_fits_the_ring_by_the_rule_that_admits_it(void)
{
    const uint32_t memory = fixture.controller.robot.log.cells * PROTO_LOG_CELL_SIZE;
    const uint32_t max_ms = memory / LOG_TRIGGER_RECORD_BYTES * 1000u / 20u;
    const uint16_t log_id = arm_fault(max_ms - 1000, 1000);
    drive(0.3f, 0.35f, max_ms + 20000);
    fall_silent();
    fixture_run(1100);
    check_log(log_id, max_ms - 1000, 1000);
}

static void disarmed_log_leaves_nothing_and_drives_have_logs_again(void)
{
    (void)arm_fault(5000, 2000);
    drive(0.3f, 0.3f, 12000);
    const uint32_t end = log_end_offset(&fixture.controller.robot.log);
    fixture_stop();
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_ARMED, told().state); /* a stop is no fault */
    fixture_run(100);
    disarm();
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_IDLE, told().state);
    fixture_run(2);
    TEST_ASSERT_EQUAL_UINT8(0, fixture_status().log_open);
    TEST_ASSERT_EQUAL_UINT16(0, fixture_list_logs(0).total);
    TEST_ASSERT_EQUAL_UINT32(end, log_end_offset(&fixture.controller.robot.log));
    drive(0.3f, 0.3f, 1000);
    fixture_stop();
    fixture_run(2);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_STOPPED, fixture_newest_log().end);
    TEST_ASSERT_EQUAL_UINT32(0, log_oldest_offset(&fixture.controller.robot.log));
}

static void log_disarmed_before_its_first_tick_leaves_nothing_either(void)
{
    (void)arm_fault(1000, 1000);
    disarm();
    fixture_run(3);
    TEST_ASSERT_EQUAL_UINT16(0, fixture_list_logs(0).total);
    TEST_ASSERT_EQUAL_UINT8(0, fixture_status().log_open);
    /* And at once again. */
    (void)arm_fault(1000, 100);
    fixture_run(1);
    disarm();
    const uint16_t log_id = arm_fault(1000, 100);
    drive(0.2f, 0.2f, 2000);
    fall_silent();
    fixture_run(200);
    check_log(log_id, 1000, 100);
    TEST_ASSERT_EQUAL_UINT16(1, fixture_list_logs(0).total);
}

static void disarming_after_the_trigger_ends_the_log_at_once_and_keeps_it(void)
{
    (void)arm_fault(1000, 60000);
    drive(0.2f, 0.2f, 3000);
    fall_silent();
    fixture_run(500);
    disarm();
    fixture_run(2);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_DONE, told().state);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_TRIGGERED, fixture_newest_log().end);
    TEST_ASSERT_TRUE(fixture_newest_log().record_count > 0);
    disarm();
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_IDLE, told().state);
    TEST_ASSERT_EQUAL_UINT16(1, fixture_list_logs(0).total);
}

static void triggered_log_outlasts_the_fault_s_clearing_and_a_new_drive(void)
{
    const uint16_t log_id = arm_fault(1000, 5000);
    drive(0.2f, 0.2f, 2000);
    fall_silent();
    clear_faults();
    drive(0.2f, 0.2f, 2000);
    fixture_stop();
    fixture_run(3100);
    check_log(log_id, 1000, 5000);
    TEST_ASSERT_EQUAL_UINT16(1, fixture_list_logs(0).total);
}

static void one_log_at_a_time(void)
{
    static const struct proto_segment segment = {PROTO_SEGMENT_KIND_EFFORT, 500, 0.3f, 0.3f};
    const struct proto_log_arm_request fault = {.kind = PROTO_LOG_TRIGGER_KIND_FAULT, .before_ms = 1000};
    const uint32_t crc = fixture_upload(&segment, 1, 20);
    (void)fixture_start(crc);
    ask_to_arm(fault);
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0);
    fixture_run(4000);
    (void)armed(fault);
    fixture_ask_start(crc, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0);
    ask_to_arm(fault);
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0);
    fixture_ask(PROTO_ID_LOG_ERASE, NULL, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0);
    fixture_set_parameter(PROTO_PARAMETER_WHEEL_RADIUS_M, 0.05f); /* a log is of one set of parameters */
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0);
    fixture_ask(PROTO_ID_PARAM_SAVE, NULL, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0);
    disarm();
    fixture_run(2);
    (void)fixture_start(crc);
    fixture_run(4000);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_FINISHED, fixture_newest_log().end);
}

static void what_makes_no_sense_is_refused_by_the_field(void)
{
    const uint32_t max_ms =
        fixture.controller.robot.log.cells * PROTO_LOG_CELL_SIZE / LOG_TRIGGER_RECORD_BYTES * 1000u / 20u;
    const struct {
        struct proto_log_arm_request request;
        uint32_t field;
    } cases[] = {
        {{.kind = PROTO_LOG_TRIGGER_KIND_FAULT + 1}, 0},
        {{.kind = PROTO_LOG_TRIGGER_KIND_THRESHOLD, .signal = PROTO_SIGNAL_BATTERY + 1}, 1},
        {{.kind = PROTO_LOG_TRIGGER_KIND_THRESHOLD, .signal = PROTO_SIGNAL_FAULTS}, 1},
        {{.kind = PROTO_LOG_TRIGGER_KIND_THRESHOLD, .signal = PROTO_SIGNAL_CMD_LEFT}, 1},
        {{.kind = PROTO_LOG_TRIGGER_KIND_THRESHOLD, .signal = PROTO_SIGNAL_CMD_RIGHT}, 1},
        {{.kind = PROTO_LOG_TRIGGER_KIND_THRESHOLD, .edge = PROTO_LOG_EDGE_BELOW + 1}, 2},
        {{.kind = PROTO_LOG_TRIGGER_KIND_FAULT, .before_ms = max_ms + 1}, 4},
        {{.kind = PROTO_LOG_TRIGGER_KIND_FAULT, .before_ms = UINT32_MAX}, 4},
        {{.kind = PROTO_LOG_TRIGGER_KIND_FAULT, .before_ms = max_ms, .after_ms = 1}, 5},
        {{.kind = PROTO_LOG_TRIGGER_KIND_FAULT, .after_ms = UINT32_MAX}, 5},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        ask_to_arm(cases[i].request);
        fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, cases[i].field);
        TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_IDLE, told().state);
    }
    fixture_ask(PROTO_ID_LOG_ARM, "", 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_BAD_LENGTH, 1);
    fixture_ask(PROTO_ID_LOG_TRIGGER, "", 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_BAD_LENGTH, 1);
    TEST_ASSERT_EQUAL_UINT8(0, fixture_status().log_open);
}

static void armed_log_on_bad_memory_ends_and_breaks_nothing(void)
{
    (void)arm_fault(8000, 500);
    drive(0.3f, 0.3f, 6000);
    memset(fixture.board.log_memory, 0xFF, sizeof fixture.board.log_memory);
    drive(0.3f, 0.3f, 6000);
    memset(fixture.board.log_memory, 0, sizeof fixture.board.log_memory);
    drive(0.3f, 0.3f, 6000);
    fall_silent();
    fixture_run(600);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_TRIGGER_STATE_DONE, told().state);
    TEST_ASSERT_TRUE(fixture_list_logs(0).total <= 2);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(fault_is_kept_with_what_went_before_and_came_after);
    RUN_TEST(triggered_log_shows_the_fault_from_its_time_on);
    RUN_TEST(signal_fires_where_it_crosses_the_level_and_not_where_it_is_beyond_from_the_start);
    RUN_TEST(signal_may_fall_below_a_level);
    RUN_TEST(log_armed_for_an_hour_leaves_the_older_logs_alone);
    RUN_TEST(long_time_before_and_after_fits_the_ring_by_the_rule_that_admits_it);
    RUN_TEST(disarmed_log_leaves_nothing_and_drives_have_logs_again);
    RUN_TEST(log_disarmed_before_its_first_tick_leaves_nothing_either);
    RUN_TEST(disarming_after_the_trigger_ends_the_log_at_once_and_keeps_it);
    RUN_TEST(triggered_log_outlasts_the_fault_s_clearing_and_a_new_drive);
    RUN_TEST(one_log_at_a_time);
    RUN_TEST(what_makes_no_sense_is_refused_by_the_field);
    RUN_TEST(armed_log_on_bad_memory_ends_and_breaks_nothing);
    return UNITY_END();
}
