/* A wheel's speed and stillness from its encoder: counts, and the times of their edges. */
#include "wheel_speed.h"

#include "rounding.h"

static const float us_per_s = 1.0e6f;

enum {
    TICK_US = 1000,
    WINDOW_US = 1000 * WHEEL_SPEED_WINDOW_MS,
    PATIENCE_US = 1000 * WHEEL_SPEED_PATIENCE_MS,
    FORGET_US = 60000000, /* a minute without an edge; long before the clock wraps */
};

void wheel_speed_init(struct wheel_speed *wheel, int32_t counts)
{
    *wheel = (struct wheel_speed){
        .counts = counts,
        .still_reference = counts,
        .still_ms = WHEEL_SPEED_STILL_MS,
        .since_us = FORGET_US,
        .edges = {{.place = counts}},
        .ahead = 1,
        .offset = 0.5f, /* half-way to the next edge, as long as no edge is known */
    };
    for (int i = 0; i < WHEEL_SPEED_WINDOW_MS; i++) {
        wheel->history[i] = counts;
    }
}

static int32_t magnitude(int32_t value)
{
    return value < 0 ? -value : value;
}

/* The edge passed `back` edges before the newest. */
static const struct wheel_edge *edge_before(const struct wheel_speed *wheel, uint32_t back)
{
    return &wheel->edges[(wheel->newest + WHEEL_SPEED_EDGES - back) % WHEEL_SPEED_EDGES];
}

static int32_t counts_since(const struct wheel_speed *wheel, const struct wheel_edge *edge)
{
    return magnitude(wrapped_difference(wheel->edges[wheel->newest].place, edge->place));
}

static uint32_t span_us(const struct wheel_speed *wheel, uint32_t back)
{
    return wheel->edges[wheel->newest].us - edge_before(wheel, back)->us;
}

static bool is_enough(const struct wheel_speed *wheel, uint32_t back)
{
    return span_us(wheel, back) >= WINDOW_US &&
           counts_since(wheel, edge_before(wheel, back)) >= WHEEL_SPEED_PERIOD_COUNTS;
}

/* How many edges back to measure from: to the newest that lies a window and a quadrature period back, and
 * from there to the first of the same phase, if there is one. A period that takes too long is cut short. The
 * search begins at the answer for the edge before, which is never far away. */
static uint32_t reference(struct wheel_speed *wheel)
{
    const uint32_t oldest = wheel->edge_count - 1u;
    uint32_t back = wheel->back + 1u < oldest ? wheel->back + 1u : oldest;
    while (back > 1 && (span_us(wheel, back) > PATIENCE_US || is_enough(wheel, back - 1u))) {
        back--;
    }
    wheel->back = (uint8_t)back;
    for (uint32_t beyond = 0; beyond < WHEEL_SPEED_PERIOD_COUNTS && back + beyond <= oldest; beyond++) {
        const int32_t counts = counts_since(wheel, edge_before(wheel, back + beyond));
        if (counts % WHEEL_SPEED_PERIOD_COUNTS == 0 && span_us(wheel, back + beyond) <= PATIENCE_US) {
            return back + beyond;
        }
    }
    return back;
}

static void forget(struct wheel_speed *wheel)
{
    wheel->direction = 0;
    wheel->edge_count = 0;
    wheel->back = 0;
    wheel->known = false;
    wheel->counts_per_us = 0.0f;
    wheel->since_us = FORGET_US;
}

static void pass_edge(struct wheel_speed *wheel, struct wheel_edge edge, int8_t direction)
{
    if (direction != wheel->direction) { /* knowledge of the other direction does not apply to this one */
        forget(wheel);
        wheel->direction = direction;
    }
    wheel->newest = (uint8_t)((wheel->newest + 1u) % WHEEL_SPEED_EDGES);
    wheel->edges[wheel->newest] = edge;
    if (wheel->edge_count < WHEEL_SPEED_EDGES) {
        wheel->edge_count++;
    }
    if (wheel->edge_count > 1) {
        const uint32_t back = reference(wheel);
        const uint32_t span = span_us(wheel, back);
        if (span > 0) {
            wheel->span_us = span;
            wheel->counts_per_us = (float)counts_since(wheel, edge_before(wheel, back)) / (float)span;
            wheel->known = true;
        }
    }
}

