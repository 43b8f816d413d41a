/* The true state of a plant, recorded at even intervals. */
#include "recorder.h"

#include <stdlib.h>

#include "extended_robot.h"
#include "plant_internal.h"
#include "readings.h"

struct recorder {
    struct plant_sample *out;
    size_t capacity, count;
    uint64_t every_steps;
};

bool plant_record(struct plant *plant, struct plant_sample *out, size_t capacity, uint64_t every_steps)
{
    free(plant->recorder);
    plant->recorder = NULL;
    if (every_steps == 0 || capacity == 0) {
        return true;
    }
    plant->recorder = calloc(1, sizeof *plant->recorder);
    if (plant->recorder == NULL) {
        return false;
    }
    *plant->recorder = (struct recorder){.out = out, .capacity = capacity, .every_steps = every_steps};
    return true;
}

size_t plant_recorded(const struct plant *plant)
{
    return plant->recorder == NULL ? 0 : plant->recorder->count;
}

void recorder_step(struct plant *plant)
{
    struct recorder *recorder = plant->recorder;
    if (plant->steps % recorder->every_steps != 0 || recorder->count == recorder->capacity) {
        return;
    }
    struct plant_sample *sample = &recorder->out[recorder->count++];
    *sample = (struct plant_sample){
        .steps = plant->steps,
        .x_m = plant->chassis.x_m,
        .y_m = plant->chassis.y_m,
        .theta_rad = plant->chassis.theta_rad,
        .battery_v = plant_battery_v(plant),
    };
    for (int i = 0; i < PLANT_WHEELS; i++) {
        sample->asked[i] = plant->asked_duty[i][0] - plant->asked_duty[i][1];
        sample->counts[i] = plant_encoder_position(plant, i);
        sample->measured_rad[i] =
            plant->extended != NULL ? extended_measured_rad(plant, i) : plant->angle_rad[i];
    }
}
