/* T dd/dt = g (f - s F) - d beside a physical model's speed b; v = b + d, s = sign v, and v stays exactly 0 while F
 * can hold it. f and F are lookups; travel, place and heading are the model's own. */
#include "correction.h"

#include <math.h>
#include <stdbool.h>

#include "correction_numbers.h"

static const double turn_rad = 6.283185307179586;
static const double ringing_damping = 0.1;
static const double max_fall = 0.9;
static const double step_share = 0.08;

int correction_terms(void)
{
    return CORRECTION_TERMS;
}

double correction_longest_step_s(void)
{
    return step_share * fmin(correction_tau_s[0], correction_tau_s[1]);
}

/* At a jump (a place that the grid holds twice) what lies before it, unless z is beyond it or `after`. */
static double lookup(const struct correction_term *term, int wheel, double z, bool after)
{
    const double *grid = term->grid, *value = term->value[wheel];
    if (z < grid[0]) {
        return value[0];
    }
    for (int k = 1; k < term->count; k++) {
        const double width = grid[k] - grid[k - 1];
        if (z < grid[k] || (z == grid[k] && !after)) {
            return width > 0.0 ? value[k - 1] + (z - grid[k - 1]) / width * (value[k] - value[k - 1]) : value[k];
        }
    }
    return value[term->count - 1];
}

static double wrapped(double z, double period)
{
    const double rest = fmod(z, period);
    return rest < 0.0 ? rest + period : rest;
}

static double mean_of(const double pair[2])
{
    return 0.5 * (pair[0] + pair[1]);
}

/* Advance the memory of a term by h and return its variable, as a mean over h. */
static double remembered(struct correction *state, const struct correction_term *term, int slot, int w, double h,
                         double input)
{
    double *x = &state->memory[slot][w], *y = &state->rate[slot][w];
    if (term->variable == RECENT_EFFORT || term->variable == HEAT) {
        const double goal = term->variable == HEAT ? input * input : input;
        const double before = *x, keep = exp(-h / term->constant);
        *x = goal + (before - goal) * keep;
        const double mean = goal + (before - goal) * (1.0 - keep) * term->constant / h;
        return term->variable == HEAT ? mean : mean - input;
    }
    const double omega = turn_rad * term->constant;
    const int count = (int)ceil(h * omega / 0.1) > 0 ? (int)ceil(h * omega / 0.1) : 1;
    double deflection = 0.0, speed = 0.0;
    for (int n = 0; n < count; n++) {
        *y += h / count * omega * (input - *x - 2.0 * ringing_damping * *y);
        *x += h / count * omega * *y;
        deflection += *x / count;
        speed += *y / count;
    }
    return term->variable == RINGING || term->variable == MEAN_RINGING ? deflection - input : speed;
}

static double variable(struct correction *state, const struct correction_term *term, int slot, int w, double h,
                       const double effort[2], const double net[2])
{
    const double ahead = state->x_m * cos(state->heading_rad) + state->y_m * sin(state->heading_rad);
    switch (term->variable) {
    case OWN_SPEED:
        return state->speed_mps[w];
    case SPEED_DIFFERENCE:
        return state->speed_mps[w] - state->speed_mps[1 - w];
    case NET_EFFORT:
        return net[w];
    case OTHER_NET_EFFORT:
        return net[1 - w];
    case OWN_EFFORT:
        return effort[w];
    case OTHER_EFFORT:
        return effort[1 - w];
    case LOAD:
        return 0.5 * (fabs(effort[0]) + fabs(effort[1]));
    case RUN_TIME:
    case SET_TIME:
        return state->time_s;
    case TRAVEL:
        return state->travel_m[w];
    case TRAVEL_REPEATING:
    case ANGLE_REPEATING:
        return wrapped(state->travel_m[w], term->constant);
    case PLACE_X:
        return state->x_m;
    case PLACE_Y:
        return state->y_m;
    case PLACE_X_REPEATING:
        return wrapped(state->x_m, term->constant);
    case PLACE_Y_REPEATING:
        return wrapped(state->y_m, term->constant);
    case AHEAD:
        return ahead;
    case HEADING:
        return wrapped(state->heading_rad, turn_rad);
    case MEAN_RINGING:
    case MEAN_RINGING_RATE:
        return remembered(state, term, slot, w, h, mean_of(effort));
    default:
        return remembered(state, term, slot, w, h, effort[w]);
    }
}

void correction_step(struct correction *state, double h, const double effort[2], const double base_mps[2],
                     double wheelbase_m)
{
    double net[2], next[2], scale[2] = {0.0, 0.0};
    for (int w = 0; w < 2; w++) {
        net[w] = effort[w] - state->speed_mps[w] / correction_gain_mps[w];
    }
    for (int w = 0; w < 2; w++) {
        const double v = state->speed_mps[w];
        const double keep = exp(-h / correction_tau_s[w]);
        const double reach = (1.0 - keep) * correction_gain_mps[w];
        double force = correction_effort_share[w] * effort[w] + correction_drag[w] * v;
        double inertia = 0.0, friction = 0.0;
        /* What does not ask for the direction comes first: it decides the direction of a wheel at rest. */
        for (int k = 0; k < CORRECTION_TERMS; k++) {
            const struct correction_term *term = &correction_term[k];
            if (term->variable == OWN_SPEED && term->place != INERTIA_SHARE) {
                continue;
            }
            const double z = variable(state, term, k, w, h, effort, net);
            const double value = lookup(term, w, z, v >= 0.0);
            force += term->place == FORCE ? value : term->place == GAIN_SHARE ? value * effort[w] : 0.0;
            friction += term->place == DRY_FRICTION ? value : 0.0;
            inertia += term->place == INERTIA_SHARE ? value : 0.0;
            scale[w] += term->place == SIGNAL_SHARE ? value : 0.0;
        }
        force += fmax(inertia, -max_fall) * net[w];
        const double moved = base_mps[w] + state->added_mps[w] * keep + reach * force;
        const double way = v != 0.0 ? v : moved;
        for (int k = 0; k < CORRECTION_TERMS; k++) {
            const struct correction_term *term = &correction_term[k];
            if (term->variable == OWN_SPEED && term->place == DRY_FRICTION) {
                friction += lookup(term, w, way >= 0.0 ? fabs(v) : -fabs(v), way >= 0.0);
            }
        }
        const double pull = reach * friction;
        const bool held = friction > 0.0 && fabs(moved) <= pull;
        next[w] = held ? 0.0 : moved - (moved > 0.0 ? pull : -pull);
    }
    double step_m[2];
    for (int w = 0; w < 2; w++) {
        step_m[w] = 0.5 * h * (state->speed_mps[w] + next[w]);
        state->added_mps[w] = next[w] - base_mps[w];
        state->speed_mps[w] = next[w];
        state->travel_m[w] += step_m[w];
        for (int k = 0; k < CORRECTION_TERMS; k++) {
            const struct correction_term *term = &correction_term[k];
            if (term->variable == OWN_SPEED && term->place == SIGNAL_SHARE) {
                scale[w] += lookup(term, w, next[w], next[w] >= 0.0);
            }
        }
        state->shown_mps[w] = next[w] * (1.0 + scale[w]);
    }
    const double turn = wheelbase_m > 0.0 ? (step_m[1] - step_m[0]) / wheelbase_m : 0.0;
    state->x_m += mean_of(step_m) * cos(state->heading_rad + 0.5 * turn);
    state->y_m += mean_of(step_m) * sin(state->heading_rad + 0.5 * turn);
    state->heading_rad += turn;
    state->time_s += h;
}
