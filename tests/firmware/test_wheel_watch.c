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
    for (int percent = 18; percent <= 100; percent++) {
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

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(a_reversed_encoder_is_found_within_50_ms_of_the_push);
    RUN_TEST(a_sound_encoder_is_never_called_reversed);
    RUN_TEST(a_wheel_that_rolls_back_when_the_push_begins_is_not_called_reversed);
    RUN_TEST(a_wheel_that_the_other_one_turns_back_is_not_called_reversed);
    RUN_TEST(one_loose_phase_of_a_standing_wheel_is_no_motion_against_the_push);
    RUN_TEST(a_wheel_that_bounces_back_from_a_wall_is_not_called_reversed);
    return UNITY_END();
}
