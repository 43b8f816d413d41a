/* Conditions that stop the robot, that prevent motion, and that allow it again. */
#include "fixture.h"

void setUp(void)
{
    fixture_power_up();
}

void tearDown(void)
{
}

static const struct proto_segment two_seconds = {PROTO_SEGMENT_KIND_EFFORT, 2000, 0.3f, 0.3f};

static void assert_braked(void)
{
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[1]);
}

/* Live at 30 %, with a command every 100 ms. */
static void drive_live(uint32_t ms)
{
    for (uint32_t i = 0; i < ms; i++) {
        if (i % 100 == 0) {
            fixture_set_effort(0.3f, 0.3f);
            fixture_expect_accepted();
        }
        fixture_run(1);
    }
}

static void host_silence_stops_a_live_drive_and_latches(void)
{
    fixture_set_effort(0.3f, 0.3f);
    fixture_run(499);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
    fixture_run(1);
    assert_braked();
    const struct proto_status_reply status = fixture_status();
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_STOPPED, status.state);
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_HOST_SILENT, status.faults_latched);
    fixture_set_effort(0.3f, 0.3f); /* new commands alone are not enough */
    fixture_expect_refused(PROTO_REFUSAL_REASON_FAULT_LATCHED, PROTO_FAULT_HOST_SILENT);
    fixture_run(100);
    assert_braked();
}

static void host_that_keeps_talking_is_obeyed(void)
{
    drive_live(5000);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
}

static void asking_for_status_is_not_driving(void)
{
    fixture_set_effort(0.3f, 0.3f);
    for (int i = 0; i < 10; i++) {
        fixture_run(50);
        (void)fixture_status();
    }
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_STOPPED, fixture_status().state);
}

static void refused_command_does_not_keep_the_drive_alive(void)
{
    fixture_set_effort(0.3f, 0.3f);
    for (int i = 0; i < 10; i++) {
        fixture_run(50);
        TEST_ASSERT_EQUAL_INT16(i < 9 ? 3000 : 0,
                                fixture.board.effort_e4[0]); /* as before, until the time-out */
        fixture_set_effort(NAN, 0.1f);
    }
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_STOPPED, fixture_status().state);
}

static void silence_time_is_the_parameter_s(void)
{
    fixture_set_parameter(PROTO_PARAMETER_COMMAND_TIMEOUT_S, 2.0f);
    fixture_set_velocity(0.2f, 0.2f);
    fixture_run(1999);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_LIVE, fixture_status().state);
    fixture_run(1);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_STOPPED, fixture_status().state);
}

static void cleared_fault_lets_the_host_drive_again(void)
{
    fixture_set_effort(0.3f, 0.3f);
    fixture_run(600);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_accepted();
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_IDLE, fixture_status().state);
    fixture_set_effort(0.3f, 0.3f);
    fixture_expect_accepted();
    fixture_run(3);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
}

static void sequence_whose_host_falls_silent_stops_and_latches(void)
{
    const uint32_t crc = fixture_upload(&two_seconds, 1, 0);
    fixture_ask_start(crc, 0);
    fixture_run(499);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
    (void)fixture_status(); /* any request will do */
    fixture_run(499);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
    fixture_run(1);
    assert_braked();
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_HOST_SILENT, fixture_status().faults_latched);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_FAULT, fixture_newest_log().end);
}

static void sequence_s_silence_time_is_its_own_parameter(void)
{
    fixture_set_parameter(PROTO_PARAMETER_HEARTBEAT_TIMEOUT_S, 0.1f);
    fixture_ask_start(fixture_upload(&two_seconds, 1, 0), 0);
    fixture_run(99);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
    fixture_run(1);
    assert_braked();
}

static void question_on_another_port_does_not_replace_the_sequence_s_host(void)
{
    const struct frame question = {.id = PROTO_ID_STATUS};
    fixture_ask_start(fixture_upload(&two_seconds, 1, 0), 0);
    for (int i = 0; i < 10; i++) {
        fixture_run(49);
        requests_answer(&fixture.controller, PORT_CAN, &question);
    }
    fixture_run(10);
    assert_braked();
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_HOST_SILENT, fixture_status().faults_latched);
}

static void unattended_sequence_goes_on_without_a_host(void)
{
    fixture_ask_start(fixture_upload(&two_seconds, 1, 0), 1);
    fixture_run(1990);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
    fixture_ask_start(0, 2);
    fixture_expect_refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
}

