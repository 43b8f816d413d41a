/* A wheel's speed and stillness from its encoder counts, one sample a millisecond. */
#ifndef WHEEL_SPEED_H
#define WHEEL_SPEED_H

#include <stdbool.h>
#include <stdint.h>

enum {
    /* Ticks that a speed is averaged over. At 6000 counts/m one count is 10 mm/s in 16 ms; a longer window
     * would delay the velocity loop by more than the 8 ms that its default gains bear with ease. */
    WHEEL_SPEED_WINDOW_MS = 16,
    /* Still means: within WHEEL_SPEED_STILL_COUNTS of one place for this long. One edge may dither. */
    WHEEL_SPEED_STILL_MS = 100,
    WHEEL_SPEED_STILL_COUNTS = 2,
};

struct wheel_speed {
    int32_t history[WHEEL_SPEED_WINDOW_MS]; /* counts of the last ticks, oldest at `next` */
    uint8_t next;
    int32_t window_counts;   /* counts over the window that ends now */
    int32_t still_reference; /* the place that the wheel has kept to */
    uint16_t still_ms;       /* how long, up to WHEEL_SPEED_STILL_MS */
};

/* A wheel that has always stood at `counts`. */
void wheel_speed_init(struct wheel_speed *wheel, int32_t counts);

void wheel_speed_step(struct wheel_speed *wheel, int32_t counts);

/* Mean over the window, m/s. */
float wheel_speed_mps(const struct wheel_speed *wheel, float metres_per_count);

bool wheel_speed_is_still(const struct wheel_speed *wheel);

#endif
