/* Plausibility of one wheel's counts under its effort: encoder lost or reversed, wheel stalled. */
#include "wheel_watch.h"

#include "rounding.h"

static const float effort_per_e4 = 1e-4f;
/* A motion must be this fast, in counts within BEFORE_MS, for its end to be called sudden. */
static const int32_t fast_counts = 8;
/* What a pivot, a slope of 3 degrees or the other wheel can do against a wheel's effort. */
static const float borne_effort = 0.1f;
/* A wheel that rolls while it is braked is driven by a force that balances the brake, kv v in effort; half as
 * much again while it has not reached that speed yet. */
static const float rolling_share = 1.5f;
/* Efforts below this do not count as driving. */
static const float min_effort = 0.05f;
/* The speed that a wheel may reach against its effort before it is called reversed, m/s. */
static const float free_speed_mps = 0.07f;
/* A wheel stands below this; it is a fifth of a count a tick on the paper's robot. */
static const float standing_mps = 0.03f;
/* Share of the other wheel's effort that the chassis may turn against this one: (1 - q) / (1 + q), with
 * q = yaw inertia / (mass * half wheelbase^2). 0.25 for the paper's robot; this is for a robot of q = 0.43,
 * whose mass sits closer to its middle than that of a full disc (0.5). */
static const float chassis_share = 0.4f;

/* A robot of a long body, q = 1.7, turns the other way: there the wheels' efforts in opposite directions
 * meet. */
static const float long_chassis_share = 0.25f;
/* A geared motor's own friction, which no push from outside overcomes for nothing. */
static const float least_friction = 0.02f;
/* Share of stall_effort that a wheel's friction may take, and by how much a robot may be heavier than its
 * feedforward says, before its start is called overdue; no faster than this, m/s. */
static const float start_friction_share = 0.6f;
static const float start_mass_factor = 2.0f;
static const float start_speed_mps = 0.05f;
/* A motion must be this fast, in counts within UNTURNED_MS, for its turning round to be called sudden. */
static const int32_t turn_counts = 6;

/* Efforts that a motor does not bear for long while it stands; large enough for stiff starts below. */
static const float large_effort = 0.49f;

/* What acts on a wheel. */
struct wheel_push {
    float effort;
    float other_effort; /* the other wheel's, which the chassis carries over */
    float speed_mps;    /* estimate of velocity mode: bounded by the absence of counts */
};

void wheel_watch_init(struct wheel_watch *watch, int32_t counts)
{
    *watch = (struct wheel_watch){.place = counts};
    for (int i = 0; i < WHEEL_WATCH_HISTORY_MS; i++) {
        watch->history[i] = counts;
    }
}

bool wheel_watch_is_finite(const struct wheel_watch *watch)
{
    return is_finite(watch->borne + watch->work + watch->energy + watch->initial_energy + watch->creep_m +
                     watch->due.way_m + watch->soonest.way_m);
}

static int8_t direction(float value, float deadband)
{
    if (value > deadband) {
        return 1;
    }
    return value < -deadband ? -1 : 0;
}

static int32_t history_ago(const struct wheel_watch *watch, uint32_t ms)
{
    return watch->history[(watch->next + WHEEL_WATCH_HISTORY_MS - ms) % WHEEL_WATCH_HISTORY_MS];
}

static void count_up(uint16_t *ms)
{
    if (*ms < UINT16_MAX) {
        (*ms)++;
    }
}

/* More counts than any encoder makes raise another fault, and would overflow here. */
static int32_t within(int32_t counts)
{
    const int32_t bound = 1000000;
    if (counts > bound) {
        return bound;
    }
    return counts < -bound ? -bound : counts;
}

/* Whether the last counts of a motion were nearly as dense as those before, by so many quarters: a wheel
 * slows down before it stops, a failing encoder stops counting at once. */
static int8_t sudden_end(int32_t recent, int32_t before, int32_t quarters)
{
    recent = within(recent);
    before = within(before);
    const int32_t speed = before < 0 ? -before : before;
    const int32_t end = before < 0 ? -recent : recent;
    const bool dense = 4 * end * WHEEL_WATCH_BEFORE_MS >= quarters * speed * WHEEL_WATCH_RECENT_MS;
    if (speed < fast_counts || !dense) {
        return 0;
    }
    return before < 0 ? (int8_t)-1 : (int8_t)1;
}