static void nothing_moves_before_this_very_start_has_been_armed(void)
{
    fixture_power_up_unarmed();
    fixture_run(5);
    const uint32_t boot = fixture.board.identity.boot_id;
    const uint32_t crc = fixture_upload(&two_seconds, 1, 0);
    fixture_set_effort(0.3f, 0.3f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_NOT_ARMED, boot);
    fixture_set_velocity(0.3f, 0.3f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_NOT_ARMED, boot);
    fixture_ask_start(crc, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_NOT_ARMED, boot);
    fixture_ask_u32(PROTO_ID_ARM, boot + 1u);
    fixture_expect_refused(PROTO_REFUSAL_REASON_WRONG_BOOT, boot);
    fixture_set_effort(0.3f, 0.3f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_NOT_ARMED, boot);
    fixture_run(10);
    assert_braked();
    fixture_ask_u32(PROTO_ID_ARM, boot);
    fixture_expect_accepted();
    fixture_set_effort(0.3f, 0.3f);
    fixture_expect_accepted();
    controller_init(&fixture.controller);
    fixture_run(5);
    fixture_set_effort(0.3f, 0.3f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_NOT_ARMED, boot);
}

static void emergency_stop_is_latched_and_cleared_only_with_its_contact_closed(void)
{
    drive_live(300);
    fixture.board.emergency_switch_open = true;
    fixture_run(1);
    assert_braked();
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_EMERGENCY_STOP, fixture_status().faults_latched);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_EMERGENCY_STOP);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_STOPPED, fixture_status().state);
    fixture.board.emergency_switch_open = false;
    fixture_run(100);
    fixture_set_effort(0.3f, 0.3f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_FAULT_LATCHED, PROTO_FAULT_EMERGENCY_STOP);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_accepted();
    fixture_run(1);
    fixture_set_effort(0.3f, 0.3f);
    fixture_expect_accepted();
}

static void emergency_stop_pressed_at_rest_forbids_to_begin_until_it_is_cleared(void)
{
    fixture.board.emergency_switch_open = true;
    fixture_run(2);
    fixture.board.emergency_switch_open = false;
    fixture_run(2);
    fixture_set_effort(0.3f, 0.3f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_EMERGENCY_STOP);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_accepted();
    fixture_run(1);
    fixture_set_effort(0.3f, 0.3f);
    fixture_expect_accepted();
}

static void stop_brakes_at_the_next_tick_while_the_main_loop_is_busy(void)
{
    static const uint8_t effort[PROTO_SET_EFFORT_REQUEST_SIZE] = {0, 0, 0x80, 0x3E,
                                                                  0, 0, 0x80, 0x3E}; /* 0.25 */
    for (uint16_t sequence = 0; sequence < 600; sequence++) { /* zeros in the frame, and none */
        fixture_power_up();
        drive_live(100);
        fixture_say(PROTO_ID_SET_EFFORT, 7, effort, sizeof effort);
        fixture_say(PROTO_ID_STOP, sequence, NULL, 0);
        controller_tick(&fixture.controller);
        assert_braked();
        controller_tick(&fixture.controller);
        assert_braked();
        controller_poll(&fixture.controller); /* what arrived before the stop is refused, the stop answered */
        assert_braked();
        TEST_ASSERT_TRUE(fixture_hear());
        TEST_ASSERT_EQUAL_HEX8(PROTO_ID_STOP | PROTO_REPLY_BIT, fixture.reply.id);
        controller_tick(&fixture.controller);
        assert_braked();
        fixture_set_effort(0.25f, 0.25f);
        fixture_expect_accepted();
    }
}

static void damaged_stop_or_another_request_does_not_brake(void)
{
    uint8_t bytes[32];
    drive_live(100);
    const size_t size = frame_encode(PROTO_ID_STOP, 9, NULL, 0, bytes, sizeof bytes);
    for (size_t i = 0; i + 1 < size; i++) {
        bytes[i] ^= 0x10;
        (void)hal_host_receive(&fixture.board, bytes, size);
        bytes[i] ^= 0x10;
    }
    fixture_say(PROTO_ID_STATUS, 10, NULL, 0);
    controller_tick(&fixture.controller);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
}

static void stop_leaves_a_latched_fault_latched(void)
{
    fixture_set_effort(0.3f, 0.3f);
    fixture_run(600);
    fixture_stop();
    fixture_expect_accepted();
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_STOPPED, fixture_status().state);
}

