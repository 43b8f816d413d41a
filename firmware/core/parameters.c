/* The parameters' values, checked against the table of the schema. */
#include "parameters.h"

#include "rounding.h"

void parameters_set_defaults(struct parameters *parameters)
{
    for (uint32_t i = 0; i < PROTO_PARAMETER_COUNT; i++) {
        parameters->values[i] = proto_parameters[i].default_value;
    }
}

enum parameters_result parameters_check(const struct proto_parameter_info *info, float value)
{
    if (!is_finite(value)) {
        return PARAMETERS_NOT_FINITE;
    }
    if (value < info->minimum || value > info->maximum) {
        return PARAMETERS_OUT_OF_RANGE;
    }
    /* Ranges of whole-number parameters lie inside int32, so the cast is defined. */
    if (info->kind != PROTO_PARAMETER_KIND_REAL && (float)(int32_t)value != value) {
        return PARAMETERS_OUT_OF_RANGE;
    }
    return PARAMETERS_OK;
}

enum parameters_result parameters_set(struct parameters *parameters, uint16_t index, float value)
{
    if (index >= PROTO_PARAMETER_COUNT) {
        return PARAMETERS_UNKNOWN;
    }
    const enum parameters_result result = parameters_check(&proto_parameters[index], value);
    if (result == PARAMETERS_OK) {
        parameters->values[index] = value;
    }
    return result;
}
