/* Odometry follows closed-form arcs without drift over kilometres; its sine and cosine are accurate
 * enough. */
#include <math.h>

#include "odometry.h"
#include "trig.h"
#include "unity.h"

static const double pi = 3.14159265358979323846;
static const double radius_m = 0.0635;
static const double wheelbase_m = 0.283;
enum { COUNTS_PER_REV = 2400 };

static struct odometry pose;
static struct odometry_geometry geometry;

void setUp(void)
{
    pose = (struct odometry){0};
    geometry = odometry_geometry(0.0635f, 0.283f, COUNTS_PER_REV);
}

void tearDown(void)
{
}

/* Drives `ticks` milliseconds at given wheel speeds, counts as an encoder would give them. */
static void drive(double left_mps, double right_mps, long ticks)
{
    const double counts_per_m = COUNTS_PER_REV / (2.0 * pi * radius_m);
    long left = 0;
    long right = 0;
    for (long i = 1; i <= ticks; i++) {
        const long l = lround(left_mps * 1e-3 * (double)i * counts_per_m);
        const long r = lround(right_mps * 1e-3 * (double)i * counts_per_m);
        odometry_step(&pose, &geometry, (int32_t)(l - left), (int32_t)(r - right));
        left = l;
        right = r;
    }
}

static double x_m(void)
{
    return (double)pose.x_q32 / 4294967296.0;
}

static double y_m(void)
{
    return (double)pose.y_q32 / 4294967296.0;
}

static double theta_rad(void)
{
    return (double)(int64_t)pose.theta_q40 / 1099511627776.0 * 2.0 * pi;
}

static void sine_and_cosine_are_good_to_a_millionth_all_round(void)
{
    double worst = 0.0;
    for (uint32_t i = 0; i < 1000003; i++) {
        const uint32_t phase = i * 4295u; /* coprime with a turn: every octant, unevenly */
        const double angle = (double)phase / 4294967296.0 * 2.0 * pi;
        float s;
        float c;
        trig_sine_cosine(phase, &s, &c);
        worst = fmax(worst, fmax(fabs((double)s - sin(angle)), fabs((double)c - cos(angle))));
    }
    printf("sine, cosine: worst error %.1e\n", worst);
    TEST_ASSERT_TRUE(worst < 2e-7);
}

static void sine_and_cosine_are_exact_at_the_quarters(void)
{
    const float expected[4][2] = {{0.0f, 1.0f}, {1.0f, 0.0f}, {0.0f, -1.0f}, {-1.0f, 0.0f}};
    for (uint32_t quarter = 0; quarter < 4; quarter++) {
        float s;
        float c;
        trig_sine_cosine(quarter << 30, &s, &c);
        TEST_ASSERT_EQUAL_FLOAT(expected[quarter][0], s);
        TEST_ASSERT_EQUAL_FLOAT(expected[quarter][1], c);
    }
}

static void one_tick_is_equation_24(void)
{
    /* V_L dt = 30 counts, V_R dt = 50 counts, from theta = 0. */
    const double per_count = 2.0 * pi * radius_m / COUNTS_PER_REV;
    const double d = per_count * (30 + 50) / 2.0;
    const double turn = per_count * (50 - 30) / wheelbase_m;
    odometry_step(&pose, &geometry, 30, 50);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, d * cos(turn / 2.0), x_m());
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, d * sin(turn / 2.0), y_m());
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, turn, theta_rad());
}

static void straight_drive_keeps_its_heading(void)
{
    drive(0.5, 0.5, 20000);
    TEST_ASSERT_INT_WITHIN(1, 10000, odometry_x_mm(&pose));
    TEST_ASSERT_EQUAL_INT32(0, odometry_y_mm(&pose));
    TEST_ASSERT_EQUAL_INT32(0, odometry_theta_e4(&pose));
}

static void backward_drive_is_negative(void)
{
    drive(-0.5, -0.5, 2000);
    TEST_ASSERT_INT_WITHIN(1, -1000, odometry_x_mm(&pose));
}

static void pivot_about_the_standing_left_wheel_turns_left(void)
{
    drive(0.0, 0.283 * pi / 2.0, 1000); /* a quarter turn in one second */
    TEST_ASSERT_INT_WITHIN(8, 15708, odometry_theta_e4(&pose));
    TEST_ASSERT_INT_WITHIN(1, 142, odometry_x_mm(&pose)); /* (22), (23): half the wheelbase each way */
    TEST_ASSERT_INT_WITHIN(1, 142, odometry_y_mm(&pose));
}

