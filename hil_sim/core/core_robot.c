/* The controller compiled for this machine, wired to the plant: the flashed image's sources without its chip.
 *
 * What the chip's drivers do between plant and core is done here by the clock alone: counts are read at the
 * tick, a new effort holds from the PWM period that begins after the tick's work, the battery's voltage is
 * the one converted at the tick before. The phases are those that the image has on the virtual board
 * (tests/trials/test_core_robot.py compares the logs of both, byte for byte).
 */
#include "core_robot.h"

#include <stdlib.h>
#include <string.h>

#include "controller.h"
#include "hal_host.h"
#include "sensor.h"

enum {
    STEPS_PER_MS = 1000 / PLANT_STEP_US,
    PWM_COUNTS = 8400, /* of one 20 kHz period at 168 MHz */
    EFFORT_FULL = 10000,
    ADC_FULL_SCALE = 4096,
    BATTERY_FULL_SCALE_MV = 36300,
    BATTERY_VALID_TICKS = 2, /* the first conversion ends before the second tick */
};

/* The first tick after power-up, and where its reading of the counters lies within a plant step. */
static const uint64_t first_tick_us = 3000;
static const double read_share = 0.0;
enum { DRIVE_AFTER_STEPS = 1 };

struct core_robot {
    struct hal_host board;
    struct controller controller;
    struct plant *plant;
    uint64_t plant_steps;
    uint64_t time_us;
    uint64_t next_tick_us;
    uint32_t ticks;
    uint16_t converted_mv;
};

struct core_robot *core_robot_create(const struct plant_params *params, uint64_t seed,
                                     const uint8_t board_id[12])
{
    struct core_robot *robot = calloc(1, sizeof *robot);
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
    robot->next_tick_us = first_tick_us;
    for (int wheel = 0; wheel < PLANT_WHEELS; wheel++) {
        plant_set_bridge(robot->plant, wheel, 1.0, 1.0);
    }
    hal_host_select(&robot->board);
    controller_init(&robot->controller);
    return robot;
}

void core_robot_destroy(struct core_robot *robot)
{
    if (robot != NULL) {
        plant_destroy(robot->plant);
    }
    free(robot);
}

static void advance_plant(struct core_robot *robot, uint64_t to_steps)
{
    if (to_steps > robot->plant_steps) {
        plant_advance(robot->plant, to_steps - robot->plant_steps);
        robot->plant_steps = to_steps;
    }
}

static uint16_t converted_mv(const struct core_robot *robot)
{
    const double code = plant_battery_v(robot->plant) / (BATTERY_FULL_SCALE_MV / 1000.0) * ADC_FULL_SCALE;
    const uint32_t whole = code >= ADC_FULL_SCALE - 1 ? ADC_FULL_SCALE - 1u : (uint32_t)code;
    return (uint16_t)(whole * BATTERY_FULL_SCALE_MV / ADC_FULL_SCALE);
}

/* As the board's driver sets its compare registers: forward holds IN1 high, slow decay. */
static void drive(struct core_robot *robot, int wheel)
{
    const int32_t effort = robot->board.effort_e4[wheel];
    const int32_t size = effort < 0 ? -effort : effort;
    const double low =
        (double)(PWM_COUNTS - (size * PWM_COUNTS + EFFORT_FULL / 2) / EFFORT_FULL) / PWM_COUNTS;
    plant_set_bridge(robot->plant, wheel, effort < 0 ? low : 1.0, effort > 0 ? low : 1.0);
}

static void tick(struct core_robot *robot)
{
    advance_plant(robot, robot->next_tick_us / PLANT_STEP_US);
    struct hal_sample *sample = &robot->board.sample;
    for (int wheel = 0; wheel < PLANT_WHEELS; wheel++) {
        sample->counts[wheel] = (int32_t)plant_encoder_within(robot->plant, wheel, read_share);
    }
    robot->ticks++;
    sample->battery_valid = robot->ticks >= BATTERY_VALID_TICKS;
    sample->battery_mv = sample->battery_valid ? robot->converted_mv : 0;
    robot->converted_mv = converted_mv(robot);
    const int16_t before[HAL_WHEELS] = {robot->board.effort_e4[0], robot->board.effort_e4[1]};
    controller_tick(&robot->controller);
    controller_poll(&robot->controller);
    for (int wheel = 0; wheel < PLANT_WHEELS; wheel++) {
        if (robot->board.effort_e4[wheel] != before[wheel]) {
            advance_plant(robot, robot->next_tick_us / PLANT_STEP_US + DRIVE_AFTER_STEPS);
            drive(robot, wheel);
        }
    }
    robot->next_tick_us += HAL_HOST_TICK_US;
}

void core_robot_run_us(struct core_robot *robot, uint64_t span_us)
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

uint64_t core_robot_time_us(const struct core_robot *robot)
{
    return robot->time_us;
}

void core_robot_link_write(struct core_robot *robot, const uint8_t *data, size_t length)
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

size_t core_robot_link_read(struct core_robot *robot, uint8_t *out, size_t capacity)
{
    return hal_host_take_sent(&robot->board, out, capacity);
}

struct plant *core_robot_plant(struct core_robot *robot)
{
    return robot->plant;
}
