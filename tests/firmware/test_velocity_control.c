/* The speed loop follows its formula, does not wind up, and holds speeds on a motor. */
#include "velocity_control.h"

#include <math.h>

#include "fixture.h"
#include "wheel_speed.h"

static struct velocity_control control;
static struct velocity_gains gains;

void setUp(void)
{
    gains = (struct velocity_gains){
        .kp = 2.0f,
        .ki = 5.0f,
        .forward = {.ks = 0.03f, .kv = 0.6f, .ka = 0.1f},
        .reverse = {.ks = 0.03f, .kv = 0.6f, .ka = 0.1f},
        .effort_limit = 1.0f,
        .effort_slew_per_s = 1000.0f,
        .accel_limit_mps2 = 1.0e5f,
    };
    velocity_control_reset(&control, 0.0f, 0.0f);
    fixture_power_up();
}

void tearDown(void)
{
}

/* One tick of a wheel whose speed is known from plain counts. */
static float step(float command_mps, float measured_mps, bool still)
{
    const struct wheel_measure measured = {
        .mps = measured_mps, .span_s = 0.016f, .age_s = 0.008f, .moved_m = 0.001f * measured_mps};
    return velocity_control_step(&control, &gains, command_mps, &measured, still);
}

static void feedforward_alone_is_ks_sign_v_plus_kv_v_plus_ka_a(void)
{
    gains.kp = 0.0f;
    gains.ki = 0.0f;
    gains.accel_limit_mps2 = 2.0f; /* 2 mm/s a tick */
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.03f + 0.6f * 0.002f + 0.1f * 2.0f, step(0.5f, 0.0f, false));
    velocity_control_reset(&control, 0.5f, 0.0f);
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.03f + 0.6f * 0.5f, step(0.5f, 0.0f, false));
    velocity_control_reset(&control, -0.5f, 0.0f);
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, -0.03f - 0.6f * 0.5f, step(-0.5f, 0.0f, false));
}

static void proportional_and_integral_terms_match_hand_calculation(void)
{
    gains.forward = gains.reverse = (struct feedforward){0};
    velocity_control_reset(&control, 0.3f, 0.0f);
    /* error 0.1: 2 * 0.1 first, then one more tick's integral of 5 * 0.1 * 0.001 each time. */
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.2f, step(0.3f, 0.2f, false));
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.2005f, step(0.3f, 0.2f, false));
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.2010f, step(0.3f, 0.2f, false));
    for (int i = 3; i < 100; i++) {
        (void)step(0.3f, 0.2f, false);
    }
    TEST_ASSERT_FLOAT_WITHIN(1e-5f, 0.05f, control.integral);
}

static void integral_does_not_wind_up_against_the_output_limit(void)
{
    gains.effort_limit = 0.5f;
    gains.forward.ks = gains.forward.ka = 0.0f;
    velocity_control_reset(&control, 1.5f, 0.5f);
    for (int i = 0; i < 60000; i++) { /* a blocked wheel, for a minute */
        TEST_ASSERT_EQUAL_FLOAT(0.5f, step(1.5f, 0.0f, false));
    }
    TEST_ASSERT_EQUAL_FLOAT(0.0f, control.integral);
    /* Set free and faster than asked for: the effort leaves the limit as soon as the speed is known. */
    for (int i = 0; i < 8; i++) {
        (void)step(0.1f, 0.5f, false);
    }
    TEST_ASSERT_TRUE(step(0.1f, 0.5f, false) < 0.0f);
}

static void integral_comes_back_while_the_output_is_limited(void)
{
    gains.effort_limit = 0.5f;
    velocity_control_reset(&control, 0.3f, 0.5f);
    control.integral = 2.0f;
    for (int i = 0; i < 100; i++) {
        (void)step(0.3f, 0.5f, false);
    }
    TEST_ASSERT_FLOAT_WITHIN(1e-3f, 2.0f - 5.0f * 0.2f * 0.1f, control.integral);
}