static void encoder_beyond_any_speed_stops_the_wheels(void)
{
    drive_live(300);
    fixture.motors_turn = false;
    for (int i = 0; i < 50 && fixture.board.effort_e4[0] != 0; i++) {
        fixture.board.sample.counts[1] += 60; /* 10 m/s */
        fixture_run(1);
    }
    assert_braked();
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_ENCODER_RIGHT_IMPLAUSIBLE, fixture_status().faults_latched);
}

static void encoder_fault_ends_a_sequence_and_its_log_says_so(void)
{
    fixture_start(fixture_upload(&two_seconds, 1, 0));
    fixture_run(500);
    fixture.motors_turn = false;
    fixture.board.sample.counts[0] -= 10000;
    fixture_run(2);
    assert_braked();
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_ENCODER_LEFT_IMPLAUSIBLE, fixture_status().faults_latched);
    TEST_ASSERT_EQUAL_UINT8(PROTO_LOG_END_FAULT, fixture_newest_log().end);
    struct proto_seq_state_reply state;
    fixture_ask(PROTO_ID_SEQ_STATE, NULL, 0);
    TEST_ASSERT_TRUE(
        proto_seq_state_reply_decode(&state, fixture.reply.payload, fixture.reply.payload_length));
    TEST_ASSERT_EQUAL_UINT8(PROTO_SEQUENCE_STATE_ABORTED, state.sequence_state);
}

static void start_is_refused_while_encoders_run_by_themselves(void)
{
    const uint32_t crc = fixture_upload(&two_seconds, 1, 0);
    fixture.motors_turn = false;
    for (int i = 0; i < 50; i++) {
        fixture.board.sample.counts[0] += 30; /* 5 m/s */
        fixture.board.sample.counts[1] -= 30;
        fixture_run(1);
    }
    const uint32_t both = PROTO_FAULT_ENCODER_LEFT_IMPLAUSIBLE | PROTO_FAULT_ENCODER_RIGHT_IMPLAUSIBLE;
    fixture_ask_start(crc, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, both | PROTO_FAULT_OVERSPEED);
    fixture_set_effort(0.1f, 0.1f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, both | PROTO_FAULT_OVERSPEED);
    fixture_run(10);
    assert_braked();
}

static void start_is_refused_without_a_battery_reading(void)
{
    const uint32_t crc = fixture_upload(&two_seconds, 1, 0);
    fixture.board.sample.battery_valid = false;
    fixture_run(1);
    fixture_ask_start(crc, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_BATTERY_UNREAD);
    fixture_set_velocity(0.1f, 0.1f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_BATTERY_UNREAD);
    TEST_ASSERT_EQUAL_UINT16(0, fixture_status().battery_mv);
}

/* QEMU's F405: timers run free in encoder mode, and the ADC never converts. */
static void everything_wrong_is_named_at_once(void)
{
    const uint32_t crc = fixture_upload(&two_seconds, 1, 0);
    fixture.motors_turn = false;
    fixture.board.sample.battery_valid = false;
    for (int i = 0; i < 20; i++) {
        fixture.board.sample.counts[0] += 21000;
        fixture.board.sample.counts[1] += 21000;
        fixture_run(1);
    }
    const uint32_t all = PROTO_FAULT_ENCODER_LEFT_IMPLAUSIBLE | PROTO_FAULT_ENCODER_RIGHT_IMPLAUSIBLE |
                         PROTO_FAULT_BATTERY_UNREAD;
    fixture_ask_start(crc, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, all);
    TEST_ASSERT_EQUAL_HEX32(all, fixture_status().faults_active);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_IDLE, fixture_status().state);
    assert_braked();
}

static void start_is_refused_while_the_wheels_still_coast(void)
{
    const uint32_t crc = fixture_upload(&two_seconds, 1, 0);
    drive_live(1000);
    fixture_stop();
    fixture_run(100);
    fixture_ask_start(crc, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED,
                           PROTO_FAULT_ENCODER_LEFT_IMPLAUSIBLE | PROTO_FAULT_ENCODER_RIGHT_IMPLAUSIBLE);
    TEST_ASSERT_EQUAL_HEX32(0, fixture_status().faults_active);
    fixture_set_effort(0.2f, 0.2f); /* a person at a joystick may go on at once */
    fixture_expect_accepted();
    fixture_stop();
    fixture_run(3000);
    fixture_ask_start(crc, 1);
    fixture_expect_accepted();
}

