/* Two wheels as an FMI 2.0 co-simulation slave: efforts in, speeds, travel and pose out. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "correction.h"
#include "fmi2.h"
#include "model_numbers.h"
#include "wheel.h"

/* Value references; modelDescription.xml names them. */
enum {
    REF_EFFORT = 1, /* + wheel */
    REF_SPEED = 3,
    REF_TRAVEL = 5,
    REF_X = 7,
    REF_Y = 8,
    REF_THETA = 9,
    REF_WHEELBASE = 10,
    REF_PARAMETERS = 20, /* + 20 * wheel + parameter */
    REF_PER_WHEEL = 20,
};

enum { WHEELS = 2 };

struct state {
    struct wheel wheel[WHEELS];
    struct correction correction;
    double speed_mps[WHEELS], travel_m[WHEELS]; /* with the correction */
    double wheelbase_m;
    double time_s;
    double x_m, y_m, theta_rad;
    bool initialised;
};

struct instance {
    struct state state;
    fmi2CallbackFunctions callbacks;
    char name[128];
};

static fmi2Status fail(const struct instance *slave, const char *message)
{
    if (slave != NULL && slave->callbacks.logger != NULL) {
        slave->callbacks.logger(slave->callbacks.componentEnvironment, slave->name, fmi2Error,
                                "logStatusError", "%s", message);
    }
    return fmi2Error;
}

static void reset(struct state *state)
{
    static const double numbers[WHEELS][PARAMETERS] = MODEL_NUMBERS;
    memset(state, 0, sizeof *state);
    for (int side = 0; side < WHEELS; side++) {
        memcpy(state->wheel[side].parameter, numbers[side], sizeof numbers[side]);
    }
    state->wheelbase_m = MODEL_WHEELBASE_M;
}

/* ---- variables by value reference */

static double *variable(struct state *state, fmi2ValueReference reference)
{
    switch (reference) {
    case REF_EFFORT:
    case REF_EFFORT + 1:
        return &state->wheel[reference - REF_EFFORT].input;
    case REF_SPEED:
    case REF_SPEED + 1:
        return &state->speed_mps[reference - REF_SPEED];
    case REF_TRAVEL:
    case REF_TRAVEL + 1:
        return &state->travel_m[reference - REF_TRAVEL];
    case REF_X:
        return &state->x_m;
    case REF_Y:
        return &state->y_m;
    case REF_THETA:
        return &state->theta_rad;
    case REF_WHEELBASE:
        return &state->wheelbase_m;
    default:
        break;
    }
    if (reference < REF_PARAMETERS || reference >= REF_PARAMETERS + WHEELS * REF_PER_WHEEL) {
        return NULL;
    }
    const unsigned side = (reference - REF_PARAMETERS) / REF_PER_WHEEL;
    const unsigned index = (reference - REF_PARAMETERS) % REF_PER_WHEEL;
    return index < PARAMETERS ? &state->wheel[side].parameter[index] : NULL;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    struct instance *slave = c;
    for (size_t k = 0; k < nvr; k++) {
        const double *source = variable(&slave->state, vr[k]);
        if (source == NULL) {
            return fail(slave, "no variable has this value reference");
        }
        value[k] = *source;
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    struct instance *slave = c;
    for (size_t k = 0; k < nvr; k++) {
        double *target = variable(&slave->state, vr[k]);
        const bool input = vr[k] == REF_EFFORT || vr[k] == REF_EFFORT + 1;
        const bool output = vr[k] >= REF_SPEED && vr[k] <= REF_THETA;
        if (target == NULL || output) {
            return fail(slave, "no input or parameter has this value reference");
        }
        if (!input && slave->state.initialised) {
            return fail(slave, "parameters are fixed once initialisation has ended");
        }
        if (!isfinite(value[k])) {
            return fail(slave, "an input or parameter is not finite");
        }
        *target = value[k];
    }
    return fmi2OK;
}

/* ---- life of an instance */

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                              fmi2Boolean logging)
{
    (void)resources;
    (void)visible;
    (void)logging;
    if (callbacks == NULL || type != fmi2CoSimulation || guid == NULL || strcmp(guid, MODEL_GUID) != 0) {
        return NULL;
    }
    struct instance *slave = calloc(1, sizeof *slave);
    if (slave == NULL) {
        return NULL;
    }
    slave->callbacks = *callbacks;
    if (name != NULL) {
        strncpy(slave->name, name, sizeof slave->name - 1);
    }
    reset(&slave->state);
    return slave;
}

