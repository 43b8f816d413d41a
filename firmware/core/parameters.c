/* The parameters' values, checked against the table of the schema. */
#include "parameters.h"

#include "rounding.h"

void parameters_set_defaults(struct parameters *parameters)
{
    for (uint32_t i = 0; i < PROTO_PARAMETER_COUNT; i++) {
        parameters->values[i] = proto_parameters[i].default_value;
    }
}

enum parameters_result parameters_set(struct parameters *parameters, uint16_t index, float value)
{
    if (index >= PROTO_PARAMETER_COUNT) {
        return PARAMETERS_UNKNOWN;
    }
    if (!is_finite(value)) {
        return PARAMETERS_NOT_FINITE;
    }
    const struct proto_parameter_info *const info = &proto_parameters[index];
    if (value < info->minimum || value > info->maximum) {
        return PARAMETERS_OUT_OF_RANGE;
    }
    /* Ranges of whole-number parameters lie inside int32, so the cast is defined. */
    if (info->kind != PROTO_PARAMETER_KIND_REAL && (float)(int32_t)value != value) {
        return PARAMETERS_OUT_OF_RANGE;
    }
    parameters->values[index] = value;
    return PARAMETERS_OK;
}
