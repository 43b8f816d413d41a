/* What a record's speeds and pose must be, worked out from its counts in integers, so that the host finds the
 * same to the last bit. */
#ifndef LOG_REPLAY_H
#define LOG_REPLAY_H

#include <stdbool.h>
#include <stdint.h>

/* What counts mean. The two numbers travel in each block's header; both are positive, normal and not huge. */
struct log_geometry {
    float metres_per_count;
    float turns_per_count; /* heading per count of one wheel */
};

struct log_replay {
    uint32_t mantissa; /* metres_per_count = mantissa * 2^exponent */
    int32_t exponent;
    int64_t turn_q40;   /* heading per count, 2^-40 turn */
    int64_t max_counts; /* beyond this difference of the wheels no heading is worked out */
};

void log_replay_start(struct log_replay *replay, const struct log_geometry *geometry);

/* Mean speed in mm/s of a wheel that turned so far in so long, half away from zero, saturating; 0 for an
 * interval that is none. */
int16_t log_replay_speed(const struct log_replay *replay, int32_t counts, uint32_t interval_ms);

/* Heading, 2^-40 turn, when the right wheel has turned so much farther than the left. */
int64_t log_replay_heading(const struct log_replay *replay, int32_t difference);

/* The same in 1e-4 rad. */
int32_t log_replay_heading_e4(int64_t turns_q40);

/* Displacement of the body, 2^-32 m along x and y, for the sum of both wheels' counts at a heading (2^-32
 * turn). */
void log_replay_way(const struct log_replay *replay, int64_t counts, uint32_t phase, int64_t way_q32[2]);

/* Position along one axis, known to whole millimetres. All zero at the start of a block. */
struct log_axis {
    int64_t at_q32; /* m */
};

void log_axis_step(struct log_axis *axis, int64_t way_q32);
int32_t log_axis_mm(const struct log_axis *axis);

/* How far from the edge of its millimetre, 1 to 4. */
uint32_t log_axis_context(const struct log_axis *axis);

/* The record differs: moves to the nearest position that rounds to its value. */
void log_axis_correct(struct log_axis *axis, int32_t mm, int32_t residual);

#endif