static void effort_changes_no_faster_than_its_slew_limit(void)
{
    gains.effort_slew_per_s = 20.0f;
    float before = 0.0f;
    for (int i = 0; i < 300; i++) {
        const float effort = step(i < 100 ? 1.0f : -1.0f, 0.0f, false);
        TEST_ASSERT_TRUE(fabsf(effort - before) <= 0.02f + 1e-6f);
        before = effort;
    }
    TEST_ASSERT_EQUAL_FLOAT(-1.0f, before);
}

static void tracked_speed_follows_the_acceleration_limit_and_arrives_exactly(void)
{
    gains.accel_limit_mps2 = 3.0f;
    for (int i = 0; i < 99; i++) {
        (void)step(0.3f, 0.0f, false);
    }
    TEST_ASSERT_FLOAT_WITHIN(1e-4f, 0.297f, control.tracked_mps);
    (void)step(0.3f, 0.0f, false);
    (void)step(0.3f, 0.0f, false);
    TEST_ASSERT_EQUAL_FLOAT(0.3f, control.tracked_mps);
}

static void output_never_passes_the_effort_limit(void)
{
    gains.effort_limit = 0.4f;
    for (int i = 0; i < 5000; i++) {
        const float command = sinf((float)i * 0.01f) * 3.0f;
        const float effort = step(command, -command, false);
        TEST_ASSERT_TRUE(effort <= 0.4f && effort >= -0.4f);
    }
}

static void standing_wheel_told_to_stand_gets_no_effort(void)
{
    control.integral = 0.2f;
    TEST_ASSERT_EQUAL_FLOAT(0.0f, step(0.0f, 0.0f, true));
    TEST_ASSERT_EQUAL_FLOAT(0.0f, control.integral);
}

/* The fixture's motor through the whole controller: default parameters, plain counts, 1 kHz. */
static void check_step(float speed_mps, double motor_gain, double friction, double max_overshoot)
{
    double highest = 0.0;
    double sum = 0.0;
    int settled_at_ms = 0;
    fixture_power_up();
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        fixture.motor[wheel].gain_mps = motor_gain;
        fixture.motor[wheel].friction = friction;
    }
    for (int ms = 0; ms < 2000; ms++) {
        if (ms % 100 == 0) {
            fixture_set_velocity(speed_mps, speed_mps);
            fixture_expect_accepted();
        }
        fixture_run(1);
        const double speed = fixture.motor[0].speed_mps;
        highest = fmax(highest, speed);
        if (fabs(speed - (double)speed_mps) > 0.05 * (double)speed_mps) {
            settled_at_ms = ms + 1;
        }
        if (ms >= 1200) { /* the last 40 % */
            sum += speed;
        }
    }
    const double gain = sum / 800.0 / (double)speed_mps;
    printf("%.2f m/s, motor %.2f m/s, friction %.2f: gain %.3f, overshoot %.1f %%, within 5 %% after %d ms\n",
           (double)speed_mps, motor_gain, friction, gain, (highest / (double)speed_mps - 1.0) * 100.0,
           settled_at_ms);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 1.0, gain);
    TEST_ASSERT_TRUE(settled_at_ms <= 500);
    /* The resolution of the speed bounds the loop's accuracy: one count in the window. */
    const double resolution = fixture_metres_per_count() * 1000.0 / WHEEL_SPEED_WINDOW_MS;
    TEST_ASSERT_TRUE(highest < (1.0 + max_overshoot) * (double)speed_mps + resolution);
}

static void speed_steps_settle_within_half_a_second_at_gain_one(void)
{
    const float speeds[] = {0.15f, 0.25f, 0.30f, 0.35f, 0.45f, 0.60f};
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        check_step(speeds[i], 1.50, 0.02, 0.02);
    }
}

static void speed_steps_stay_at_gain_one_on_a_motor_that_the_feedforward_does_not_know(void)
{
    check_step(0.15f, 1.35, 0.03, 0.10);
    check_step(0.60f, 1.35, 0.03, 0.10);
    check_step(0.15f, 1.65, 0.01, 0.10);
    check_step(0.60f, 1.65, 0.01, 0.10);
}

