/* The controller compiled for this machine, wired to the plant: the flashed image's sources without its chip.
 *
 * The timing of the chip's drivers between plant and core is reproduced here: counts are read at the tick, a
 * new effort holds from the PWM period that begins after the tick's work, the battery's voltage is the one
 * converted at the tick before. The phases are those that the image has on the virtual board
 * (tests/trials/test_host_robot.py compares the logs of both, byte for byte). */
#include "host_robot.h"

#include <stdlib.h>
#include <string.h>

#include "controller.h"
#include "hal_host.h"

enum {
    PWM_COUNTS = 8400, /* of one 20 kHz period at 168 MHz */
    EFFORT_FULL = 10000,
    ADC_FULL_SCALE = 4096,
    BATTERY_FULL_SCALE_MV = 36300,
    BATTERY_VALID_TICKS = 2, /* the first conversion ends before the second tick */
};

/* When the image acts on the virtual board, in microseconds after SysTick has wrapped: it reads the counters,
 * and converts the battery's voltage. An edge is dated `late_us` after it has passed its input's filter. When
 * the first tick comes, and how its efforts meet the PWM period, depends on how long the image takes to
 * start: these are the usual values; a comparison with a board reads them from the board. */
static const double read_lag_us = 0.333;
static const double convert_lag_us = 24.7;
static const double late_us = 0.12;
/* A level counts once it has held for eight samples at 21 / 8 MHz. */
static const double filter_us = 64.0 / 21.0;
static const double usual_first_tick_us = 14638.07;
static const double usual_drive_lag_us = 50.9;

/* The first edge of a wheel since the tick, as the board's timers date it. */
struct edge_watch {
    int64_t from; /* count of the tick */
    bool taken;
    double taken_us;
};

struct host_robot {
    struct hal_host board;
    struct controller controller;
    struct plant *plant;
    uint64_t plant_steps;
    uint64_t time_us;
    uint64_t next_tick_us;             /* the plant step whose counts the tick reads */
    double read_us;                    /* after that step; they have passed the filter then */
    uint64_t convert_step, drive_step; /* after that step; a new duty holds from the step under way */
    uint32_t ticks;
    uint16_t converted_mv;
    struct edge_watch watch[PLANT_WHEELS];
};

struct host_robot *host_robot_create(const struct plant_params *params, uint64_t seed,
                                     const uint8_t board_id[12])
{
    struct host_robot *robot = calloc(1, sizeof *robot);
    if (robot == NULL) {
        return NULL;
    }
    robot->plant = plant_create(params, seed);
    if (robot->plant == NULL) {
        free(robot);
        return NULL;
    }
    hal_host_init(&robot->board);
    robot->board.sample.battery_valid = false;
    robot->board.sample.battery_mv = 0;
    memcpy(robot->board.identity.board_id, board_id, sizeof robot->board.identity.board_id);
    host_robot_set_phases(robot, usual_first_tick_us, usual_drive_lag_us);
    for (int wheel = 0; wheel < PLANT_WHEELS; wheel++) {
        plant_set_bridge(robot->plant, wheel, 1.0, 1.0);
    }
    hal_host_select(&robot->board);
    controller_init(&robot->controller);
    return robot;
}

void host_robot_destroy(struct host_robot *robot)
{
    if (robot != NULL) {
        plant_destroy(robot->plant);
    }
    free(robot);
}

void host_robot_set_phases(struct host_robot *robot, double first_tick_us, double drive_lag_us)
{
    const double step_us = PLANT_STEP_US;
    const double seen_us = first_tick_us + read_lag_us - filter_us;
    robot->next_tick_us = (uint64_t)(seen_us / step_us) * PLANT_STEP_US;
    const double tick_us = first_tick_us - (double)robot->next_tick_us;
    robot->read_us = seen_us - (double)robot->next_tick_us;
    robot->convert_step = (uint64_t)((tick_us + convert_lag_us) / step_us);
    robot->drive_step = (uint64_t)((tick_us + drive_lag_us) / step_us);
}

static uint16_t converted_mv(const struct host_robot *robot)
{
    const double code = plant_battery_v(robot->plant) / (BATTERY_FULL_SCALE_MV / 1000.0) * ADC_FULL_SCALE;
    const uint32_t whole = code >= ADC_FULL_SCALE - 1 ? ADC_FULL_SCALE - 1u : (uint32_t)code;
    return (uint16_t)(whole * BATTERY_FULL_SCALE_MV / ADC_FULL_SCALE);
}

/* As the board's driver sets its compare registers: forward holds IN1 high, slow decay. */
static void drive(struct host_robot *robot, int wheel)
{
    const int32_t effort = robot->board.effort_e4[wheel];
    const int32_t size = effort < 0 ? -effort : effort;
    const int32_t driven = (size * PWM_COUNTS + EFFORT_FULL / 2) / EFFORT_FULL; /* whole timer counts */
    const double low = (double)(PWM_COUNTS - driven) / PWM_COUNTS;
    plant_set_bridge(robot->plant, wheel, effort < 0 ? low : 1.0, effort > 0 ? low : 1.0);
}