static void arc_ends_where_equations_22_and_23_say(void)
{
    const double vl = 0.35;
    const double vr = 0.5;
    const double t = 8.0;
    drive(vl, vr, 8000);
    const double omega = (vr - vl) / wheelbase_m;
    const double bend = (vr + vl) / (vr - vl) * wheelbase_m / 2.0;
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, bend * sin(omega * t), x_m());
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, bend - bend * cos(omega * t), y_m());
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, omega * t, theta_rad());
}

static void right_turn_mirrors_a_left_turn(void)
{
    drive(0.3, 0.6, 5000);
    const struct odometry left = pose;
    pose = (struct odometry){0};
    drive(0.6, 0.3, 5000);
    TEST_ASSERT_INT_WITHIN(1, odometry_x_mm(&left), odometry_x_mm(&pose));
    TEST_ASSERT_INT_WITHIN(1, -odometry_y_mm(&left), odometry_y_mm(&pose));
    TEST_ASSERT_EQUAL_INT32(-odometry_theta_e4(&left), odometry_theta_e4(&pose));
}

static void one_count_a_second_is_not_lost(void)
{
    for (int i = 0; i < 100000; i++) {
        odometry_step(&pose, &geometry, 1, 0);
        odometry_step(&pose, &geometry, 0, 1);
    }
    const double distance = 100000.0 * 2.0 * pi * radius_m / COUNTS_PER_REV;
    TEST_ASSERT_DOUBLE_WITHIN(distance * 1e-6, distance, x_m());
    TEST_ASSERT_EQUAL_INT32(0, odometry_theta_e4(&pose));
}

static void ten_kilometres_in_circles_end_within_a_millimetre_per_kilometre(void)
{
    /* The counts are exact here, so the reference is the same sum in double precision with libm. */
    const double per_count = 2.0 * pi * radius_m / COUNTS_PER_REV;
    double x = 0.0;
    double y = 0.0;
    int64_t difference = 0;
    int64_t sum = 0;
    for (long i = 0; i < 10000000; i++) {
        const int32_t left = 5 + (int32_t)(i % 2);
        const int32_t right = 6 + (int32_t)(i % 3 == 0);
        const double theta = (double)difference * per_count / wheelbase_m;
        const double turn = per_count * (right - left) / wheelbase_m;
        const double d = per_count * (left + right) / 2.0;
        x += d * cos(theta + turn / 2.0);
        y += d * sin(theta + turn / 2.0);
        difference += right - left;
        sum += left + right;
        odometry_step(&pose, &geometry, left, right);
    }
    const double travelled = (double)sum / 2.0 * per_count;
    const double error = hypot(x_m() - x, y_m() - y);
    const double turned = (double)difference * per_count / wheelbase_m;
    printf("%.0f m driven, %.0f rad turned: odometry error %.2e m, %.2e rad\n", travelled, turned, error,
           fabs(theta_rad() - turned));
    TEST_ASSERT_TRUE(travelled > 9000.0);
    TEST_ASSERT_TRUE(error < travelled * 1e-6);
    TEST_ASSERT_TRUE(fabs(theta_rad() - turned) < turned * 1e-6);
}

static void broken_encoder_cannot_make_the_pose_undefined(void)
{
    for (int i = 0; i < 1000; i++) {
        odometry_step(&pose, &geometry, INT32_MIN, INT32_MAX);
        odometry_step(&pose, &geometry, INT32_MAX, INT32_MAX);
        odometry_step(&pose, &geometry, INT32_MIN, INT32_MIN);
        (void)odometry_x_mm(&pose);
        (void)odometry_y_mm(&pose);
        (void)odometry_theta_e4(&pose);
    }
    odometry_step(&pose, &geometry, 1, 1);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(sine_and_cosine_are_good_to_a_millionth_all_round);
    RUN_TEST(sine_and_cosine_are_exact_at_the_quarters);
    RUN_TEST(one_tick_is_equation_24);
    RUN_TEST(straight_drive_keeps_its_heading);
    RUN_TEST(backward_drive_is_negative);
    RUN_TEST(pivot_about_the_standing_left_wheel_turns_left);
    RUN_TEST(arc_ends_where_equations_22_and_23_say);
    RUN_TEST(right_turn_mirrors_a_left_turn);
    RUN_TEST(one_count_a_second_is_not_lost);
    RUN_TEST(ten_kilometres_in_circles_end_within_a_millimetre_per_kilometre);
    RUN_TEST(broken_encoder_cannot_make_the_pose_undefined);
    return UNITY_END();
}