static void each_direction_has_its_own_feedforward(void)
{
    gains.kp = gains.ki = 0.0f;
    gains.reverse = (struct feedforward){.ks = 0.05f, .kv = 0.8f, .ka = 0.2f};
    velocity_control_reset(&control, 0.5f, 0.0f);
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.03f + 0.6f * 0.5f, step(0.5f, 0.0f, false));
    velocity_control_reset(&control, -0.5f, 0.0f);
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, -0.05f - 0.8f * 0.5f, step(-0.5f, 0.0f, false));
}

static void kick_pushes_a_standing_wheel_until_it_turns_and_never_longer_than_its_limit(void)
{
    gains.kp = gains.ki = 0.0f;
    gains.forward = gains.reverse = (struct feedforward){0};
    gains.kick_effort = 0.2f;
    gains.kick_ms = 50;
    for (int i = 0; i < 20; i++) {
        TEST_ASSERT_EQUAL_FLOAT(-0.2f, step(-0.1f, 0.0f, true));
    }
    TEST_ASSERT_EQUAL_FLOAT(0.0f, step(-0.1f, -0.05f, false));
    TEST_ASSERT_EQUAL_FLOAT(0.0f, step(-0.1f, 0.0f, false)); /* it has turned: no second push */

    velocity_control_reset(&control, 0.0f, 0.0f);
    int pushed_ms = 0;
    for (int i = 0; i < 200; i++) {
        pushed_ms += step(0.1f, 0.0f, true) > 0.0f ? 1 : 0;
    }
    TEST_ASSERT_EQUAL(50, pushed_ms);
}

static void gain_falls_with_the_rate_of_counts_but_a_wheel_that_stands_still_gets_going(void)
{
    gains.kp = 2.0f;
    gains.ki = 0.0f;
    gains.forward = gains.reverse = (struct feedforward){0};
    gains.metres_per_count = 0.006f; /* a count every 300 ms at 0.02 m/s */
    velocity_control_reset(&control, 0.02f, 0.0f);
    const float share = (float)VELOCITY_CONTROL_FULL_GAIN_MS / 300.0f;
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 2.0f * share * 0.01f, step(0.02f, 0.01f, false));

    gains.kp = 0.0f;
    gains.ki = 6.0f;
    velocity_control_reset(&control, 0.02f, 0.0f);
    const struct wheel_measure standing = {.span_s = 1.0f, .age_s = 0.5f};
    (void)velocity_control_step(&control, &gains, 0.02f, &standing, false);
    TEST_ASSERT_FLOAT_WITHIN(1e-8f, 6.0f * 0.02f * 0.001f, control.integral);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(feedforward_alone_is_ks_sign_v_plus_kv_v_plus_ka_a);
    RUN_TEST(proportional_and_integral_terms_match_hand_calculation);
    RUN_TEST(integral_does_not_wind_up_against_the_output_limit);
    RUN_TEST(integral_comes_back_while_the_output_is_limited);
    RUN_TEST(effort_changes_no_faster_than_its_slew_limit);
    RUN_TEST(tracked_speed_follows_the_acceleration_limit_and_arrives_exactly);
    RUN_TEST(output_never_passes_the_effort_limit);
    RUN_TEST(standing_wheel_told_to_stand_gets_no_effort);
    RUN_TEST(speed_steps_settle_within_half_a_second_at_gain_one);
    RUN_TEST(speed_steps_stay_at_gain_one_on_a_motor_that_the_feedforward_does_not_know);
    RUN_TEST(each_direction_has_its_own_feedforward);
    RUN_TEST(kick_pushes_a_standing_wheel_until_it_turns_and_never_longer_than_its_limit);
    RUN_TEST(gain_falls_with_the_rate_of_counts_but_a_wheel_that_stands_still_gets_going);
    return UNITY_END();
}
