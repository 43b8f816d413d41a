/* Random commands, faults and time through the whole controller: what must hold in every state, and which
 * states lead to which. With --edges the program prints the edges only. */
#include <stdio.h>

#include "fixture.h"
#include "random.h"

enum { STEPS = 8000000, STATES = 4 };

static bool edges[STATES][STATES];
static uint32_t fault_seen; /* latched at some time */
static uint32_t visits[STATES];
static uint32_t stops_obeyed;
static int32_t jump[HAL_WHEELS];
static bool frozen[HAL_WHEELS];
static bool backwards[HAL_WHEELS];
static double held_m[HAL_WHEELS];

void setUp(void)
{
}

void tearDown(void)
{
}

static uint8_t state(void)
{
    return fixture.controller.robot.supervisor.state;
}

static float random_between(float low, float high)
{
    return low + (high - low) * (float)random_below(10001) / 10000.0f;
}

/* Encoder counts: the motors' travel, unless a fault is injected. */
static void sense(void)
{
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        const double before = fixture.motor[wheel].travel_m;
        fixture_turn_motor(&fixture.motor[wheel], fixture.board.effort_e4[wheel] / 10000.0);
        const double moved = fixture.motor[wheel].travel_m - before;
        if (!frozen[wheel]) {
            held_m[wheel] += backwards[wheel] ? -moved : moved;
        }
        fixture.board.sample.counts[wheel] =
            (int32_t)floor(held_m[wheel] / fixture_metres_per_count()) + jump[wheel];
    }
}

static void note_edge(uint8_t before)
{
    edges[before][state()] = true;
    visits[state()]++;
    fault_seen |= fixture.controller.robot.supervisor.latched;
}

/* Nothing that commands effort while a stop is latched, or while idle. */
static void assert_safe(void)
{
    if (state() == PROTO_STATE_STOPPED || state() == PROTO_STATE_IDLE) {
        TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
        TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[1]);
    }
    const bool latched = fixture.controller.robot.supervisor.latched != 0;
    TEST_ASSERT_EQUAL(latched, state() == PROTO_STATE_STOPPED);
    TEST_ASSERT_EQUAL_HEX32(0, fixture.controller.robot.supervisor.latched & ~PROTO_FAULTS_THAT_STOP);
}

static void tick(void)
{
    const uint8_t before = state();
    sense();
    controller_tick(&fixture.controller);
    note_edge(before);
    assert_safe();
    const uint8_t between = state();
    controller_poll(&fixture.controller);
    note_edge(between);
    assert_safe();
}

static void upload_something(void)
{
    struct proto_segment segments[4];
    const size_t count = 1 + random_below(4);
    for (size_t i = 0; i < count; i++) {
        segments[i] = (struct proto_segment){
            .kind = (uint8_t)random_below(3),
            .duration_ms = 1 + random_below(1200),
            .a = random_between(-0.8f, 0.8f),
            .b = random_between(-0.8f, 0.8f),
        };
    }
    if (state() != PROTO_STATE_SEQUENCE) {
        (void)fixture_upload(segments, count, 0);
    }
}

static void command(void)
{
    const uint8_t before = state();
    switch (random_below(8)) {
    case 0:
        fixture_set_effort(random_between(-1.1f, 1.1f), random_between(-1.1f, 1.1f));
        break;
    case 1:
        fixture_set_velocity(random_between(-1.6f, 1.6f), random_between(-1.6f, 1.6f));
        break;
    case 2:
        fixture_stop();
        fixture_expect_accepted();
        TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
        TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[1]);
        TEST_ASSERT_TRUE(state() == PROTO_STATE_IDLE || state() == PROTO_STATE_STOPPED);
        stops_obeyed++;
        break;
    case 3:
    case 4:
        fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
        break;
    case 5:
        upload_something();
        break;
    case 6:
        fixture_ask_start(fixture.controller.robot.sequence.crc, (uint8_t)random_below(2));
        break;
    default:
        fixture_ask(PROTO_ID_SEQ_ABORT, NULL, 0);
        break;
    }
    note_edge(before);
    assert_safe();
}

