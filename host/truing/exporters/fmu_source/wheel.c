/* time_constant dv/dt = gain (drive - friction sign(v)) - v, solved in closed form between changes of the
 * drive. */
#include "wheel.h"

#include <math.h>
#include <stddef.h>

/* Longest step (s) where friction depends on speed, or the drive on a lag. */
static const double longest_step_s = 1e-3;
static const double tiny_s = 1e-12;

/* (1 - exp(-rate h)) / rate, also for a rate near zero. */
static double decay_integral(double rate, double h)
{
    const double z = rate * h;
    return fabs(z) < 1e-9 ? h * (1.0 - 0.5 * z) : -expm1(-z) / rate;
}

/* One step without a stop inside, under a constant drive; how long it was. */
static double roll_once(struct wheel *wheel, double drive, double h)
{
    const double *p = wheel->parameter;
    const double v = wheel->speed_mps;
    const bool forward = v > 0.0 || (v == 0.0 && drive >= 0.0);
    const double sign = forward ? 1.0 : -1.0;
    const double excess = p[BREAKAWAY_EXCESS] * (forward ? 1.0 : p[REVERSE_EXCESS]);
    const double gain = p[GAIN] * (forward ? 1.0 : p[REVERSE_GAIN]);
    const double tau = p[TIME_CONSTANT] * (forward ? 1.0 : p[REVERSE_TIME_CONSTANT]);
    double friction = p[FRICTION] * (forward ? 1.0 : p[REVERSE_FRICTION]);
    if (v == 0.0 && fabs(drive) <= friction + excess) {
        return h;
    }
    const double speed = fabs(v);
    double slope = 0.0;
    if (p[STRIBECK] > 0.0 && excess > 0.0) {
        const double z = pow(speed / p[STRIBECK], p[STRIBECK_SHAPE]);
        const double part = excess * exp(-z);
        friction += part;
        if (speed > 0.0) {
            slope -= part * p[STRIBECK_SHAPE] * z / speed;
        } else if (p[STRIBECK_SHAPE] == 1.0) {
            slope -= part / p[STRIBECK];
        }
    }
    friction += p[DRAG] * speed * speed;
    slope += 2.0 * p[DRAG] * speed;
    /* dv/dt = level - rate v, friction linearised about v. */
    const double rate = (1.0 + gain * slope) / tau;
    const double level = gain * (drive - sign * friction + slope * v) / tau;
    double end = v * exp(-rate * h) + level * decay_integral(rate, h);
    if (v != 0.0 && end * sign <= 0.0) {
        const double stop =
            fabs(rate * v) < 1e-9 * fabs(level) ? -v / level : log1p(-rate * v / level) / rate;
        h = fmin(h, stop);
        end = 0.0;
    }
    if (fabs(rate * h) < 1e-6) {
        wheel->travel_m += v * h + (level - rate * v) * 0.5 * h * h;
    } else {
        wheel->travel_m += level / rate * h + (v - level / rate) * decay_integral(rate, h);
    }
    wheel->speed_mps = end;
    return h;
}

static void roll(struct wheel *wheel, double drive, double duration_s)
{
    const double *p = wheel->parameter;
    const bool small = p[DRAG] != 0.0 || p[LAG] > 0.0 || (p[STRIBECK] > 0.0 && p[BREAKAWAY_EXCESS] > 0.0);
    double left = duration_s;
    while (left > tiny_s) {
        double h = small ? fmin(left, longest_step_s) : left;
        double now = drive;
        if (p[LAG] > 0.0) {
            now += (wheel->lagged - drive) * -expm1(-h / p[LAG]) * p[LAG] / h; /* its mean over the step */
        }
        h = roll_once(wheel, now, h);
        if (p[LAG] > 0.0) {
            wheel->lagged = drive + (wheel->lagged - drive) * exp(-h / p[LAG]);
        }
        left -= h;
    }
}

/* What the driver makes of an effort: nothing within its dead band, and less by it beyond. */
static double driven(const struct wheel *wheel, double effort)
{
    return copysign(fmax(fabs(effort) - wheel->parameter[DEADBAND], 0.0), effort);
}

bool wheel_step(struct wheel *wheel, double begin_s, double duration_s)
{
    const double end = begin_s + duration_s;
    const struct coming *newest = &wheel->queue[(wheel->first + wheel->count + QUEUE - 1u) % QUEUE];
    const double latest = wheel->count > 0u ? newest->effort : wheel->effort;
    if (wheel->input != latest) {
        if (wheel->count == QUEUE) {
            return false;
        }
        wheel->queue[(wheel->first + wheel->count) % QUEUE] =
            (struct coming){.arrival_s = begin_s + wheel->parameter[DELAY], .effort = wheel->input};
        wheel->count++;
    }
    double now = begin_s;
    for (;;) {
        while (wheel->count > 0u && wheel->queue[wheel->first].arrival_s <= now + tiny_s) {
            wheel->effort = wheel->queue[wheel->first].effort;
            wheel->first = (wheel->first + 1u) % QUEUE;
            wheel->count--;
        }
        const double until = wheel->count > 0u ? fmin(end, wheel->queue[wheel->first].arrival_s) : end;
        roll(wheel, driven(wheel, wheel->effort) + wheel->parameter[OFFSET], until - now);
        now = until;
        if (until >= end) {
            return true;
        }
    }
}

const char *wheel_problem(const struct wheel *wheel)
{
    const double *p = wheel->parameter;
    for (int k = 0; k < PARAMETERS; k++) {
        if (!isfinite(p[k])) {
            return "a parameter is not finite";
        }
    }
    if (p[TIME_CONSTANT] <= 0.0 || p[REVERSE_TIME_CONSTANT] <= 0.0) {
        return "a time constant must be above zero";
    }
    if (p[DELAY] < 0.0 || p[LAG] < 0.0 || p[FRICTION] < 0.0 || p[BREAKAWAY_EXCESS] < 0.0 ||
        p[DEADBAND] < 0.0) {
        return "delay, lag, friction and dead band must not be below zero";
    }
    return NULL;
}
