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
    return is_finite(watch->borne + watch->work + watch->energy + watch->initial_energy + watch->creep_m);
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

/* Whether the last counts of a motion were as dense as those before: a wheel slows down before it stops, a
 * failing encoder stops counting at once. */
static int8_t sudden_end(int32_t recent, int32_t before)
{
    recent = within(recent);
    before = within(before);
    const int32_t speed = before < 0 ? -before : before;
    const int32_t end = before < 0 ? -recent : recent;
    const bool dense = 4 * end * WHEEL_WATCH_BEFORE_MS >= 3 * speed * WHEEL_WATCH_RECENT_MS;
    if (speed < fast_counts || !dense) {
        return 0;
    }
    return before < 0 ? (int8_t)-1 : (int8_t)1;
}

/* Missing counts. */
static void watch_standing(struct wheel_watch *watch, const struct tuning *tuning, int32_t counts,
                           int32_t recent, int32_t before, float effort)
{
    const int32_t away = wrapped_difference(counts, watch->place);
    if (away > WHEEL_WATCH_DITHER_COUNTS || away < -WHEEL_WATCH_DITHER_COUNTS) {
        watch->place = counts;
        watch->moved = true;
        watch->standing_ms = 0;
        watch->heading = away < 0 ? (int8_t)-1 : (int8_t)1;
        watch->front = wrapped_difference(counts, watch->heading);
    }
    /* The last single count shows best how a motion ended; one phase alone stays within its dither. */
    if (watch->heading * within(wrapped_difference(counts, watch->front)) > 0) {
        watch->front = counts;
        watch->broken_ms = 0;
        watch->broken_off = sudden_end(recent, before);
    }
    const bool driven = effort >= tuning->stall_effort || effort <= -tuning->stall_effort;
    if (driven) {
        count_up(&watch->standing_ms);
    } else {
        watch->standing_ms = 0;
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
    const bool never_started = !watch->moved && watch->standing_ms >= tuning->encoder_start_ms;
    watch->lost = never_started || watch->broken_ms >= WHEEL_WATCH_BROKEN_OFF_MS;
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
    watch->work = 0.0f;
    watch->against = 0;
    watch->initial_energy = speed_mps > 0.0f ? 1.5f * speed_mps * speed_mps : 0.0f;
    watch->borne = borne_effort + (speed_mps > 0.0f ? rolling_share * kv * speed_mps : 0.0f);
    watch->from_rest = speed_mps < standing_mps;
    watch->energy = free_speed_mps * free_speed_mps + watch->initial_energy;
}

/* A wheel that started from rest, and on which nothing else acts, cannot turn against the effort by more than
 * its initial energy allows. */
static bool turns_against_push(const struct wheel_watch *watch)
{
    return watch->from_rest && watch->against > WHEEL_WATCH_DITHER_COUNTS &&
           watch->work > watch->initial_energy;
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
    const float other = push->other_effort < 0.0f ? -push->other_effort : push->other_effort;
    if (surplus < chassis_share * other) {
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
    watch->reversed =
        effort_direction != 0 && believed && (watch->work > watch->energy || turns_against_push(watch));
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
    watch_standing(watch, tuning, counts, wrapped_difference(counts, between),
                   wrapped_difference(between, oldest), push.effort);
    watch_direction(watch, tuning, wheel, wrapped_difference(counts, last),
                    wrapped_difference(counts, oldest), &push);
    watch->history[watch->next] = counts;
    watch->next = (uint8_t)((watch->next + 1u) % WHEEL_WATCH_HISTORY_MS);
}
