/* A wheel's speed from counts and the times of edges, on known edges. */
#include "wheel_speed.h"

#include <math.h>

#include "random.h"
#include "unity.h"

static const float metres_per_count = 0.006f; /* 64 counts a turn */

/* A wheel whose position is known at every edge, read as the board reads it. */
static struct wheel_speed wheel;
static double position; /* counts; edge n is passed at n, moved by `misplaced` */
static double misplaced[4];
static uint32_t now_us;
static bool dates_edges;
static double summed;

void setUp(void)
{
    now_us = 0xFFFFFFFFu - 300000u; /* the clock comes round during each test */
    position = 0.5;
    summed = 0.5;
    dates_edges = true;
    for (int i = 0; i < 4; i++) {
        misplaced[i] = 0.0;
    }
    wheel_speed_init(&wheel, 0);
}

void tearDown(void)
{
}

static int32_t count_at(double at)
{
    const int32_t nearest = (int32_t)floor(at);
    for (int32_t count = nearest + 1; count >= nearest - 1; count--) {
        if (at >= count + misplaced[count & 3]) {
            return count;
        }
    }
    return nearest - 2;
}

/* One tick at a steady speed, counts/s. */
static void tick(double counts_per_s)
{
    struct wheel_motion motion = {.counts = count_at(position)};
    for (int us = 1; us <= 1000; us++) {
        const int32_t before = count_at(position);
        position += counts_per_s * 1e-6;
        if (count_at(position) != before && !motion.edge_dated && dates_edges) {
            motion.edge_dated = true;
            motion.edge_us = now_us + (uint32_t)us;
            motion.edge_from = before;
        }
    }
    now_us += 1000;
    motion.now_us = now_us;
    motion.counts = count_at(position);
    wheel_speed_step(&wheel, &motion);
    summed += (double)(wheel_speed_from_edges(&wheel, 1.0f).moved_m);
}

static void run(double counts_per_s, int ms)
{
    for (int i = 0; i < ms; i++) {
        tick(counts_per_s);
    }
}

static float speed(void)
{
    return wheel_speed_from_edges(&wheel, metres_per_count).mps;
}

static void check_steady(double counts_per_s, float tolerance)
{
    setUp();
    run(counts_per_s, (int)(3e3 / fabs(counts_per_s)) + 100);
    for (int i = 0; i < 200; i++) {
        tick(counts_per_s);
        const float wanted = (float)counts_per_s * metres_per_count;
        TEST_ASSERT_FLOAT_WITHIN(fabsf(wanted) * tolerance, wanted, speed());
    }
}

static void steady_speed_is_exact_from_a_count_in_three_hundred_ticks_to_nine_in_one(void)
{
    const double rates[] = {3.2, 16.0, 50.0, 499.0, 500.0, 1100.0, 9000.0};
    for (size_t i = 0; i < sizeof rates / sizeof rates[0]; i++) {
        check_steady(rates[i], 0.001f);
        check_steady(-rates[i], 0.001f);
    }
}

static void half_a_count_per_tick_has_no_ripple_where_plain_counts_have_a_tenth(void)
{
    float low = 1e9f;
    float high = -1e9f;
    run(530.0, 100);
    for (int i = 0; i < 1000; i++) {
        tick(530.0);
        low = fminf(low, speed());
        high = fmaxf(high, speed());
    }
    const float wanted = 530.0f * metres_per_count;
    TEST_ASSERT_TRUE((high - low) / wanted < 0.002f);
    const float one_count = wheel_speed_window_mps(&wheel, metres_per_count) / (float)wheel.window_counts;
    TEST_ASSERT_TRUE(one_count / wanted > 0.1f);
}

static void wheel_that_stops_slows_down_by_the_bound_of_one_count_and_never_jumps(void)
{
    run(20.0, 500);
    float before = speed();
    TEST_ASSERT_FLOAT_WITHIN(0.001f, 0.12f, before);
    for (int ms = 1; ms < 20000; ms++) {
        tick(0.0);
        const float now = speed();
        TEST_ASSERT_TRUE(now <= before && now >= 0.0f);
        /* Never more than one count in the time since the last edge, and no faster downhill than that. */
        TEST_ASSERT_TRUE(now <= metres_per_count / (0.001f * (float)ms) + 1e-6f);
        TEST_ASSERT_TRUE(before - now < 0.02f * before + 1e-6f);
        before = now;
    }
    TEST_ASSERT_TRUE(before < 0.0005f);
}

static void wheel_that_slows_down_is_followed_as_closely_as_its_edges_allow(void)
{
    for (double rate = 200.0; rate > 20.0; rate -= 0.1) { /* 100 counts/s a second */
        tick(rate);
        if (rate < 190.0) {
            /* The mean over a span ends before now: late by no more than it and one count more. */
            const double late_s = 4.0 / rate + 0.017;
            TEST_ASSERT_FLOAT_WITHIN(metres_per_count * (float)(100.0 * late_s + 0.01 * rate),
                                     metres_per_count * (float)rate, speed());
        }
    }
}

static void reversal_starts_from_zero_and_no_period_spans_it(void)
{
    run(100.0, 200);
    TEST_ASSERT_TRUE(speed() > 0.5f);
    run(-100.0, 5);
    while (count_at(position) >= count_at(position + 0.1)) {
        tick(-100.0); /* up to an edge behind the turning point */
    }
    bool seen_zero = false;
    for (int i = 0; i < 60; i++) {
        tick(-100.0);
        const float now = speed();
        seen_zero = seen_zero || now == 0.0f;
        if (seen_zero && now != 0.0f) {
            TEST_ASSERT_FLOAT_WITHIN(0.01f, -100.0f * metres_per_count, now);
        }
    }
    TEST_ASSERT_TRUE(seen_zero);
    TEST_ASSERT_FLOAT_WITHIN(0.01f, -100.0f * metres_per_count, speed());
}

