/* A motor driver with delay, lag, dead band, limits and direction-dependent gain.
 *
 * In this order: delay, effort dropouts, lag, governor, dead band, reverse gain, square law. The dead band
 * has a rounded knee a tenth as wide as itself; the governor reduces the effort in proportion to the excess
 * of its own filtered speed. */
#include "driver.h"

#include <math.h>

#include "noise.h"

static const double step_s = PLANT_STEP_US * 1e-6;

/* Effort reduction per m/s above the limit, and the governor's filter. */
static const double governor_gain = 40.0;
static const double governor_filter_s = 0.004;

static double clamp(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

void driver_init(struct driver *driver)
{
    *driver = (struct driver){.given = 0.0};
}

void driver_ask(struct driver *driver, double in1_duty, double in2_duty)
{
    const double in1 = in1_duty > 0.0 ? fmin(in1_duty, 1.0) : 0.0;
    const double in2 = in2_duty > 0.0 ? fmin(in2_duty, 1.0) : 0.0;
    driver->asked = in1 - in2;
    driver->asked_to_float = in1 == 0.0 && in2 == 0.0;
}

static double delayed(struct driver *driver, double delay_s)
{
    const uint32_t back = (uint32_t)(delay_s / step_s + 0.5);
    const uint32_t now = driver->line_at;
    driver->line[now] = (float)driver->asked;
    driver->line_at = now + 1 == DRIVER_LINE_STEPS ? 0 : now + 1;
    const uint32_t then = now >= back ? now - back : now + DRIVER_LINE_STEPS - back;
    return (double)driver->line[then];
}

/* One dropout begins at a random time within each mean interval. */
static bool dropped_out(const struct plant_driver_effects *params, int wheel, uint64_t seed, uint64_t step)
{
    if (params->dropout_every_s <= 0.0 || params->dropout_wheels[wheel] == 0.0) {
        return false;
    }
    const double time_s = (double)step * step_s;
    const double stretch = floor(time_s / params->dropout_every_s);
    const enum noise_stream stream = wheel == 0 ? NOISE_DRIVER_LEFT : NOISE_DRIVER_RIGHT;
    const double room_s = params->dropout_every_s - params->dropout_s;
    const double begin_s =
        stretch * params->dropout_every_s + room_s * noise_uniform(seed, stream, (uint64_t)stretch);
    return time_s >= begin_s && time_s < begin_s + params->dropout_s;
}

static double beyond_deadband(double effort, double deadband)
{
    const double size = fabs(effort);
    const double knee = 0.1 * deadband;
    const double excess = size - deadband;
    if (excess >= knee) {
        return copysign(excess, effort);
    }
    if (excess <= -knee) {
        return 0.0;
    }
    return copysign((excess + knee) * (excess + knee) / (4.0 * knee), effort);
}

static double governed(struct driver *driver, double effort, double limit_mps, double rim_mps)
{
    driver->speed_mps += (rim_mps - driver->speed_mps) * step_s / governor_filter_s;
    const double excess = fabs(driver->speed_mps) - limit_mps;
    if (excess <= 0.0 || effort * driver->speed_mps <= 0.0) {
        return effort;
    }
    const double left = fabs(effort) - governor_gain * excess;
    return copysign(left > 0.0 ? left : 0.0, effort);
}

double driver_step(struct driver *driver, const struct plant_driver_effects *params, int wheel, uint64_t seed,
                   uint64_t step, double rim_mps)
{
    double effort = params->delay_s > 0.0 ? delayed(driver, params->delay_s) : driver->asked;
    if (dropped_out(params, wheel, seed, step)) {
        return driver->given = NAN;
    }
    const bool floats = driver->asked_to_float || (params->floats_at_zero != 0.0 && effort == 0.0);
    if (params->lag_s > 0.0) {
        driver->lagged += (effort - driver->lagged) * step_s / (params->lag_s + step_s);
        effort = driver->lagged;
    }
    if (params->speed_limit_mps > 0.0) {
        effort = governed(driver, effort, params->speed_limit_mps, rim_mps);
    }
    if (params->deadband > 0.0) {
        effort = beyond_deadband(effort, params->deadband);
    }
    if (effort < 0.0 && params->reverse_gain[wheel] > 0.0) {
        effort *= params->reverse_gain[wheel];
    }
    effort = (1.0 - params->square_law) * effort + params->square_law * effort * fabs(effort);
    return driver->given = floats ? NAN : clamp(effort, -1.0, 1.0);
}