/* One tick of a wheel that an acceleration moves on its way to counts; notes when it gets there. */
static void approach(struct wheel_start *start, float acceleration_mps2, float counts_m, uint16_t ms)
{
    start->mps += 0.001f * acceleration_mps2;
    start->way_m += 0.001f * start->mps;
    if (start->ms == 0u && start->way_m >= counts_m) {
        start->ms = ms;
    }
}

/* How a start from rest under this effort goes: without friction, and with stiff wheels and double mass. */
static void expect_start(struct wheel_watch *watch, const struct tuning *tuning, int wheel, float effort)
{
    const float size = absf(effort);
    const float surplus = size - start_friction_share * tuning->stall_effort;
    const float counts_m = (float)(WHEEL_WATCH_DITHER_COUNTS + 1) * tuning->metres_per_count;
    const float ka = tuning->watch_ka[wheel];
    approach(&watch->soonest, size / ka, counts_m, watch->standing_ms);
    approach(&watch->due, surplus / (start_mass_factor * ka), counts_m, watch->standing_ms);
    watch->due.mps = watch->due.mps < start_speed_mps ? watch->due.mps : start_speed_mps;
}

static void forget_start(struct wheel_watch *watch)
{
    watch->soonest = (struct wheel_start){0};
    watch->due = (struct wheel_start){0};
}

/* By how much a start from rest came later than it could have: a driver's delay, above all, which nothing
 * else tells. */
static void learn_start(struct wheel_watch *watch)
{
    const uint16_t least_ms = 10; /* a wheel that moves sooner has not been at rest */
    const uint16_t soonest_ms = watch->soonest.ms;
    if (watch->moved || !watch->rested || watch->standing_ms < least_ms) {
        return;
    }
    const bool late = soonest_ms != 0u && watch->standing_ms > soonest_ms;
    const uint16_t late_ms = late ? (uint16_t)(watch->standing_ms - soonest_ms) : (uint16_t)0;
    watch->late_ms = late_ms > watch->late_ms ? late_ms : watch->late_ms;
    watch->start_known = true;
}

/* A wheel that has not made a count since the effort came, although it is known to start sooner. */
static bool start_overdue(const struct wheel_watch *watch, const struct tuning *tuning)
{
    const uint32_t late_ms = (uint32_t)watch->late_ms + WHEEL_WATCH_START_SLACK_MS;
    const bool soon =
        watch->start_known && watch->due.ms != 0u && watch->standing_ms >= watch->due.ms + late_ms;
    return !watch->moved && (soon || watch->standing_ms >= tuning->encoder_start_ms);
}

/* One phase alone, from speed: it goes on to and fro where a wheel that is held does not. The tick sees its
 * last count beyond the front now or later, which then looks like a gentle end. */
static bool keeps_turning(struct wheel_watch *watch, int32_t moved, float effort)
{
    const int8_t way = direction((float)moved, 0.0f);
    if (way != 0) {
        watch->turns =
            (uint8_t)(watch->turns + (way != watch->way && watch->turns < WHEEL_WATCH_TURNS ? 1 : 0));
        watch->way = way;
    }
    if (watch->fast == 0 || direction(effort, min_effort) != watch->fast) {
        watch->dither_ms = 0;
        return false;
    }
    count_up(&watch->dither_ms);
    return watch->dither_ms >= WHEEL_WATCH_BROKEN_OFF_MS && watch->turns >= WHEEL_WATCH_TURNS;
}

/* Missing counts. */
static void watch_standing(struct wheel_watch *watch, const struct tuning *tuning, int wheel, int32_t counts,
                           int32_t recent, int32_t before, float effort)
{
    const int32_t last = history_ago(watch, 1);
    const int32_t away = wrapped_difference(counts, watch->place);
    if (away > WHEEL_WATCH_DITHER_COUNTS || away < -WHEEL_WATCH_DITHER_COUNTS) {
        learn_start(watch);
        forget_start(watch);
        watch->place = counts;
        watch->moved = true;
        watch->standing_ms = 0;
        watch->heading = away < 0 ? (int8_t)-1 : (int8_t)1;
        watch->front = wrapped_difference(counts, watch->heading);
        watch->fast = sudden_end(recent, before, 1);
        watch->turns = 0;
        watch->dither_ms = 0;
    }
    /* The last single count shows best how a motion ended; one phase alone stays within its dither. */
    if (watch->heading * within(wrapped_difference(counts, watch->front)) > 0) {
        watch->front = counts;
        watch->broken_ms = 0;
        watch->broken_off = sudden_end(recent, before, 3);
    }
    const bool driven = effort >= tuning->stall_effort || effort <= -tuning->stall_effort;
    if (driven) {
        count_up(&watch->standing_ms);
        if (!watch->moved) {
            expect_start(watch, tuning, wheel, effort);
        }
    } else {
        watch->standing_ms = 0;
        forget_start(watch);
    }
    if (watch->broken_off != 0 && direction(effort, min_effort) == watch->broken_off) {
        count_up(&watch->broken_ms);
    } else {
        watch->broken_ms = 0;
        watch->broken_off = 0;
    }
    if (direction(effort, 0.0f) == 0) {
        watch->moved = false;
    }
    watch->lost = start_overdue(watch, tuning) || watch->broken_ms >= WHEEL_WATCH_BROKEN_OFF_MS ||
                  keeps_turning(watch, wrapped_difference(counts, last), effort);
    watch->stalled =
        watch->creeps || (watch->moved && !watch->lost && watch->standing_ms >= tuning->stall_ms);
}