void fmi2FreeInstance(fmi2Component c)
{
    free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop)
{
    struct instance *slave = c;
    (void)tolerance_defined;
    (void)tolerance;
    (void)stop_defined;
    (void)stop;
    slave->state.time_s = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    struct instance *slave = c;
    for (int side = 0; side < WHEELS; side++) {
        struct wheel *wheel = &slave->state.wheel[side];
        const char *wrong = wheel_problem(wheel);
        if (wrong != NULL) {
            return fail(slave, wrong);
        }
        wheel->lagged = wheel->parameter[OFFSET];
    }
    slave->state.initialised = true;
    return fmi2OK;
}

/* Both wheels, and the correction beside them; false: too many changes of effort. */
static bool advance(struct state *state, double time, double step)
{
    const double longest_s = correction_longest_step_s();
    const int count = correction_terms() > 0 && step > longest_s ? (int)ceil(step / longest_s) : 1;
    const double h = step / count;
    for (int n = 0; n < count; n++) {
        double effort[WHEELS], speed_mps[WHEELS];
        for (int side = 0; side < WHEELS; side++) {
            if (!wheel_step(&state->wheel[side], time + n * h, h)) {
                return false;
            }
            effort[side] = state->wheel[side].input;
            speed_mps[side] = state->wheel[side].speed_mps;
        }
        if (correction_terms() > 0 && h > 0.0) {
            correction_step(&state->correction, h, effort, speed_mps, state->wheelbase_m);
        }
    }
    for (int side = 0; side < WHEELS; side++) {
        const struct wheel *wheel = &state->wheel[side];
        const bool corrected = correction_terms() > 0;
        state->speed_mps[side] = corrected ? state->correction.shown_mps[side] : wheel->speed_mps;
        state->travel_m[side] = corrected ? state->correction.travel_m[side] : wheel->travel_m;
    }
    return true;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_return)
{
    struct instance *slave = c;
    struct state *state = &slave->state;
    (void)no_return;
    if (!state->initialised || !(step >= 0.0) || !isfinite(time + step)) {
        return fail(slave, "a step before initialisation has ended, or of no valid length");
    }
    double moved[WHEELS];
    const double before[WHEELS] = {state->travel_m[0], state->travel_m[1]};
    if (!advance(state, time, step)) {
        return fail(slave, "the effort changed more often within its delay than can be remembered");
    }
    for (int side = 0; side < WHEELS; side++) {
        moved[side] = state->travel_m[side] - before[side];
    }
    if (state->wheelbase_m > 0.0) {
        /* Midpoint (second-order Runge-Kutta) odometry. */
        const double turn = (moved[1] - moved[0]) / state->wheelbase_m;
        const double heading = state->theta_rad + 0.5 * turn;
        state->x_m += 0.5 * (moved[0] + moved[1]) * cos(heading);
        state->y_m += 0.5 * (moved[0] + moved[1]) * sin(heading);
        state->theta_rad += turn;
    }
    state->time_s = time + step;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    struct instance *slave = c;
    reset(&slave->state);
    return fmi2OK;
}

/* ---- snapshots */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *copy)
{
    struct instance *slave = c;
    if (*copy == NULL) {
        *copy = malloc(sizeof slave->state);
    }
    if (*copy == NULL) {
        return fail(slave, "out of memory");
    }
    memcpy(*copy, &slave->state, sizeof slave->state);
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate copy)
{
    struct instance *slave = c;
    memcpy(&slave->state, copy, sizeof slave->state);
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *copy)
{
    (void)c;
    free(*copy);
    *copy = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate copy, size_t *size)
{
    (void)c;
    (void)copy;
    *size = sizeof(struct state);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate copy, fmi2Byte bytes[], size_t size)
{
    if (size < sizeof(struct state)) {
        return fail(c, "too few bytes for a state");
    }
    memcpy(bytes, copy, sizeof(struct state));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *copy)
{
    if (size != sizeof(struct state)) {
        return fail(c, "these bytes are no state of this model");
    }
    if (*copy == NULL) {
        *copy = malloc(sizeof(struct state));
    }
    if (*copy == NULL) {
        return fail(c, "out of memory");
    }
    memcpy(*copy, bytes, size);
    return fmi2OK;
}
