/* What FMI 2.0 asks of every co-simulation slave and this one has no use for: it has real variables only. */
#include "fmi2.h"

const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

const char *fmi2GetVersion(void)
{
    return "2.0";
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    (void)c;
    (void)on;
    (void)count;
    (void)categories;
    return fmi2OK; /* errors are logged, always; there is nothing else */
}

/* An empty list of variables of another type is no error. */
#define NO_VARIABLES(name, type, constness)                                                                  \
    fmi2Status name(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, constness type value[])      \
    {                                                                                                        \
        (void)c;                                                                                             \
        (void)vr;                                                                                            \
        (void)value;                                                                                         \
        return nvr == 0 ? fmi2OK : fmi2Error;                                                                \
    }

#define MUTABLE
NO_VARIABLES(fmi2GetInteger, fmi2Integer, MUTABLE)
NO_VARIABLES(fmi2GetBoolean, fmi2Boolean, MUTABLE)
NO_VARIABLES(fmi2GetString, fmi2String, MUTABLE)
NO_VARIABLES(fmi2SetInteger, fmi2Integer, const)
NO_VARIABLES(fmi2SetBoolean, fmi2Boolean, const)
NO_VARIABLES(fmi2SetString, fmi2String, const)

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t unknowns,
                                        const fmi2ValueReference known[], size_t knowns, const fmi2Real in[],
                                        fmi2Real out[])
{
    (void)c;
    (void)unknown;
    (void)unknowns;
    (void)known;
    (void)knowns;
    (void)in;
    (void)out;
    return fmi2Error;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    (void)c;
    (void)vr;
    (void)nvr;
    (void)order;
    (void)value;
    return fmi2Error; /* canInterpolateInputs is false: inputs are held */
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    (void)c;
    (void)vr;
    (void)nvr;
    (void)order;
    (void)value;
    return fmi2Error; /* maxOutputDerivativeOrder is 0 */
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    (void)c;
    return fmi2Error; /* steps are never asynchronous */
}

#define NO_STATUS(name, type)                                                                                \
    fmi2Status name(fmi2Component c, fmi2StatusKind kind, type *value)                                       \
    {                                                                                                        \
        (void)c;                                                                                             \
        (void)kind;                                                                                          \
        (void)value;                                                                                         \
        return fmi2Discard;                                                                                  \
    }

NO_STATUS(fmi2GetStatus, fmi2Status)
NO_STATUS(fmi2GetRealStatus, fmi2Real)
NO_STATUS(fmi2GetIntegerStatus, fmi2Integer)
NO_STATUS(fmi2GetBooleanStatus, fmi2Boolean)
NO_STATUS(fmi2GetStringStatus, fmi2String)