static void robot_that_rolls_while_it_is_braked_can_be_caught_and_begins_a_sequence_once_it_stands(void)
{
    const uint32_t crc = fixture_upload(&two_seconds, 1, 0);
    fixture.motors_turn = false;
    for (int i = 0; i < 3000; i++) {
        fixture.board.sample.counts[0] += 2;
        fixture_run(1);
    }
    TEST_ASSERT_EQUAL_HEX32(0, fixture_status().faults_active);
    fixture_ask_start(crc, 1);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_ENCODER_LEFT_IMPLAUSIBLE);
    fixture_set_velocity(0.0f, 0.0f);
    fixture_expect_accepted();
    fixture_stop();
    fixture_run(WHEEL_SPEED_STILL_MS + 1);
    fixture_ask_start(crc, 1);
    fixture_expect_accepted();
}

static void slope_that_turns_braked_wheels_ends_no_drive(void)
{
    const struct proto_segment rest = {PROTO_SEGMENT_KIND_EFFORT, 5000, 0.0f, 0.0f};
    fixture_start(fixture_upload(&rest, 1, 0));
    fixture.motors_turn = false;
    for (int i = 0; i < 4500; i++) {
        fixture.board.sample.counts[0] += i % 2;
        fixture_run(1);
    }
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_SEQUENCE, fixture_status().state);
}

static void battery_that_stays_low_stops_the_wheels(void)
{
    drive_live(300);
    fixture.board.sample.battery_mv = 8900;
    drive_live(200);
    fixture.board.sample.battery_mv = 9100; /* a sag that passes is none */
    drive_live(200);
    fixture.board.sample.battery_mv = 8900;
    fixture_set_effort(0.3f, 0.3f);
    fixture_run(SUPERVISOR_BATTERY_LOW_MS + 1);
    assert_braked();
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_BATTERY_LOW, fixture_status().faults_latched);
}

static void low_battery_must_recover_by_the_hysteresis_before_it_is_cleared(void)
{
    drive_live(300);
    fixture.board.sample.battery_mv = 8900;
    fixture_set_effort(0.3f, 0.3f);
    fixture_run(400);
    fixture.board.sample.battery_mv = 9400;
    fixture_run(10);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_BATTERY_LOW);
    fixture.board.sample.battery_mv = 9500;
    fixture_run(1);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_accepted();
}

static void start_is_refused_on_a_low_battery_at_the_first_reading(void)
{
    fixture.board.sample.battery_mv = 8999;
    fixture_run(1);
    fixture_set_effort(0.1f, 0.1f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_BATTERY_LOW);
}

static void supply_that_rises_too_high_stops_the_wheels_and_must_fall_before_it_is_cleared(void)
{
    drive_live(300);
    fixture.board.sample.battery_mv = 32100;
    fixture_run(SUPERVISOR_BATTERY_HIGH_MS);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_LIVE, fixture_status().state); /* one reading may be disturbed */
    fixture_run(1);
    assert_braked();
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_BATTERY_HIGH, fixture_status().faults_latched);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_BATTERY_HIGH);
    fixture.board.sample.battery_mv = 32000;
    fixture_run(1);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_accepted();
}

static void start_is_refused_on_a_supply_that_is_too_high(void)
{
    fixture.board.sample.battery_mv = 33000;
    fixture_run(1);
    fixture_set_effort(0.1f, 0.1f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_BATTERY_HIGH);
}

static void battery_that_is_unread_stops_the_wheels(void)
{
    drive_live(300);
    fixture.board.sample.battery_valid = false;
    fixture_run(1);
    assert_braked();
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_BATTERY_UNREAD, fixture_status().faults_latched);
}

static void overrun_of_the_control_loop_stops_a_drive(void)
{
    drive_live(100);
    controller_note_overrun(&fixture.controller);
    fixture_run(1);
    assert_braked();
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_LOOP_OVERRUN, fixture_status().faults_latched);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_accepted();
}

static void internal_oscillator_is_reported_and_does_not_keep_the_robot_from_driving(void)
{
    fixture.board.identity.clock_fallback = true;
    fixture.board.identity.cpu_hz = 168000000;
    controller_init(&fixture.controller);
    fixture_arm();
    fixture_run(5);
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_CLOCK_FALLBACK, fixture_status().faults_active);
    fixture_start(fixture_upload(&two_seconds, 1, 0));
    fixture_run(1000);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
    TEST_ASSERT_EQUAL_HEX32(0, fixture_status().faults_latched);
}

