/* A wheel's speed and stillness from its encoder counts, one sample a millisecond. */
#include "wheel_speed.h"

#include "rounding.h"

void wheel_speed_init(struct wheel_speed *wheel, int32_t counts)
{
    for (int i = 0; i < WHEEL_SPEED_WINDOW_MS; i++) {
        wheel->history[i] = counts;
    }
    wheel->next = 0;
    wheel->window_counts = 0;
    wheel->still_reference = counts;
    wheel->still_ms = WHEEL_SPEED_STILL_MS;
}

void wheel_speed_step(struct wheel_speed *wheel, int32_t counts)
{
    wheel->window_counts = wrapped_difference(counts, wheel->history[wheel->next]);
    wheel->history[wheel->next] = counts;
    wheel->next = (uint8_t)((wheel->next + 1u) % WHEEL_SPEED_WINDOW_MS);

    const int32_t moved = wrapped_difference(counts, wheel->still_reference);
    if (moved > WHEEL_SPEED_STILL_COUNTS || moved < -WHEEL_SPEED_STILL_COUNTS) {
        wheel->still_reference = counts;
        wheel->still_ms = 0;
    } else if (wheel->still_ms < WHEEL_SPEED_STILL_MS) {
        wheel->still_ms++;
    }
}

float wheel_speed_mps(const struct wheel_speed *wheel, float metres_per_count)
{
    return (float)wheel->window_counts * (metres_per_count * (1000.0f / (float)WHEEL_SPEED_WINDOW_MS));
}

bool wheel_speed_is_still(const struct wheel_speed *wheel)
{
    return wheel->still_ms >= WHEEL_SPEED_STILL_MS;
}