/* Count of a wheel as the board reads it at this time: encoders lag by one plant step. */
static int64_t count_at(const struct host_robot *robot, int wheel, double since_step_us)
{
    return plant_encoder_within(robot->plant, wheel, since_step_us / PLANT_STEP_US);
}

/* Searches for the first edge in a part of the last step. */
static void watch_stretch(struct host_robot *robot, int wheel, double from_us, double to_us)
{
    struct edge_watch *watch = &robot->watch[wheel];
    if (watch->taken || count_at(robot, wheel, to_us) == watch->from) {
        return;
    }
    double before_us = from_us;
    double after_us = to_us;
    while (after_us - before_us > 0.001) {
        const double middle_us = 0.5 * (before_us + after_us);
        const bool passed = count_at(robot, wheel, middle_us) != watch->from;
        *(passed ? &after_us : &before_us) = middle_us;
    }
    watch->taken = true;
    watch->taken_us = (double)(robot->plant_steps * PLANT_STEP_US) + after_us + filter_us + late_us;
}

/* One plant step, with the search for edges that are awaited. */
static void advance_step(struct host_robot *robot, double until_us)
{
    plant_advance(robot->plant, 1);
    robot->plant_steps++;
    for (int wheel = 0; wheel < PLANT_WHEELS; wheel++) {
        watch_stretch(robot, wheel, 0.0, until_us);
    }
}

static void advance_to(struct host_robot *robot, uint64_t steps)
{
    while (robot->plant_steps < steps) {
        if (robot->watch[0].taken && robot->watch[1].taken) {
            plant_advance(robot->plant, steps - robot->plant_steps);
            robot->plant_steps = steps;
            return;
        }
        advance_step(robot, robot->plant_steps + 1 < steps ? PLANT_STEP_US : robot->read_us);
    }
}

static void sense(struct host_robot *robot)
{
    struct hal_sample *sample = &robot->board.sample;
    for (int wheel = 0; wheel < PLANT_WHEELS; wheel++) {
        struct edge_watch *watch = &robot->watch[wheel];
        const int64_t count = count_at(robot, wheel, robot->read_us);
        sample->counts[wheel] = (int32_t)count;
        sample->edge_dated[wheel] = watch->taken && count != watch->from;
        sample->edge_us[wheel] = (uint32_t)(uint64_t)watch->taken_us;
        sample->edge_from[wheel] = (int32_t)watch->from;
        *watch = (struct edge_watch){.from = count};
    }
    /* hal_sense adds the tick that has passed. */
    sample->now_us =
        (uint32_t)(uint64_t)((double)robot->next_tick_us + robot->read_us + filter_us) - HAL_HOST_TICK_US;
    robot->ticks++;
    sample->battery_valid = robot->ticks >= BATTERY_VALID_TICKS;
    sample->battery_mv = sample->battery_valid ? robot->converted_mv : 0;
}

static void tick(struct host_robot *robot)
{
    const uint64_t step = robot->next_tick_us / PLANT_STEP_US;
    advance_to(robot, step);
    sense(robot);
    const int16_t before[HAL_WHEELS] = {robot->board.effort_e4[0], robot->board.effort_e4[1]};
    controller_tick(&robot->controller);
    controller_poll(&robot->controller);
    for (int wheel = 0; wheel < PLANT_WHEELS; wheel++) {
        watch_stretch(robot, wheel, robot->read_us, PLANT_STEP_US);
    }
    for (uint64_t i = 0; i <= robot->convert_step || i <= robot->drive_step; i++) {
        if (i > 0) {
            advance_step(robot, PLANT_STEP_US);
        }
        if (i == robot->convert_step) {
            robot->converted_mv = converted_mv(robot);
        }
        for (int wheel = 0; wheel < PLANT_WHEELS && i == robot->drive_step; wheel++) {
            if (robot->board.effort_e4[wheel] != before[wheel]) {
                drive(robot, wheel);
            }
        }
    }
    robot->next_tick_us += HAL_HOST_TICK_US;
}

void host_robot_run_us(struct host_robot *robot, uint64_t span_us)
{
    hal_host_select(&robot->board);
    const uint64_t end_us = robot->time_us + span_us;
    controller_poll(&robot->controller);
    while (robot->next_tick_us <= end_us) {
        robot->time_us = robot->next_tick_us;
        tick(robot);
    }
    robot->time_us = end_us;
}

uint64_t host_robot_time_us(const struct host_robot *robot)
{
    return robot->time_us;
}

void host_robot_link_write(struct host_robot *robot, const uint8_t *data, size_t length)
{
    hal_host_select(&robot->board);
    size_t taken = hal_host_receive(&robot->board, data, length);
    while (taken < length) {
        controller_poll(&robot->controller);
        const size_t more = hal_host_receive(&robot->board, data + taken, length - taken);
        if (more == 0) {
            return; /* the line is as full as it gets: lost, as on a line that overruns */
        }
        taken += more;
    }
    controller_poll(&robot->controller);
}

size_t host_robot_link_read(struct host_robot *robot, uint8_t *out, size_t capacity)
{
    return hal_host_take_sent(&robot->board, out, capacity);
}

struct plant *host_robot_plant(struct host_robot *robot)
{
    return robot->plant;
}