/* A cosmic ray, a stray pointer or a division of zero by zero: whatever the loop rests on becomes NaN. */
static void number_that_is_none_brakes_in_the_same_tick_and_is_named(void)
{
    struct robot *const robot = &fixture.controller.robot;
    struct velocity_control *const control = &robot->drive.control[1];
    float *const numbers[] = {
        &robot->drive.command[0],
        &control->integral,
        &control->tracked_mps,
        &control->effort,
        &robot->tuning.effort_limit,
        &robot->tuning.gains[1].kp,
        &robot->tuning.gains[1].ki,
        &robot->tuning.gains[1].forward.kv,
        &robot->tuning.gains[1].accel_limit_mps2,
        &robot->tuning.gains[1].effort_slew_per_s,
        &robot->tuning.effort_slew_per_s,
        &robot->tuning.gains[1].effort_limit,
        &robot->tuning.metres_per_count,
        &robot->tuning.overspeed_mps,
        &robot->tuning.encoder_speed_max_mps,
        &robot->tuning.stall_effort,
        &robot->tuning.watch_ka[0],
        &robot->tuning.thermal.limit_a2,
        &robot->heat[1].heat_a2,
        &robot->watches[0].work,
        &robot->watches[0].energy,
        &robot->watches[1].creep_m,
        &robot->tuning.creep_mps[1],
        &robot->tuning.watch_kv[1],
        &robot->watches[1].borne,
    };
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        for (int infinite = 0; infinite < 2; infinite++) {
            fixture_power_up();
            fixture_set_velocity(0.3f, 0.3f);
            fixture_run(200);
            TEST_ASSERT_TRUE(fixture.board.effort_e4[0] > 0);
            *numbers[i] = infinite != 0 ? -INFINITY : NAN;
            fixture_run(1);
            assert_braked();
            fixture_run(2);
            assert_braked();
            TEST_ASSERT_BITS_HIGH_MESSAGE(PROTO_FAULT_CONTROL_NOT_FINITE, fixture_status().faults_latched,
                                          "of the numbers in this test's list");
            fixture_run(3000);
            fixture_ask(PROTO_ID_PARAM_LOAD, NULL, 0); /* works the limits out anew */
            fixture_run(2);
            fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
            fixture_expect_accepted();
            fixture_set_velocity(0.3f, 0.3f);
            fixture_expect_accepted();
            fixture_run(200);
            TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_LIVE, fixture_status().state);
        }
    }
}

static void limit_that_is_no_number_forbids_to_begin(void)
{
    fixture.controller.robot.tuning.overspeed_mps = NAN;
    fixture_run(1);
    fixture_set_effort(0.3f, 0.3f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_CONTROL_NOT_FINITE);
}

static void several_faults_are_latched_together_and_cleared_together(void)
{
    drive_live(100);
    fixture.motors_turn = false;
    fixture.board.sample.battery_valid = false;
    fixture.board.sample.counts[0] += 100000;
    fixture_run(1);
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_ENCODER_LEFT_IMPLAUSIBLE | PROTO_FAULT_BATTERY_UNREAD,
                            fixture_status().faults_latched);
    fixture_run(100);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_BATTERY_UNREAD);
    fixture.board.sample.battery_valid = true;
    fixture_run(1);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_accepted();
    TEST_ASSERT_EQUAL_HEX32(0, fixture_status().faults_latched);
}

static void reversed_wiring_is_put_right_by_parameters(void)
{
    fixture_set_parameter(PROTO_PARAMETER_ENCODER_LEFT_REVERSED, 1.0f);
    fixture_set_parameter(PROTO_PARAMETER_MOTOR_RIGHT_REVERSED, 1.0f);
    fixture_set_effort(0.3f, 0.3f);
    fixture_run(3);
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]);
    TEST_ASSERT_EQUAL_INT16(-3000, fixture.board.effort_e4[1]);
    TEST_ASSERT_EQUAL_INT16(3000, fixture_status().effort_e4[1]);
    fixture_run(300);
    const struct proto_status_reply status = fixture_status();
    TEST_ASSERT_TRUE(status.counts[0] < 0);
    TEST_ASSERT_EQUAL_INT32(-fixture.board.sample.counts[0], status.counts[0]);
}