/* The distance of a span in short steps, whatever its direction: a heavy robot that is reversed rolls on
 * first, and a count that dithers goes nowhere. */
static void add_creep_step(struct wheel_watch *watch, int32_t counts)
{
    const int32_t moved = within(wrapped_difference(counts, watch->creep_from));
    watch->creep_counts += moved < 0 ? -moved : moved;
    watch->creep_from = counts;
}

/* A wheel that makes counts under a large effort, but a twentieth at most of the speed at which back-EMF
 * would balance it: its motor takes nearly the current that it takes when it stands. */
static void watch_creep(struct wheel_watch *watch, const struct tuning *tuning, int wheel, int32_t counts,
                        float effort)
{
    const float large = tuning->stall_effort > large_effort ? tuning->stall_effort : large_effort;
    const int8_t effort_direction = direction(effort, large);
    watch->creeps = false;
    if (effort_direction == 0 || effort_direction != watch->creep_direction || !is_finite(watch->creep_m)) {
        watch->creep_ms = 0;
        watch->creep_direction = effort_direction;
    }
    if (watch->creep_ms == 0u) {
        watch->creep_from = counts;
        watch->creep_counts = 0;
        watch->creep_m = 0.0f;
    }
    if (effort_direction == 0) {
        return;
    }
    watch->creep_ms++;
    watch->creep_m += 0.001f * (float)effort_direction * effort * tuning->creep_mps[wheel];
    if (watch->creep_ms % WHEEL_WATCH_CREEP_STEP_MS == 0u) {
        add_creep_step(watch, counts);
    }
    if (watch->creep_ms >= WHEEL_WATCH_CREEP_MS) {
        watch->creeps = (float)watch->creep_counts * tuning->metres_per_count < watch->creep_m;
        watch->creep_ms = 0;
    }
}

/* The effort has taken a direction: notes the kinetic energy of the motion against it. */
static void begin_push(struct wheel_watch *watch, int8_t effort_direction, float window_mps, float known_mps,
                       float kv)
{
    const float seen = -(float)effort_direction * window_mps;
    const float known = -(float)effort_direction * known_mps;
    const float speed_mps = seen > known ? seen : known;
    watch->effort_direction = effort_direction;
    watch->push_ms = 0;
    watch->work = 0.0f;
    watch->against = 0;
    watch->initial_energy = speed_mps > 0.0f ? 1.5f * speed_mps * speed_mps : 0.0f;
    watch->borne = borne_effort + (speed_mps > 0.0f ? rolling_share * kv * speed_mps : 0.0f);
    watch->from_rest = speed_mps < standing_mps;
    watch->rested = seen < standing_mps && seen > -standing_mps;
    watch->energy = free_speed_mps * free_speed_mps + watch->initial_energy;
}

/* A wheel that started from rest, and on which nothing else acts, cannot turn against the effort by more than
 * its initial energy allows. */
static bool turns_against_push(const struct wheel_watch *watch)
{
    return watch->from_rest && watch->against > WHEEL_WATCH_DITHER_COUNTS &&
           watch->work > watch->initial_energy;
}

/* Whether the other wheel's effort, carried over by the chassis, may turn this one back on a slope. Both
 * wheels stand on one slope, and bear it in the same proportion as the chassis shares their efforts. */
static bool other_may_turn_back(float effort, float other)
{
    const float size = absf(other);
    if (other > 0.0f) {
        return effort + least_friction - (1.0f - chassis_share) * borne_effort < chassis_share * size;
    }
    return effort + least_friction - (1.0f + long_chassis_share) * borne_effort < long_chassis_share * size;
}

