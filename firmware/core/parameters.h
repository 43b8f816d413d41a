/* The parameters' values, checked against the table of the schema. */
#ifndef PARAMETERS_H
#define PARAMETERS_H

#include <stdint.h>

#include "proto.h"

struct parameters {
    float values[PROTO_PARAMETER_COUNT];
};

/* Why a value was not taken. */
enum parameters_result {
    PARAMETERS_OK = 0,
    PARAMETERS_UNKNOWN,
    PARAMETERS_NOT_FINITE,
    PARAMETERS_OUT_OF_RANGE,
};

void parameters_set_defaults(struct parameters *parameters);

/* Whether the table's entry allows a value: finite, within range, whole where the kind is integer or flag. */
enum parameters_result parameters_check(const struct proto_parameter_info *info, float value);

/* Takes a value that the table allows. */
enum parameters_result parameters_set(struct parameters *parameters, uint16_t index, float value);

#endif