static void jitter_around_one_edge_is_zero_speed(void)
{
    position = 0.95;
    summed = 0.95;
    for (int i = 0; i < 2000; i++) {
        run(i % 2 == 0 ? 40.0 : -40.0, 3); /* 0.12 counts to and fro across edge 1 */
        TEST_ASSERT_EQUAL_FLOAT(0.0f, speed());
    }
    TEST_ASSERT_TRUE(fabs(summed - position) < 1.0);
}

static void unequal_phases_cancel_where_a_whole_period_fits(void)
{
    const float wanted = 60.0f * metres_per_count;
    int exact = 0;
    misplaced[1] = 0.3;
    misplaced[2] = -0.1;
    misplaced[3] = 0.2;
    run(60.0, 500);
    for (int i = 0; i < 1000; i++) {
        tick(60.0);
        /* Before a late edge the bound does not account for its lateness. */
        TEST_ASSERT_TRUE(speed() < 1.001f * wanted && speed() > wanted / 1.35f);
        exact += speed() > 0.999f * wanted ? 1 : 0;
    }
    TEST_ASSERT_TRUE(exact > 850);
}

static void travel_sums_up_to_the_edges_that_were_passed(void)
{
    random_seed(1);
    misplaced[1] = 0.2;
    misplaced[3] = -0.2;
    double rate = 0.0;
    for (int i = 0; i < 20000; i++) {
        rate += ((double)random_below(2001) - 1000.0) * 0.01 - 0.002 * rate;
        tick(rate);
        TEST_ASSERT_TRUE(fabs(summed - position) < 1.3);
    }
}

static void edges_that_nobody_dates_are_known_to_a_tick(void)
{
    dates_edges = false;
    run(20.0, 500);
    for (int i = 0; i < 1000; i++) {
        tick(20.0);
        TEST_ASSERT_FLOAT_WITHIN(0.02f * 20.0f * metres_per_count, 20.0f * metres_per_count, speed());
    }
    run(5000.0, 100);
    TEST_ASSERT_FLOAT_WITHIN(0.02f * 5000.0f * metres_per_count, 5000.0f * metres_per_count, speed());
}

static void wheel_left_alone_for_longer_than_the_clock_counts_stands(void)
{
    run(20.0, 500);
    struct wheel_motion motion = {.counts = count_at(position)};
    for (int s = 0; s < 2 * 4295; s++) {
        now_us += 1000000u;
        motion.now_us = now_us;
        wheel_speed_step(&wheel, &motion);
        if (s > 60) {
            TEST_ASSERT_EQUAL_FLOAT(0.0f, speed());
        }
    }
}

static void speed_from_plain_counts_is_their_number_in_the_window(void)
{
    struct wheel_motion motion = {.counts = INT32_MAX - 20};
    wheel_speed_init(&wheel, motion.counts); /* counters wrap in mid-flight */
    for (int i = 0; i < 50; i++) {
        motion.counts = (int32_t)((uint32_t)motion.counts + 3u);
        wheel_speed_step(&wheel, &motion);
    }
    TEST_ASSERT_FLOAT_WITHIN(1e-4f, 0.3f, wheel_speed_from_counts(&wheel, 0.0001f).mps);
    TEST_ASSERT_FALSE(wheel_speed_is_still(&wheel));
    for (int i = 0; i < WHEEL_SPEED_WINDOW_MS; i++) {
        wheel_speed_step(&wheel, &motion);
    }
    TEST_ASSERT_EQUAL_FLOAT(0.0f, wheel_speed_from_counts(&wheel, 0.0001f).mps);
}

static void wheel_is_still_when_one_edge_dithers_but_not_when_it_creeps(void)
{
    struct wheel_motion motion = {0};
    for (int i = 0; i < 1000; i++) {
        motion.counts = i % 2;
        wheel_speed_step(&wheel, &motion);
        TEST_ASSERT_TRUE(wheel_speed_is_still(&wheel));
    }
    for (int i = 0; i < 1000; i++) { /* 50 counts/s */
        motion.counts = i / 20;
        wheel_speed_step(&wheel, &motion);
    }
    TEST_ASSERT_FALSE(wheel_speed_is_still(&wheel));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(steady_speed_is_exact_from_a_count_in_three_hundred_ticks_to_nine_in_one);
    RUN_TEST(half_a_count_per_tick_has_no_ripple_where_plain_counts_have_a_tenth);
    RUN_TEST(wheel_that_stops_slows_down_by_the_bound_of_one_count_and_never_jumps);
    RUN_TEST(wheel_that_slows_down_is_followed_as_closely_as_its_edges_allow);
    RUN_TEST(reversal_starts_from_zero_and_no_period_spans_it);
    RUN_TEST(jitter_around_one_edge_is_zero_speed);
    RUN_TEST(unequal_phases_cancel_where_a_whole_period_fits);
    RUN_TEST(travel_sums_up_to_the_edges_that_were_passed);
    RUN_TEST(edges_that_nobody_dates_are_known_to_a_tick);
    RUN_TEST(wheel_left_alone_for_longer_than_the_clock_counts_stands);
    RUN_TEST(speed_from_plain_counts_is_their_number_in_the_window);
    RUN_TEST(wheel_is_still_when_one_edge_dithers_but_not_when_it_creeps);
    return UNITY_END();
}