/* An edge without a time stamp is assumed to be the last of this tick, half an edge interval ago. */
static struct wheel_edge edge_of(const struct wheel_motion *motion, int32_t moved)
{
    const int32_t since = wrapped_difference(motion->counts, motion->edge_from);
    if (motion->edge_dated && since != 0 && (since > 0) == (moved > 0)) {
        return (struct wheel_edge){.place = moved > 0 ? wrapped_sum(motion->edge_from, 1) : motion->edge_from,
                                   .us = motion->edge_us};
    }
    const uint32_t uncertainty_us = TICK_US / 2u / (uint32_t)magnitude(moved);
    return (struct wheel_edge){.place = moved > 0 ? motion->counts : wrapped_sum(motion->counts, 1),
                               .us = motion->now_us - uncertainty_us,
                               .uncertainty_us = uncertainty_us};
}

/* Beyond its newest edge the wheel is extrapolated at its speed, up to the next edge at most. */
static float beyond_edge(const struct wheel_speed *wheel)
{
    const float reach = (float)wheel->since_us * wheel->counts_per_us;
    const float beyond = clampf(reach, (float)(wheel->ahead - 1), (float)wheel->ahead);
    return wheel->direction > 0 ? beyond : -beyond;
}

static void follow_edges(struct wheel_speed *wheel, const struct wheel_motion *motion)
{
    const int32_t before = wheel->counts;
    const int32_t moved = wrapped_difference(motion->counts, before);
    const int32_t place = wheel->edges[wheel->newest].place;
    const float offset = wheel->offset;
    wheel->counts = motion->counts;
    wheel->moved = 0.0f;
    if (moved != 0) {
        pass_edge(wheel, edge_of(motion, moved), moved > 0 ? 1 : -1);
    }
    if (wheel->direction == 0) {
        return;
    }
    const struct wheel_edge newest = wheel->edges[wheel->newest];
    wheel->since_us = motion->now_us - newest.us;
    wheel->ahead = wheel->direction > 0 ? wrapped_difference(wheel->counts, newest.place) + 1
                                        : wrapped_difference(newest.place, wheel->counts);
    wheel->offset = beyond_edge(wheel);
    wheel->moved = (float)wrapped_difference(newest.place, place) + wheel->offset - offset;
    if (wheel->since_us >= FORGET_US) {
        forget(wheel);
    }
}

void wheel_speed_step(struct wheel_speed *wheel, const struct wheel_motion *motion)
{
    const int32_t counts = motion->counts;
    wheel->window_counts = wrapped_difference(counts, wheel->history[wheel->next]);
    wheel->history[wheel->next] = counts;
    wheel->next = (uint8_t)((wheel->next + 1u) % WHEEL_SPEED_WINDOW_MS);
    follow_edges(wheel, motion);

    const int32_t moved = wrapped_difference(counts, wheel->still_reference);
    if (moved > WHEEL_SPEED_STILL_COUNTS || moved < -WHEEL_SPEED_STILL_COUNTS) {
        wheel->still_reference = counts;
        wheel->still_ms = 0;
    } else if (wheel->still_ms < WHEEL_SPEED_STILL_MS) {
        wheel->still_ms++;
    }
}

float wheel_speed_window_mps(const struct wheel_speed *wheel, float metres_per_count)
{
    return (float)wheel->window_counts * (metres_per_count * (1000.0f / (float)WHEEL_SPEED_WINDOW_MS));
}

struct wheel_measure wheel_speed_from_counts(const struct wheel_speed *wheel, float metres_per_count)
{
    const float mps = wheel_speed_window_mps(wheel, metres_per_count);
    return (struct wheel_measure){
        .mps = mps,
        .span_s = 0.001f * (float)WHEEL_SPEED_WINDOW_MS,
        .age_s = 0.0005f * (float)WHEEL_SPEED_WINDOW_MS,
        .moved_m = 0.001f * mps,
    };
}

struct wheel_measure wheel_speed_from_edges(const struct wheel_speed *wheel, float metres_per_count)
{
    const float since_us = (float)wheel->since_us;
    const float silent_us = (float)(wheel->since_us - wheel->edges[wheel->newest].uncertainty_us);
    const float scale = (wheel->direction > 0 ? us_per_s : -us_per_s) * metres_per_count;
    const float ahead = (float)wheel->ahead;
    struct wheel_measure measure = {.moved_m = wheel->moved * metres_per_count};
    if (wheel->known && silent_us * wheel->counts_per_us <= ahead) {
        measure.mps = scale * wheel->counts_per_us;
        measure.span_s = (float)wheel->span_us / us_per_s;
        measure.age_s = (0.5f * (float)wheel->span_us + since_us) / us_per_s;
    } else { /* at most `ahead` counts since the newest edge */
        measure.mps = wheel->known ? scale * ahead / silent_us : 0.0f;
        measure.span_s = since_us / us_per_s;
        measure.age_s = 0.5f * measure.span_s;
    }
    return measure;
}

bool wheel_speed_is_still(const struct wheel_speed *wheel)
{
    return wheel->still_ms >= WHEEL_SPEED_STILL_MS;
}
