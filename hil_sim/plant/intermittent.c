/* What acts on the robot for some time only: a carpet, a push, a bearing that binds, knocks.
 *
 * When something acts is a function of seed and run, not of state: the same moments return whatever drives
 * the robot. */
#include "intermittent.h"

#include <math.h>

#include "noise.h"

/* Draws of one run and stream, at most. */
enum { DRAWS_PER_RUN = 1 << 16 };
enum { PUSH_ACTS, PUSH_BEGINS, PUSH_SIGN };

static const double step_s = PLANT_STEP_US * 1e-6;
/* A binding bearing grips about every so often: within this share of the time between. */
static const double bind_jitter = 0.25;

void intermittent_hold(struct intermittent *state, const double hold_nm[PLANT_WHEELS], uint64_t step)
{
    const bool held = hold_nm[0] > 0.0 || hold_nm[1] > 0.0;
    if (state->held && !held) {
        state->run++;
        state->begin_step = step;
    }
    state->held = held;
}

static double time_s(const struct intermittent *state, uint64_t step)
{
    return (double)(step - state->begin_step) * step_s;
}

static double draw(const struct intermittent *state, const struct intermittent_view *view,
                   enum noise_stream stream, uint64_t index)
{
    return noise_uniform(view->seed, stream, state->run * DRAWS_PER_RUN + index);
}

static bool within(double value, double from, double length)
{
    return value >= from && value < from + length;
}

/* Each stretch of `every_s` has one event, which begins within its first `room_s`. */
static bool recurs(const struct intermittent *state, const struct intermittent_view *view,
                   enum noise_stream stream, double every_s, double room_s, double for_s)
{
    const double now_s = time_s(state, view->step);
    const double stretch = floor(now_s / every_s);
    const double begin_s =
        stretch * every_s + fmax(room_s, 0.0) * draw(state, view, stream, (uint64_t)stretch);
    return within(now_s, begin_s, for_s);
}

static bool on_carpet(const struct intermittent *state, const struct plant_intermittent_effects *params,
                      const struct intermittent_view *view, int wheel)
{
    if (params->carpet_for_m > 0.0) {
        const struct chassis *chassis = view->chassis;
        const double left_m = 0.5 * chassis->params.wheelbase_m * (wheel == 0 ? 1.0 : -1.0);
        const double wheel_x_m = chassis->x_m - left_m * chassis->sin_theta;
        return within(wheel_x_m, params->carpet_from_m, params->carpet_for_m);
    }
    const double begin_s = params->carpet_from_s + params->carpet_room_s * draw(state, view, NOISE_CARPET, 0);
    return within(time_s(state, view->step), begin_s, params->carpet_for_s);
}

double intermittent_dry_nm(const struct intermittent *state, const struct plant_intermittent_effects *params,
                           const struct intermittent_view *view, int wheel)
{
    double dry_nm = 0.0;
    if (params->carpet_nm[wheel] > 0.0 && on_carpet(state, params, view, wheel)) {
        dry_nm += params->carpet_nm[wheel];
    }
    if (params->bind_nm[wheel] > 0.0 && recurs(state, view, NOISE_BIND, params->bind_every_s,
                                               bind_jitter * params->bind_every_s, params->bind_for_s)) {
        dry_nm += params->bind_nm[wheel];
    }
    return dry_nm;
}

/* Whether the run has a push and it acts now: its sign, else 0. */
static double pushed(const struct intermittent *state, const struct plant_intermittent_effects *params,
                     const struct intermittent_view *view)
{
    const double begin_s =
        params->push_from_s + params->push_room_s * draw(state, view, NOISE_PUSH, PUSH_BEGINS);
    if (draw(state, view, NOISE_PUSH, PUSH_ACTS) >= params->push_share ||
        !within(time_s(state, view->step), begin_s, params->push_for_s)) {
        return 0.0;
    }
    return draw(state, view, NOISE_PUSH, PUSH_SIGN) < 0.5 ? -1.0 : 1.0;
}

static double knocked(const struct intermittent *state, const struct plant_intermittent_effects *params,
                      const struct intermittent_view *view)
{
    const double room_s = params->knock_every_s - params->knock_for_s;
    if (!recurs(state, view, NOISE_KNOCK, params->knock_every_s, room_s, params->knock_for_s)) {
        return 0.0;
    }
    const double stretch = floor(time_s(state, view->step) / params->knock_every_s);
    return draw(state, view, NOISE_KNOCK_SIGN, (uint64_t)stretch) < 0.5 ? -1.0 : 1.0;
}

double intermittent_side_n(const struct intermittent *state, const struct plant_intermittent_effects *params,
                           const struct intermittent_view *view, int wheel)
{
    double force_n = 0.0;
    if (params->push_n[wheel] > 0.0) {
        force_n += params->push_n[wheel] * pushed(state, params, view);
    }
    if (params->knock_n[wheel] > 0.0) {
        force_n += params->knock_n[wheel] * knocked(state, params, view);
    }
    return force_n;
}
