/* The robot's parameters as the host changes, saves and brings them back: only while nothing moves. */
#include "robot_parameters.h"

#include "robot_time.h"

static struct parameter_table table_of(struct robot *robot)
{
    return (struct parameter_table){
        .infos = proto_parameters,
        .values = robot->parameters.values,
        .count = PROTO_PARAMETER_COUNT,
    };
}

/* What the tick reads of the values changes between two ticks, all of it at once; a repaired fault is cleared
 * before the reply is sent. */
static void take_effect(struct robot *robot)
{
    struct tuning tuning;
    const bool damaged = parameter_store_is_damaged(&robot->store);
    tuning_from_parameters(&tuning, &robot->parameters);
    const uint32_t state = hal_critical_enter();
    robot->tuning = tuning;
    robot->supervisor.store_damaged = damaged;
    if (!damaged) {
        robot->supervisor.active &= ~(uint32_t)PROTO_FAULT_PARAMETER_STORE_DAMAGED;
    }
    hal_critical_exit(state);
}

void robot_start_parameters(struct robot *robot)
{
    const struct parameter_table table = table_of(robot);
    parameter_store_open(&robot->store);
    parameter_store_load(&robot->store, &table);
    take_effect(robot);
}

/* A log is of one set of parameters; an armed one is open while nothing moves. */
static struct refusal may_change(const struct robot *robot)
{
    if (supervisor_is_moving(&robot->supervisor)) {
        return refused(PROTO_REFUSAL_REASON_WRONG_STATE, robot->supervisor.state);
    }
    return log_trigger_is_on(&robot->trigger) ? refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0) : accepted();
}

struct refusal robot_set_parameter(struct robot *robot, uint16_t index, float value)
{
    const struct refusal verdict = may_change(robot);
    if (verdict.reason != REFUSAL_NONE) {
        return verdict;
    }
    switch (parameters_set(&robot->parameters, index, value)) {
    case PARAMETERS_OK:
        take_effect(robot);
        return accepted();
    case PARAMETERS_NOT_FINITE:
        return refused(PROTO_REFUSAL_REASON_NOT_FINITE, 1);
    case PARAMETERS_OUT_OF_RANGE:
        return refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    case PARAMETERS_UNKNOWN:
    default:
        return refused(PROTO_REFUSAL_REASON_UNKNOWN_PARAMETER, index);
    }
}

struct refusal robot_prepare_stall(struct robot *robot)
{
    struct refusal verdict = may_change(robot);
    if (verdict.reason == REFUSAL_NONE && (robot->recorder.active || robot->recorder.opening)) {
        /* Its last record is due at the next tick, and would cover a second in which nothing was measured. */
        verdict = refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0);
    }
    if (verdict.reason == REFUSAL_NONE) {
        /* They are braked in every state that leads here. The CPU is about to stall: brake again to be
         * certain. */
        const uint32_t state = hal_critical_enter();
        drive_brake(&robot->drive);
        hal_critical_exit(state);
    }
    return verdict;
}

struct refusal robot_save_parameters(struct robot *robot, struct proto_param_save_reply *out)
{
    const struct refusal verdict = robot_prepare_stall(robot);
    if (verdict.reason != REFUSAL_NONE) {
        return verdict;
    }
    const struct parameter_table table = table_of(robot);
    uint32_t missed_ticks;
    const enum parameter_store_result result = parameter_store_save(&robot->store, &table, &missed_ticks);
    robot_make_up(robot, missed_ticks);
    take_effect(robot);
    if (result == PARAMETER_STORE_FAILED) {
        return refused(PROTO_REFUSAL_REASON_STORE_FAILED, parameter_store_next_slot(&robot->store));
    }
    *out = (struct proto_param_save_reply){
        .sequence = robot->store.sequence,
        .written = result == PARAMETER_STORE_SAVED,
        .stall_ms = (uint16_t)(missed_ticks < UINT16_MAX ? missed_ticks : UINT16_MAX),
    };
    return accepted();
}

struct refusal robot_load_parameters(struct robot *robot, uint16_t *stored)
{
    const struct refusal verdict = may_change(robot);
    if (verdict.reason == REFUSAL_NONE) {
        const struct parameter_table table = table_of(robot);
        parameter_store_load(&robot->store, &table);
        *stored = parameter_store_count(&robot->store, &table).stored;
        take_effect(robot);
    }
    return verdict;
}

struct refusal robot_default_parameters(struct robot *robot)
{
    const struct refusal verdict = may_change(robot);
    if (verdict.reason == REFUSAL_NONE) {
        parameters_set_defaults(&robot->parameters);
        take_effect(robot);
    }
    return verdict;
}

void robot_parameter_store(struct robot *robot, struct proto_param_store_reply *out)
{
    const struct parameter_table table = table_of(robot);
    const struct parameter_store *const store = &robot->store;
    const struct parameter_store_counts counts = parameter_store_count(store, &table);
    *out = (struct proto_param_store_reply){
        .sequence = store->sequence,
        .newest = store->newest,
        .stored = counts.stored,
        .unknown = counts.unknown,
        .unfit = counts.unfit,
    };
    for (uint32_t slot = 0; slot < HAL_STORE_SLOTS; slot++) {
        out->slot_states[slot] = store->states[slot];
    }
}