static void break_or_mend(void)
{
    const int wheel = (int)random_below(HAL_WHEELS);
    switch (random_below(24)) {
    case 18:
        fixture.board.sample.supply_dip = true;
        break;
    case 15:
        fixture.controller.robot.heat[wheel].heat_a2 = 10.0f;
        break;
    case 14:
        fixture.board.sample.battery_mv = 36000;
        break;
    case 0:
    case 9:
        fixture.board.sample.battery_mv = 8000;
        break;
    case 1:
        fixture.board.sample.battery_valid = random_below(3) != 0;
        break;
    case 2:
        frozen[wheel] = true;
        break;
    case 3:
        backwards[wheel] = true;
        break;
    case 4:
        jump[wheel] += (int32_t)random_below(2000) - 1000;
        break;
    case 5:
        controller_note_overrun(&fixture.controller);
        break;
    case 6:
        fixture.controller.robot.sequence.segments[0].duration_ms ^= 1u << random_below(8);
        break;
    case 7:
    case 16:
    case 17:
        fixture.motor[wheel].friction = 2.0; /* held */
        break;
    case 8:
        fixture.motor[wheel].gain_mps = 3.8; /* a stronger supply */
        break;
    case 10:
        fixture.controller.robot.supervisor.store_damaged = true;
        break;
    case 13:
        fixture.board.emergency_switch_open = true;
        break;
    case 12:
        fixture.controller.since_poll_ms = CONTROLLER_POLL_MS;
        break;
    case 11:
        fixture.controller.robot.drive.command[wheel] = NAN;
        break;
    default:
        fixture.controller.robot.supervisor.store_damaged = false;
        fixture.board.emergency_switch_open = false;
        fixture.board.sample.supply_dip = false;
        fixture.board.sample.battery_mv = 12000;
        fixture.board.sample.battery_valid = true;
        for (int i = 0; i < HAL_WHEELS; i++) {
            frozen[i] = false;
            backwards[i] = false;
            fixture.motor[i].friction = 0.02;
            fixture.motor[i].gain_mps = 1.5;
        }
        break;
    }
}

/* Or there is no thermal limit. */
static void set_motors(void)
{
    fixture_set_parameter(PROTO_PARAMETER_MOTOR_RESISTANCE_OHM, 6.0f);
    fixture_set_parameter(PROTO_PARAMETER_MOTOR_EMF_VS_PER_M, 7.0f);
    fixture_set_parameter(PROTO_PARAMETER_MOTOR_CONTINUOUS_A, 3.0f);
    fixture_set_parameter(PROTO_PARAMETER_MOTOR_THERMAL_S, 10.0f);
}

/* Occasionally the board restarts, with every possible reset cause. */
static void start_anew(void)
{
    static const uint8_t causes[] = {0x0E, 0x24, 0x14, 0x06, 0x04};
    struct hal_identity *const identity = &fixture.board.identity;
    identity->reset_cause = causes[random_below(sizeof causes)];
    identity->program_fault = random_below(4) == 0;
    identity->brown_out_reset = random_below(4) != 0;
    identity->was_moving = fixture.board.moving;
    identity->clock_fallback = random_below(4) == 0;
    controller_init(&fixture.controller);
    TEST_ASSERT_FALSE(fixture.controller.robot.supervisor.armed);
    set_motors();
    fixture_arm();
    note_edge(state());
    assert_safe();
}

static void run(void)
{
    random_seed(1);
    fixture_power_up();
    set_motors();
    for (int step = 0; step < STEPS; step++) {
        if (random_below(160) == 0) {
            command();
        }
        if (random_below(200) == 0) {
            break_or_mend();
        }
        if (random_below(20000) == 0) {
            start_anew();
        }
        tick();
    }
}

static void no_state_commands_effort_while_a_stop_is_latched_and_every_stop_is_obeyed(void)
{
    run();
    TEST_ASSERT_TRUE(stops_obeyed > 500);
    for (int i = 0; i < STATES; i++) {
        TEST_ASSERT_TRUE_MESSAGE(visits[i] > 1000, proto_state_name((unsigned)i));
    }
}

static void every_fault_that_stops_was_latched_on_the_way(void)
{
    for (unsigned bit = 0; bit < PROTO_FAULT_COUNT; bit++) {
        if (supervisor_row(bit).stops) {
            TEST_ASSERT_TRUE_MESSAGE((fault_seen & 1u << bit) != 0, proto_fault_name(bit));
        }
    }
}

static void print_edges(void)
{
    for (unsigned from = 0; from < STATES; from++) {
        for (unsigned to = 0; to < STATES; to++) {
            if (from != to && edges[from][to]) {
                printf("edge %s %s\n", proto_state_name(from), proto_state_name(to));
            }
        }
    }
    static const char *const clears[] = {"when gone", "at once", "never"};
    for (unsigned bit = 0; bit < PROTO_FAULT_COUNT; bit++) {
        const struct supervisor_row row = supervisor_row(bit);
        printf("fault %s | %u | %s | %s\n", proto_fault_name(bit), (unsigned)row.hold_ms,
               row.stops ? "yes" : "no", clears[row.clears]);
    }
}

int main(int count, char **arguments)
{
    if (count > 1 && strcmp(arguments[1], "--edges") == 0) {
        run();
        print_edges();
        return 0;
    }
    UNITY_BEGIN();
    RUN_TEST(no_state_commands_effort_while_a_stop_is_latched_and_every_stop_is_obeyed);
    RUN_TEST(every_fault_that_stops_was_latched_on_the_way);
    return UNITY_END();
}