/* A motion along a lasting effort that is as fast the other way within milliseconds: a wheel that is pushed
 * back has to stop first, and one that bounces loses half its speed. */
static bool turned_round(const struct wheel_watch *watch, int32_t counts)
{
    const int32_t way = (int32_t)watch->effort_direction;
    const int32_t after = way * within(wrapped_difference(counts, history_ago(watch, WHEEL_WATCH_TURNED_MS)));
    if (after >= 0 || watch->push_ms < WHEEL_WATCH_HISTORY_MS) {
        return false;
    }
    const int32_t then = history_ago(watch, WHEEL_WATCH_TURNED_MS + WHEEL_WATCH_TURNING_MS);
    const int32_t before = way * within(wrapped_difference(then, watch->history[watch->next]));
    return before >= turn_counts &&
           -4 * after * WHEEL_WATCH_UNTURNED_MS >= 3 * before * WHEEL_WATCH_TURNED_MS;
}

/* The first count may have been very close. */
static int32_t surely(int32_t counts)
{
    return counts > 1 ? counts - 1 : 0;
}

/* Counts that run against the effort. v0^2 - v^2 = 2 a s: an effort e takes at least 2 e s / (2 ka) from the
 * square of the speed, half of what the feedforward's ka says of this robot. A motion that turned round under
 * a constant effort had no speed to begin with. */
static void watch_direction(struct wheel_watch *watch, const struct tuning *tuning, int wheel, int32_t moved,
                            int32_t window_counts, const struct wheel_push *push)
{
    const float window_s = 0.001f * (float)WHEEL_WATCH_HISTORY_MS;
    const float speed_mps = (float)window_counts * tuning->metres_per_count / window_s;
    const int8_t effort_direction = direction(push->effort, borne_effort);
    const float along_mps = (float)effort_direction * speed_mps;
    const int32_t along = (int32_t)effort_direction * within(moved);
    if (effort_direction != watch->effort_direction || !wheel_watch_is_finite(watch)) {
        begin_push(watch, effort_direction, speed_mps, push->speed_mps, tuning->watch_kv[wheel]);
    } else if (along_mps > 0.0f && along > 0) {
        watch->work = 0.0f;
        watch->against = 0;
        watch->energy = free_speed_mps * free_speed_mps;
        watch->borne = borne_effort;
        watch->from_rest = false;
    }
    const float surplus = (float)effort_direction * push->effort - watch->borne;
    if (watch->from_rest && other_may_turn_back((float)effort_direction * push->effort,
                                                (float)effort_direction * push->other_effort)) {
        watch->from_rest = false;
    }
    const int32_t before = surely(watch->against);
    watch->against = within(watch->against - along);
    const float back_m = (float)(surely(watch->against) - before) * tuning->metres_per_count;
    watch->work += surplus * back_m / tuning->watch_ka[wheel];
    if (watch->work < 0.0f) {
        watch->work = 0.0f;
    }
    /* Faster than any wheel raises another fault. */
    const bool believed = along_mps > -tuning->encoder_speed_max_mps;
    watch->reversed = effort_direction != 0 && believed &&
                      (watch->work > watch->energy || turns_against_push(watch) ||
                       turned_round(watch, wrapped_sum(watch->history[watch->next], window_counts)));
    count_up(&watch->push_ms);
}

void wheel_watch_step(struct wheel_watch *watch, const struct tuning *tuning, int wheel, int32_t counts,
                      const int16_t effort_e4[HAL_WHEELS], float speed_mps)
{
    const struct wheel_push push = {
        .effort = (float)effort_e4[wheel] * effort_per_e4,
        .other_effort = (float)effort_e4[1 - wheel] * effort_per_e4,
        .speed_mps = speed_mps,
    };
    const int32_t last = history_ago(watch, 1);
    const int32_t oldest = watch->history[watch->next];
    const int32_t between = history_ago(watch, WHEEL_WATCH_RECENT_MS);

    watch_creep(watch, tuning, wheel, counts, push.effort);
    watch_standing(watch, tuning, wheel, counts, wrapped_difference(counts, between),
                   wrapped_difference(between, oldest), push.effort);
    watch_direction(watch, tuning, wheel, wrapped_difference(counts, last),
                    wrapped_difference(counts, oldest), &push);
    watch->history[watch->next] = counts;
    watch->next = (uint8_t)((watch->next + 1u) % WHEEL_WATCH_HISTORY_MS);
}
