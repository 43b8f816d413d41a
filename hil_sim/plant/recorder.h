/* The true state of a plant, recorded at even intervals. */
#ifndef PLANT_RECORDER_H
#define PLANT_RECORDER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "plant_params.h"

#ifdef __cplusplus
extern "C" {
#endif

struct plant;

/* One sample; pairs are left, right. */
struct plant_sample {
    uint64_t steps;
    double asked[PLANT_WHEELS];        /* commanded effort of the bridge inputs: IN1 less IN2 */
    double measured_rad[PLANT_WHEELS]; /* angle of the encoder before quantisation */
    int64_t counts[PLANT_WHEELS];
    double x_m, y_m, theta_rad;
    double battery_v;
};

/* Writes a sample after every so many steps, up to `capacity`, from now on; 0 steps ends it. The memory
   belongs to the caller. False: no memory for the recorder itself. */
bool plant_record(struct plant *plant, struct plant_sample *out, size_t capacity, uint64_t every_steps);

/* Samples written since plant_record. */
size_t plant_recorded(const struct plant *plant);

/* After a step, by plant_advance: writes a sample when one is due. */
void recorder_step(struct plant *plant);

#ifdef __cplusplus
}
#endif

#endif
