/* The truth, written down at even intervals, and efforts played back. */
#ifndef PLANT_RECORD_H
#define PLANT_RECORD_H

#include <stdbool.h>
#include <stddef.h>

#include "plant.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One moment of a robot; pairs are left, right. */
struct plant_sample {
    uint64_t steps;
    double asked[PLANT_WHEELS];        /* effort that the bridge inputs ask for: IN1 less IN2 */
    double measured_rad[PLANT_WHEELS]; /* what the encoder turns by, before it is counted */
    int64_t counts[PLANT_WHEELS];
    double x_m, y_m, theta_rad;
    double battery_v;
};

/* Writes a sample after every so many steps, up to `capacity`, from now on; 0 steps ends it. The memory
   belongs to the caller. False: no memory for the recorder itself. */
bool plant_record(struct plant *plant, struct plant_sample *out, size_t capacity, uint64_t every_steps);

/* Samples written since plant_record. */
size_t plant_recorded(const struct plant *plant);

/* Drives with one pair of efforts after the other (drive and brake, 0 brakes), each for so many steps. */
void plant_replay(struct plant *plant, const double (*efforts)[PLANT_WHEELS], size_t count,
                  uint64_t steps_each);

#ifdef __cplusplus
}
#endif

#endif
