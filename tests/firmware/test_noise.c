/* No input on the line crashes the controller, and noise never starts a motor. */
#include "fixture.h"

#include "random.h"

enum { NOISE_BYTES = 10 * 1000 * 1000 };

void setUp(void)
{
    fixture_power_up();
}

void tearDown(void)
{
}

/* Takes and checks all that was sent: only whole frames may come. */
static void drain(void)
{
    (void)fixture_hear();
    TEST_ASSERT_EQUAL_UINT32(0, fixture.decoder.dropped);
}

static void assert_no_motor_runs(void)
{
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[1]);
}

static void ten_megabytes_of_noise_crash_nothing_and_start_no_motor(void)
{
    uint8_t bytes[92];
    random_seed(2023);
    for (uint32_t sent = 0; sent < NOISE_BYTES; sent += sizeof bytes) {
        for (size_t i = 0; i < sizeof bytes; i++) {
            bytes[i] = (uint8_t)random_u32();
        }
        (void)hal_host_receive(&fixture.board, bytes, sizeof bytes);
        fixture_run(1); /* 92 bytes are a millisecond at 921600 baud */
        assert_no_motor_runs();
    }
    drain();
    const uint8_t zero = 0; /* ends the noise; the next frame is received */
    (void)hal_host_receive(&fixture.board, &zero, 1);
    const struct proto_status_reply status = fixture_status();
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_IDLE, status.state);
    TEST_ASSERT_TRUE(status.frames_dropped > NOISE_BYTES / 512);
    printf("%d bytes of noise, %u damaged frames dropped\n", NOISE_BYTES, status.frames_dropped);
}

/* Short runs of bytes between zeros reach the code behind the stuffing more often than uniform noise. */
static void noise_rich_in_zeros_and_codes_crashes_nothing(void)
{
    static const uint8_t favoured[] = {0, 0, 1, 2, 3, 8, 9, 0x42, 0x40, 0xFE, 0xFF};
    uint8_t bytes[92];
    random_seed(2024);
    for (uint32_t sent = 0; sent < NOISE_BYTES / 10; sent += sizeof bytes) {
        for (size_t i = 0; i < sizeof bytes; i++) {
            bytes[i] = favoured[random_below(sizeof favoured)];
        }
        (void)hal_host_receive(&fixture.board, bytes, sizeof bytes);
        fixture_run(1);
        assert_no_motor_runs();
    }
    drain();
}

static void say_random_frame(uint8_t id, size_t length)
{
    static uint8_t payload[PROTO_MAX_PAYLOAD];
    for (size_t i = 0; i < length; i++) {
        payload[i] = (uint8_t)random_u32();
    }
    fixture_say(id, (uint16_t)random_below(4), payload, length);
}

/* Valid frames with random contents: right lengths as often as wrong ones. */
static void sound_frames_of_random_contents_crash_nothing_and_keep_to_the_limits(void)
{
    static const uint8_t lengths[] = {0, 0, 1, 2, 4, 6, 8, 15, 28};
    random_seed(2025);
    fixture_set_parameter(PROTO_PARAMETER_EFFORT_LIMIT, 0.5f);
    fixture_ask(PROTO_ID_PARAM_SAVE, NULL, 0);
    for (int i = 0; i < 300000; i++) {
        uint8_t id = (uint8_t)random_below(0x48);
        /* The limit itself stays: what is watched below. */
        while (id == PROTO_ID_PARAM_SET || id == PROTO_ID_PARAM_DEFAULTS) {
            id = (uint8_t)random_u32();
        }
        const size_t length = random_below(50) == 0 ? random_below(PROTO_MAX_PAYLOAD + 1)
                                                    : lengths[random_below(sizeof lengths)];
        say_random_frame(id, length);
        fixture_run(1);
        TEST_ASSERT_TRUE(fixture.board.effort_e4[0] <= 5000 && fixture.board.effort_e4[0] >= -5000);
        TEST_ASSERT_TRUE(fixture.board.effort_e4[1] <= 5000 && fixture.board.effort_e4[1] >= -5000);
        if (i % 16 == 0) {
            drain();
        }
    }
    drain();
    TEST_ASSERT_TRUE(fixture.replies > 250000);
}

static void sound_frames_of_random_contents_start_no_motor_on_an_unfit_robot(void)
{
    random_seed(2026);
    fixture.board.sample.battery_valid = false;
    for (int i = 0; i < 300000; i++) {
        say_random_frame((uint8_t)random_u32(), random_below(30));
        fixture_run(1);
        assert_no_motor_runs();
        if (i % 16 == 0) {
            drain();
        }
    }
}

/* Parameters over their whole range, sensors over every possible value: all arithmetic stays defined. */
static void random_parameters_and_sensors_break_no_arithmetic(void)
{
    random_seed(2027);
    for (int round = 0; round < 400; round++) {
        fixture_power_up();
        fixture.motors_turn = false;
        for (uint16_t i = 0; i < PROTO_PARAMETER_COUNT; i++) {
            const struct proto_parameter_info *const info = &proto_parameters[i];
            const float part =
                random_below(4) == 0 ? (float)random_below(2) : (float)random_below(1000) / 999.0f;
            float value = info->minimum + part * (info->maximum - info->minimum);
            if (info->kind != PROTO_PARAMETER_KIND_REAL) {
                value = floorf(value);
            }
            fixture_set_parameter(i, fminf(value, info->maximum));
            fixture_expect_accepted();
        }
        fixture_set_parameter(PROTO_PARAMETER_BATTERY_LOW_V, 0.0f);
        fixture_set_parameter(PROTO_PARAMETER_ENCODER_SPEED_MAX_MPS, 50.0f);
        for (int i = 0; i < 200; i++) {
            fixture_set_velocity((float)random_below(2000) / 1000.0f - 1.0f,
                                 (float)random_below(2000) / 1000.0f - 1.0f);
            fixture.board.sample.counts[0] = (int32_t)random_u32();
            fixture.board.sample.counts[1] += (int32_t)random_below(100);
            fixture_run(1 + random_below(3));
            (void)fixture_status();
            if (fixture_status().state == PROTO_STATE_STOPPED) {
                fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
            }
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(ten_megabytes_of_noise_crash_nothing_and_start_no_motor);
    RUN_TEST(noise_rich_in_zeros_and_codes_crashes_nothing);
    RUN_TEST(sound_frames_of_random_contents_crash_nothing_and_keep_to_the_limits);
    RUN_TEST(sound_frames_of_random_contents_start_no_motor_on_an_unfit_robot);
    RUN_TEST(random_parameters_and_sensors_break_no_arithmetic);
    return UNITY_END();
}
