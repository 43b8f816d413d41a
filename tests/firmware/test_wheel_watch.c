/* A wheel whose counts run against its effort: detected soon, and distinguished from motion by gravity or the
 * other wheel. */
#include "wheel_watch.h"

#include <math.h>
#include <stdio.h>

#include "unity.h"
#include "wheel_speed.h"

/* The paper's robot as its feedforward has it: effort = friction + kv v + ka a. */
static const double ka = 0.22, kv = 0.67, friction = 0.05;

static struct wheel_watch watch;
static struct wheel_speed wheel;
static uint32_t now_us;
static struct tuning tuning;
static double speed_mps, place_m;

static void start(double counts_per_m, double at_speed_mps)
{
    tuning = (struct tuning){
        .metres_per_count = (float)(1.0 / counts_per_m),
        .stall_effort = 0.25f,
        .encoder_start_ms = 10000,
        .stall_ms = 10000,
        .encoder_speed_max_mps = 5.0f,
        .watch_ka = {(float)ka, (float)ka},
    };
    speed_mps = at_speed_mps;
    place_m = 0.0;
    wheel_watch_init(&watch, 0);
    wheel_speed_init(&wheel, 0);
}

void setUp(void)
{
    start(6000.0, 0.0);
}

void tearDown(void)
{
}

/* One tick of a wheel with an effort and, in the same unit, all other forces on it. */
static void roll(double effort, double pushed_by)
{
    const double driving = effort - kv * speed_mps + pushed_by;
    const double drag = friction * (speed_mps > 0.0 ? 1.0 : -1.0);
    if (speed_mps == 0.0 && fabs(driving) <= friction) {
        return;
    }
    const double before = speed_mps;
    speed_mps += 0.001 * (driving - (speed_mps == 0.0 ? copysign(friction, driving) : drag)) / ka;
    if (before * speed_mps < 0.0) {
        speed_mps = 0.0;
    }
    place_m += 0.001 * speed_mps;
}

static void observe(double effort, double other_effort, int direction)
{
    const int16_t efforts_e4[HAL_WHEELS] = {(int16_t)lround(effort * 1e4),
                                            (int16_t)lround(other_effort * 1e4)};
    const double metres = (double)tuning.metres_per_count;
    now_us += 1000;
    const struct wheel_motion motion = {.counts = direction * (int32_t)floor(place_m / metres),
                                        .now_us = now_us};
    wheel_speed_step(&wheel, &motion);
    wheel_watch_step(&watch, &tuning, 0, motion.counts, efforts_e4,
                     wheel_speed_from_edges(&wheel, tuning.metres_per_count).mps);
}

/* Milliseconds under an effort until the wheel is called reversed; -1: never. */
static int reversed_after(double effort, double other_effort, double pushed_by, int direction, int limit_ms)
{
    for (int ms = 1; ms <= limit_ms; ms++) {
        roll(effort, pushed_by);
        observe(effort, other_effort, direction);
        if (watch.reversed) {
            return ms;
        }
    }
    return -1;
}

static void a_reversed_encoder_is_found_within_50_ms_of_the_push(void)
{
    for (int percent = 15; percent <= 100; percent++) {
        for (int way = -1; way <= 1; way += 2) {
            start(6000.0, 0.0);
            const double effort = way * 0.01 * percent;
            const int ms = reversed_after(effort, effort, 0.0, -1, 1000);
            if (way > 0 && percent % 20 == 0) {
                printf("reversed, %d %% effort: %d ms\n", percent, ms);
            }
            TEST_ASSERT_GREATER_THAN_INT(0, ms);
            TEST_ASSERT_LESS_OR_EQUAL_INT(50, ms);
        }
    }
}

static void a_sound_encoder_is_never_called_reversed(void)
{
    for (int percent = 1; percent <= 100; percent++) {
        setUp();
        TEST_ASSERT_EQUAL_INT(-1, reversed_after(0.01 * percent, 0.0, 0.0, 1, 500));
        TEST_ASSERT_EQUAL_INT(-1, reversed_after(-0.01 * percent, 0.0, 0.0, 1, 500));
        TEST_ASSERT_EQUAL_INT(-1, reversed_after(0.0, 0.0, 0.0, 1, 20));
        TEST_ASSERT_EQUAL_INT(-1, reversed_after(0.01 * percent, 0.0, 0.0, 1, 500));
    }
}