static void watchdog_is_fed_by_ticks_and_poll_together_only(void)
{
    fixture_run(10);
    const uint32_t fed = fixture.board.watchdog_feeds;
    TEST_ASSERT_EQUAL_UINT32(10, fed);
    for (int i = 0; i < 100; i++) {
        controller_poll(&fixture.controller); /* the tick is dead */
    }
    TEST_ASSERT_EQUAL_UINT32(fed, fixture.board.watchdog_feeds);
    for (int i = 0; i < 100; i++) {
        controller_tick(&fixture.controller); /* the main loop is dead */
    }
    TEST_ASSERT_EQUAL_UINT32(fed + CONTROLLER_POLL_MS, fixture.board.watchdog_feeds);
}

static void main_loop_that_does_not_come_round_stops_a_drive(void)
{
    drive_live(300);
    for (int i = 0; i < CONTROLLER_POLL_MS; i++) {
        fixture_tick();
    }
    TEST_ASSERT_EQUAL_INT16(3000, fixture.board.effort_e4[0]); /* busy for as long as it ever is */
    fixture_tick();
    assert_braked();
    TEST_ASSERT_EQUAL_HEX32(PROTO_FAULT_MAIN_LOOP_HUNG, fixture_status().faults_latched);
    fixture_run(1);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0); /* it has come round after all */
    fixture_expect_accepted();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(host_silence_stops_a_live_drive_and_latches);
    RUN_TEST(host_that_keeps_talking_is_obeyed);
    RUN_TEST(asking_for_status_is_not_driving);
    RUN_TEST(refused_command_does_not_keep_the_drive_alive);
    RUN_TEST(silence_time_is_the_parameter_s);
    RUN_TEST(cleared_fault_lets_the_host_drive_again);
    RUN_TEST(sequence_whose_host_falls_silent_stops_and_latches);
    RUN_TEST(sequence_s_silence_time_is_its_own_parameter);
    RUN_TEST(question_on_another_port_does_not_replace_the_sequence_s_host);
    RUN_TEST(unattended_sequence_goes_on_without_a_host);
    RUN_TEST(nothing_moves_before_this_very_start_has_been_armed);
    RUN_TEST(emergency_stop_is_latched_and_cleared_only_with_its_contact_closed);
    RUN_TEST(emergency_stop_pressed_at_rest_forbids_to_begin_until_it_is_cleared);
    RUN_TEST(stop_brakes_at_the_next_tick_while_the_main_loop_is_busy);
    RUN_TEST(damaged_stop_or_another_request_does_not_brake);
    RUN_TEST(stop_leaves_a_latched_fault_latched);
    RUN_TEST(encoder_beyond_any_speed_stops_the_wheels);
    RUN_TEST(encoder_fault_ends_a_sequence_and_its_log_says_so);
    RUN_TEST(start_is_refused_while_encoders_run_by_themselves);
    RUN_TEST(start_is_refused_without_a_battery_reading);
    RUN_TEST(everything_wrong_is_named_at_once);
    RUN_TEST(start_is_refused_while_the_wheels_still_coast);
    RUN_TEST(robot_that_rolls_while_it_is_braked_can_be_caught_and_begins_a_sequence_once_it_stands);
    RUN_TEST(slope_that_turns_braked_wheels_ends_no_drive);
    RUN_TEST(battery_that_stays_low_stops_the_wheels);
    RUN_TEST(low_battery_must_recover_by_the_hysteresis_before_it_is_cleared);
    RUN_TEST(start_is_refused_on_a_low_battery_at_the_first_reading);
    RUN_TEST(supply_that_rises_too_high_stops_the_wheels_and_must_fall_before_it_is_cleared);
    RUN_TEST(start_is_refused_on_a_supply_that_is_too_high);
    RUN_TEST(battery_that_is_unread_stops_the_wheels);
    RUN_TEST(overrun_of_the_control_loop_stops_a_drive);
    RUN_TEST(internal_oscillator_is_reported_and_does_not_keep_the_robot_from_driving);
    RUN_TEST(number_that_is_none_brakes_in_the_same_tick_and_is_named);
    RUN_TEST(limit_that_is_no_number_forbids_to_begin);
    RUN_TEST(several_faults_are_latched_together_and_cleared_together);
    RUN_TEST(reversed_wiring_is_put_right_by_parameters);
    RUN_TEST(watchdog_is_fed_by_ticks_and_poll_together_only);
    RUN_TEST(main_loop_that_does_not_come_round_stops_a_drive);
    return UNITY_END();
}
