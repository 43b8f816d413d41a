/* One wheel's counts held against its effort: an encoder that is lost or reversed, a wheel that is stalled.
 */
#include "wheel_watch.h"

#include "rounding.h"

static const float effort_per_e4 = 1e-4f;
/* A motion must be this fast, in counts within BEFORE_MS, for its end to be called sudden. */
static const int32_t fast_counts = 8;
/* What a pivot, a slope of 3 degrees or the other wheel can do against a wheel's effort. */
static const float borne_effort = 0.1f;
/* Efforts below this are no drive at all. */
static const float least_effort = 0.05f;
/* The speed that a wheel may reach against its effort before it is called reversed, m/s. */
static const float free_speed_mps = 0.07f;

void wheel_watch_init(struct wheel_watch *watch, int32_t counts)
{
    *watch = (struct wheel_watch){.place = counts};
    for (int i = 0; i < WHEEL_WATCH_HISTORY_MS; i++) {
        watch->history[i] = counts;
    }
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

/* More counts than any encoder makes are another fault's business, and would overflow here. */
static int32_t within(int32_t counts)
{
    const int32_t most = 1000000;
    if (counts > most) {
        return most;
    }
    return counts < -most ? -most : counts;
}

/* At the last counts of a motion: were they as dense as those before? A wheel that is stopped by anything but
 * its encoder slows down first. */
static int8_t sudden_end(int32_t recent, int32_t before)
{
    recent = within(recent);
    before = within(before);
    const int32_t speed = before < 0 ? -before : before;
    const int32_t end = before < 0 ? -recent : recent;
    const bool dense = 5 * end * WHEEL_WATCH_BEFORE_MS >= 3 * speed * WHEEL_WATCH_RECENT_MS;
    if (speed < fast_counts || !dense) {
        return 0;
    }
    return before < 0 ? (int8_t)-1 : (int8_t)1;
}

/* Counts that do not come. */
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
    /* The last single count tells best how a motion ended; one phase alone gets no further than its dither.
     */
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
    if (watch->broken_off != 0 && direction(effort, least_effort) == watch->broken_off) {
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
    watch->stalled = watch->moved && !watch->lost && watch->standing_ms >= tuning->stall_ms;
}

/* Counts that run against the effort. v0^2 - v^2 = 2 a s: an effort e takes at least 2 e s / (2 ka) from the
 * square of the speed, half of what the feedforward's ka says of this robot. A motion that turned round under
 * a constant effort had no speed to begin with. */
static void watch_direction(struct wheel_watch *watch, const struct tuning *tuning, int wheel, float moved_m,
                            float speed_mps, float effort)
{
    const float allowance = free_speed_mps * free_speed_mps;
    const int8_t pushed = direction(effort, borne_effort);
    const float along_mps = (float)pushed * speed_mps;
    const float along_m = (float)pushed * moved_m;
    if (pushed != watch->pushed) {
        watch->pushed = pushed;
        watch->work = 0.0f;
        watch->energy = allowance;
        if (along_mps < 0.0f) {
            watch->energy += 1.5f * speed_mps * speed_mps;
        }
    } else if (along_mps > 0.0f && along_m > 0.0f) {
        watch->work = 0.0f;
        watch->energy = allowance;
    }
    const float surplus = (float)pushed * effort - borne_effort;
    watch->work -= surplus * along_m / tuning->watch_ka[wheel];
    if (watch->work < 0.0f) {
        watch->work = 0.0f;
    }
    /* Faster than any wheel is another fault's business. */
    const bool believed = along_mps > -tuning->encoder_speed_max_mps;
    watch->reversed = pushed != 0 && believed && watch->work > watch->energy;
}

void wheel_watch_step(struct wheel_watch *watch, const struct tuning *tuning, int wheel, int32_t counts,
                      int16_t effort_e4)
{
    const float effort = (float)effort_e4 * effort_per_e4;
    const int32_t last = history_ago(watch, 1);
    const int32_t oldest = watch->history[watch->next];
    const int32_t between = history_ago(watch, WHEEL_WATCH_RECENT_MS);
    const float window_s = 0.001f * (float)WHEEL_WATCH_HISTORY_MS;
    const float speed_mps = (float)wrapped_difference(counts, oldest) * tuning->metres_per_count / window_s;
    const float moved_m = (float)wrapped_difference(counts, last) * tuning->metres_per_count;

    watch_standing(watch, tuning, counts, wrapped_difference(counts, between),
                   wrapped_difference(between, oldest), effort);
    watch_direction(watch, tuning, wheel, moved_m, speed_mps, effort);
    watch->history[watch->next] = counts;
    watch->next = (uint8_t)((watch->next + 1u) % WHEEL_WATCH_HISTORY_MS);
}