/* The robot rolls down a slope, or has just been let go by a hand, when the effort begins. */
static void a_wheel_that_rolls_back_when_the_push_begins_is_not_called_reversed(void)
{
    static const double counts_per_m[] = {160.0, 1000.0, 6000.0};
    const double slope = 0.113; /* 3 degrees: g sin(3 deg) ka */
    for (int fine = 0; fine < 3; fine++) {
        for (int mmps = 0; mmps <= 600; mmps += 4) {
            for (int percent = 18; percent <= 100; percent += 2) {
                start(counts_per_m[fine], -0.001 * mmps);
                for (int ms = 0; ms < 400; ms++) { /* as fast as that, whatever holds it there */
                    place_m += 0.001 * speed_mps;
                    observe(0.0, 0.0, 1);
                }
                const int ms = reversed_after(0.01 * percent, 0.0, -slope, 1, 500);
                TEST_ASSERT_EQUAL_INT_MESSAGE(-1, ms, "rolling back");
            }
        }
    }
}

/* What the chassis carries over of the other wheel's effort, for a robot whose mass sits close to its middle.
 */
static void a_wheel_that_the_other_one_turns_back_is_not_called_reversed(void)
{
    for (int own = 10; own <= 40; own += 2) {
        for (int other = 0; other <= 100; other += 5) {
            const double carried = -0.4 * (0.01 * other - friction);
            if (other < 5 || 0.01 * own + carried < -0.12) {
                continue; /* pushed back permanently: detected */
            }
            setUp();
            const int ms = reversed_after(0.01 * own, 0.01 * other, carried, 1, 40);
            TEST_ASSERT_EQUAL_INT_MESSAGE(-1, ms, "turned by the other wheel");
        }
    }
}

static void one_loose_phase_of_a_standing_wheel_is_no_motion_against_the_push(void)
{
    for (int ms = 0; ms < 1000; ms++) {
        const int16_t efforts_e4[HAL_WHEELS] = {3000, 0};
        wheel_watch_step(&watch, &tuning, 0, -(ms & 1) - (ms & 2) / 2, efforts_e4, 0.0f);
        TEST_ASSERT_FALSE(watch.reversed);
    }
}

static void a_wheel_that_bounces_back_from_a_wall_is_not_called_reversed(void)
{
    TEST_ASSERT_EQUAL_INT(-1, reversed_after(0.3, 0.3, 0.0, 1, 800));
    speed_mps *= -0.2;
    TEST_ASSERT_EQUAL_INT(-1, reversed_after(0.3, 0.3, 0.0, 1, 800));
}

/* A motion along the push that is as fast the other way at once: the plug was exchanged, or its wires were.
 */
static void an_encoder_that_turns_round_while_it_rolls_is_found_within_10_ms(void)
{
    for (int percent = 15; percent <= 100; percent++) {
        setUp();
        const double effort = 0.01 * percent;
        TEST_ASSERT_EQUAL_INT(-1, reversed_after(effort, effort, 0.0, 1, 1000));
        const double turned_m = place_m;
        int ms = 0;
        while (!watch.reversed && ms < 100) {
            roll(effort, 0.0);
            const double travelled_m = place_m;
            place_m = 2.0 * turned_m - travelled_m;
            observe(effort, effort, 1);
            place_m = travelled_m;
            ms++;
        }
        TEST_ASSERT_LESS_OR_EQUAL_INT(10, ms);
    }
}

/* A full reversal of a light robot, as fast as effort mode lets it: the effort turned first. */
static void a_wheel_that_its_own_effort_turns_round_is_not_called_reversed(void)
{
    for (int percent = 15; percent <= 100; percent++) {
        setUp();
        tuning.watch_ka[0] = 0.1f;
        const double top = 0.01 * percent;
        TEST_ASSERT_EQUAL_INT(-1, reversed_after(top, top, 0.0, 1, 1000));
        for (double effort = top; effort > -top; effort -= 0.1) {
            TEST_ASSERT_EQUAL_INT(-1, reversed_after(effort, effort, 0.0, 1, 1));
        }
        TEST_ASSERT_EQUAL_INT(-1, reversed_after(-top, -top, 0.0, 1, 1000));
    }
}

