/* A wheel's speed and stillness from its encoder: counts, and the times of their edges.
 *
 * Speed is the counts between two edges over the time between them, so that a slow wheel is measured as
 * accurately as a fast one, only less often. Until the next edge, the speed is bounded by one count in the
 * time since the last edge. So the speed of a stopping wheel decays, with no time-out that jumps to zero. */
#ifndef WHEEL_SPEED_H
#define WHEEL_SPEED_H

#include <stdbool.h>
#include <stdint.h>

enum {
    /* Shortest span that a speed is worked out over. Edges of a disc are misplaced: by 0.15 count in 16 ms of
     * 2 counts is 10 %. A longer span would delay the velocity loop by more than the 8 ms for which its
     * default gains have a comfortable phase margin. It is also the window of plain counts: at 6000 counts/m
     * one count in 16 ms is 10 mm/s. */
    WHEEL_SPEED_WINDOW_MS = 16,
    /* Unequal phases of a disc cancel over a whole quadrature period, so a speed takes that many counts... */
    WHEEL_SPEED_PERIOD_COUNTS = 4,
    /* ...unless it would be older than this. */
    WHEEL_SPEED_PATIENCE_MS = 100,
    WHEEL_SPEED_EDGES = 32, /* kept; with an edge in each tick twice the window */
    /* Still: within WHEEL_SPEED_STILL_COUNTS of one position for this long. One edge may dither. */
    WHEEL_SPEED_STILL_MS = 100,
    WHEEL_SPEED_STILL_COUNTS = 2,
};

/* Encoder readings of one tick. */
struct wheel_motion {
    int32_t counts;
    uint32_t now_us;
    bool edge_dated; /* one edge since the tick before: when it came, and the count that it left */
    uint32_t edge_us;
    int32_t edge_from;
};

/* An edge's position: edge n lies between the counts n - 1 and n, from whichever side it is passed. */
struct wheel_edge {
    int32_t place;
    uint32_t us;
    uint32_t uncertainty_us; /* it may have come this much later */
};

/* The present speed estimate. */
struct wheel_measure {
    float mps;
    float span_s;  /* averaging time, or time without an edge */
    float age_s;   /* of the middle of that time */
    float moved_m; /* travel since the tick before; its sum is exact at every edge */
};

struct wheel_speed {
    int32_t history[WHEEL_SPEED_WINDOW_MS]; /* counts of the last ticks, oldest at `next` */
    uint8_t next;
    int32_t counts;
    int32_t window_counts; /* counts over the window that ends now */

    struct wheel_edge edges[WHEEL_SPEED_EDGES]; /* all passed in one direction, newest at `newest` */
    uint8_t newest;
    uint8_t edge_count;
    uint8_t back;     /* edges between the newest and the one that is measured from */
    int8_t direction; /* 0 when no edge is known */
    bool known;       /* two edges have been passed in this direction */
    float counts_per_us;
    uint32_t span_us;
    uint32_t since_us; /* since the newest edge */
    int32_t ahead;     /* counts from the newest edge to the next one, which has not been passed */
    float offset;      /* estimated position beyond the newest edge, counts */
    float moved;       /* change of the estimated position since the tick before, counts */

    int32_t still_reference; /* position that the wheel has stayed near */
    uint16_t still_ms;       /* how long, up to WHEEL_SPEED_STILL_MS */
};

/* A wheel that has always stood at `counts`. */
void wheel_speed_init(struct wheel_speed *wheel, int32_t counts);

void wheel_speed_step(struct wheel_speed *wheel, const struct wheel_motion *motion);

/* Counts over the window, m/s. */
float wheel_speed_window_mps(const struct wheel_speed *wheel, float metres_per_count);

/* Plain counts over the window. */
struct wheel_measure wheel_speed_from_counts(const struct wheel_speed *wheel, float metres_per_count);

/* Counts over the time between edges, bounded by the time since the last. */
struct wheel_measure wheel_speed_from_edges(const struct wheel_speed *wheel, float metres_per_count);

bool wheel_speed_is_still(const struct wheel_speed *wheel);

#endif
