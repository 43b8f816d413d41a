/* Where a plant's truth is being written to. */
#ifndef PLANT_RECORDER_H
#define PLANT_RECORDER_H

#include "record.h"

struct recorder {
    struct plant_sample *out;
    size_t capacity, count;
    uint64_t every_steps;
};

/* After a step: writes a sample when one is due. */
void recorder_look(struct plant *plant);

#endif