static void a_robot_on_a_slope_is_not_called_reversed_by_what_both_wheels_do(void)
{
    for (int percent = 11; percent <= 40; percent++) {
        setUp();
        const double effort = 0.01 * percent;
        const double slope = 0.1;
        /* Straight ahead: both on the slope, each turned by the other through a chassis with its mass in the
         * middle. */
        TEST_ASSERT_EQUAL_INT(-1, reversed_after(effort, effort, -slope * 0.6 - 0.4 * effort, 1, 300));
        setUp();
        TEST_ASSERT_EQUAL_INT(-1, reversed_after(effort, -effort, -slope * 1.25 - 0.25 * effort, 1, 300));
    }
}

/* Milliseconds until a wheel without counts is called lost; -1: never. */
static int lost_after(double effort, int limit_ms)
{
    for (int ms = 1; ms <= limit_ms; ms++) {
        observe(effort, effort, 1);
        if (watch.lost) {
            return ms;
        }
    }
    return -1;
}

static void start_late_by(double effort, int delay_ms)
{
    tuning.encoder_start_ms = WHEEL_WATCH_START_MS;
    for (int ms = 0; ms < delay_ms; ms++) {
        observe(effort, effort, 1);
        TEST_ASSERT_FALSE(watch.lost);
    }
    for (int ms = 0; ms < 400; ms++) {
        roll(effort, 0.0);
        observe(effort, effort, 1);
        TEST_ASSERT_FALSE(watch.lost);
    }
    speed_mps = 0.0;
    for (int ms = 0; ms < 400; ms++) {
        observe(0.0, 0.0, 1);
    }
}

static void an_encoder_that_dies_at_rest_is_found_soon_once_its_wheel_was_seen_to_start(void)
{
    tuning.encoder_start_ms = WHEEL_WATCH_START_MS;
    TEST_ASSERT_EQUAL_INT(WHEEL_WATCH_START_MS, lost_after(1.0, 1000));
    for (int percent = 25; percent <= 100; percent += 5) {
        setUp();
        start_late_by(1.0, 0);
        const int ms = lost_after(0.01 * percent, 1000);
        printf("never starts at %d %% effort: %d ms\n", percent, ms);
        TEST_ASSERT_LESS_OR_EQUAL_INT(percent >= 60 ? 50 : 85, ms);
    }
}

/* Drivers answer late, by up to 0.2 s among the robots that `truing trial` conceals. */
static void a_wheel_whose_driver_answers_late_is_never_called_lost(void)
{
    for (int delay_ms = 0; delay_ms <= 200; delay_ms += 10) {
        for (int percent = 25; percent <= 100; percent += 5) {
            setUp();
            start_late_by(0.01 * percent, delay_ms);
            start_late_by(0.25, delay_ms);
            start_late_by(1.0, delay_ms);
            start_late_by(0.01 * percent, delay_ms);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(a_reversed_encoder_is_found_within_50_ms_of_the_push);
    RUN_TEST(a_sound_encoder_is_never_called_reversed);
    RUN_TEST(a_wheel_that_rolls_back_when_the_push_begins_is_not_called_reversed);
    RUN_TEST(a_wheel_that_the_other_one_turns_back_is_not_called_reversed);
    RUN_TEST(one_loose_phase_of_a_standing_wheel_is_no_motion_against_the_push);
    RUN_TEST(a_wheel_that_bounces_back_from_a_wall_is_not_called_reversed);
    RUN_TEST(an_encoder_that_turns_round_while_it_rolls_is_found_within_10_ms);
    RUN_TEST(a_wheel_that_its_own_effort_turns_round_is_not_called_reversed);
    RUN_TEST(a_robot_on_a_slope_is_not_called_reversed_by_what_both_wheels_do);
    RUN_TEST(an_encoder_that_dies_at_rest_is_found_soon_once_its_wheel_was_seen_to_start);
    RUN_TEST(a_wheel_whose_driver_answers_late_is_never_called_lost);
    return UNITY_END();
}
