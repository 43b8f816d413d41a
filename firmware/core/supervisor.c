/* Whether the robot may move, and what stops it: states, and a table of faults.
 *
 * Faults are *active* while their cause is present. In the moving states an active fault that stops is
 * latched at once. While the robot stands there is nothing to stop, so that a robot pushed by hand needs no
 * clearing afterwards; there the self check keeps it from moving. */
#include "supervisor.h"

typedef bool detector(const struct supervisor *, const struct tuning *, const struct supervisor_view *);

bool supervisor_is_moving(const struct supervisor *supervisor)
{
    return supervisor->state == PROTO_STATE_LIVE || supervisor->state == PROTO_STATE_SEQUENCE;
}

/* Every detector takes all three, and few of them need all three. */
#define DETECTOR(name)                                                                                       \
    static bool name(__attribute__((unused)) const struct supervisor *supervisor,                            \
                     __attribute__((unused)) const struct tuning *tuning,                                    \
                     __attribute__((unused)) const struct supervisor_view *view)

static bool faster_than(float speed_mps, float limit_mps)
{
    return speed_mps > limit_mps || speed_mps < -limit_mps;
}

DETECTOR(left_implausible)
{
    return faster_than(view->speed_mps[0], tuning->encoder_speed_max_mps);
}

DETECTOR(right_implausible)
{
    return faster_than(view->speed_mps[1], tuning->encoder_speed_max_mps);
}

DETECTOR(battery_unread)
{
    return !view->battery_valid;
}

/* With hysteresis: once low, it is low until it has recovered. A battery that was not read leaves the state
 * as it is. */
DETECTOR(battery_low)
{
    const bool was_low = (supervisor->active & PROTO_FAULT_BATTERY_LOW) != 0;
    if (!view->battery_valid) {
        return was_low;
    }
    return view->battery_mv < (was_low ? tuning->battery_recovered_mv : tuning->battery_low_mv);
}

static bool supply_too_high(const struct tuning *tuning, const struct supervisor_view *view)
{
    return view->battery_valid && view->battery_mv > tuning->battery_high_mv;
}

DETECTOR(battery_high)
{
    return supply_too_high(tuning, view);
}

DETECTOR(host_silent)
{
    if (supervisor->state == PROTO_STATE_LIVE) {
        return supervisor->silence_ms >= tuning->command_timeout_ms;
    }
    return supervisor->state == PROTO_STATE_SEQUENCE && !supervisor->unattended &&
           supervisor->silence_ms >= tuning->heartbeat_timeout_ms;
}

DETECTOR(loop_overrun)
{
    return supervisor->overrun;
}

DETECTOR(clock_fallback)
{
    return (supervisor->noted & PROTO_FAULT_CLOCK_FALLBACK) != 0;
}

DETECTOR(store_damaged)
{
    return supervisor->store_damaged;
}

DETECTOR(can_bus_off)
{
    return supervisor->can_bus_off;
}

DETECTOR(left_lost)
{
    return view->lost[0];
}

DETECTOR(right_lost)
{
    return view->lost[1];
}

DETECTOR(left_reversed)
{
    return view->reversed[0];
}

DETECTOR(right_reversed)
{
    return view->reversed[1];
}

DETECTOR(left_stalled)
{
    return view->stalled[0];
}

DETECTOR(right_stalled)
{
    return view->stalled[1];
}

DETECTOR(overspeed)
{
    return faster_than(view->speed_mps[0], tuning->overspeed_mps) ||
           faster_than(view->speed_mps[1], tuning->overspeed_mps);
}

DETECTOR(brown_out)
{
    return (supervisor->noted & PROTO_FAULT_BROWN_OUT) != 0;
}

DETECTOR(program_fault)
{
    return (supervisor->noted & PROTO_FAULT_PROGRAM_FAULT) != 0;
}

DETECTOR(watchdog_reset)
{
    return (supervisor->noted & PROTO_FAULT_WATCHDOG_RESET) != 0;
}

DETECTOR(sequence_damaged)
{
    return supervisor->sequence_damaged;
}

DETECTOR(not_finite)
{
    return supervisor->not_finite;
}

DETECTOR(unexpected_reset)
{
    return (supervisor->noted & PROTO_FAULT_UNEXPECTED_RESET) != 0;
}

DETECTOR(emergency_stop)
{
    return view->emergency_stop;
}

DETECTOR(left_hot)
{
    return view->hot[0];
}

DETECTOR(right_hot)
{
    return view->hot[1];
}

DETECTOR(supply_dip)
{
    return view->supply_dip;
}

DETECTOR(brown_out_reset_off)
{
    return (supervisor->noted & PROTO_FAULT_BROWN_OUT_RESET_OFF) != 0;
}

DETECTOR(crystal_wrong)
{
    return (supervisor->noted & PROTO_FAULT_CRYSTAL_WRONG) != 0;
}

DETECTOR(main_loop_hung)
{
    return supervisor->main_loop_hung;
}

/* name, detector, hold (ms of the cause before the fault counts), does it stop, what it takes to clear it.
 * In the order of the schema. Times that depend on the wheel are held by wheel_watch. */
#define FAULTS(ROW)                                                                                          \
    ROW(ENCODER_LEFT_IMPLAUSIBLE, left_implausible, 0, true, WHEN_GONE)                                      \
    ROW(ENCODER_RIGHT_IMPLAUSIBLE, right_implausible, 0, true, WHEN_GONE)                                    \
    ROW(BATTERY_UNREAD, battery_unread, 0, true, WHEN_GONE)                                                  \
    ROW(BATTERY_LOW, battery_low, SUPERVISOR_BATTERY_LOW_MS, true, WHEN_GONE)                                \
    ROW(HOST_SILENT, host_silent, 0, true, AT_ONCE)                                                          \
    ROW(LOOP_OVERRUN, loop_overrun, 0, true, AT_ONCE)                                                        \
    ROW(CLOCK_FALLBACK, clock_fallback, 0, false, LASTS)                                                     \
    ROW(PARAMETER_STORE_DAMAGED, store_damaged, 0, true, WHEN_GONE)                                          \
    ROW(ENCODER_LEFT_LOST, left_lost, 0, true, AT_ONCE)                                                      \
    ROW(ENCODER_RIGHT_LOST, right_lost, 0, true, AT_ONCE)                                                    \
    ROW(ENCODER_LEFT_REVERSED, left_reversed, 0, true, AT_ONCE)                                              \
    ROW(ENCODER_RIGHT_REVERSED, right_reversed, 0, true, AT_ONCE)                                            \
    ROW(WHEEL_LEFT_STALLED, left_stalled, 0, true, AT_ONCE)                                                  \
    ROW(WHEEL_RIGHT_STALLED, right_stalled, 0, true, AT_ONCE)                                                \
    ROW(OVERSPEED, overspeed, SUPERVISOR_OVERSPEED_MS, true, WHEN_GONE)                                      \
    ROW(BROWN_OUT, brown_out, 0, true, AT_ONCE)                                                              \
    ROW(PROGRAM_FAULT, program_fault, 0, true, AT_ONCE)                                                      \
    ROW(WATCHDOG_RESET, watchdog_reset, 0, true, AT_ONCE)                                                    \
    ROW(SEQUENCE_DAMAGED, sequence_damaged, 0, true, AT_ONCE)                                                \
    ROW(CAN_BUS_OFF, can_bus_off, 0, false, WHEN_GONE)                                                       \
    ROW(CONTROL_NOT_FINITE, not_finite, 0, true, WHEN_GONE)                                                  \
    ROW(MAIN_LOOP_HUNG, main_loop_hung, 0, true, AT_ONCE)                                                    \
    ROW(UNEXPECTED_RESET, unexpected_reset, 0, true, AT_ONCE)                                                \
    ROW(EMERGENCY_STOP, emergency_stop, 0, true, AT_ONCE)                                                    \
    ROW(BATTERY_HIGH, battery_high, SUPERVISOR_BATTERY_HIGH_MS, true, WHEN_GONE)                             \
    ROW(MOTOR_LEFT_HOT, left_hot, 0, true, WHEN_GONE)                                                        \
    ROW(MOTOR_RIGHT_HOT, right_hot, 0, true, WHEN_GONE)                                                      \
    ROW(SUPPLY_DIP, supply_dip, 0, true, WHEN_GONE)                                                          \
    ROW(BROWN_OUT_RESET_OFF, brown_out_reset_off, 0, false, LASTS)                                           \
    ROW(CRYSTAL_WRONG, crystal_wrong, 0, false, LASTS)

enum position {
#define POSITION(name, present, hold, stops, clears) POSITION_##name,
    FAULTS(POSITION)
#undef POSITION
        ROWS
};
_Static_assert(ROWS == PROTO_FAULT_COUNT, "every fault of the schema has a row");

#define CHECK(name, present, hold, stops, clears)                                                            \
    _Static_assert(PROTO_FAULT_##name == 1u << POSITION_##name, "the rows are in the schema's order");       \
    _Static_assert(((PROTO_FAULTS_THAT_STOP & PROTO_FAULT_##name) != 0) == (stops), "row and schema agree");
FAULTS(CHECK)
#undef CHECK

static const struct {
    detector *present;
    uint16_t hold_ms;
    uint8_t clears; /* enum supervisor_clears */
} rows[] = {
#define CLEARS_WHEN_GONE                        SUPERVISOR_CLEARS_WHEN_GONE
#define CLEARS_AT_ONCE                          SUPERVISOR_CLEARS_AT_ONCE
#define CLEARS_LASTS                            SUPERVISOR_LASTS
#define ROW(name, present, hold, stops, clears) {present, hold, CLEARS_##clears},
    FAULTS(ROW)
#undef ROW
};

struct supervisor_row supervisor_row(uint32_t bit)
{
    return (struct supervisor_row){
        .hold_ms = rows[bit].hold_ms,
        .stops = (PROTO_FAULTS_THAT_STOP & 1u << bit) != 0,
        .clears = (enum supervisor_clears)rows[bit].clears,
    };
}

static uint32_t faults_that_clear(enum supervisor_clears how)
{
    uint32_t faults = 0;
    for (uint32_t bit = 0; bit < ROWS; bit++) {
        if (rows[bit].clears == (uint8_t)how) {
            faults |= 1u << bit;
        }
    }
    return faults;
}

void supervisor_init(struct supervisor *supervisor, uint32_t boot_faults)
{
    const uint32_t latched = boot_faults & PROTO_FAULTS_THAT_STOP;
    *supervisor = (struct supervisor){
        .state = latched != 0 ? PROTO_STATE_STOPPED : PROTO_STATE_IDLE,
        .latched = latched,
        .noted = boot_faults,
    };
}

void supervisor_stop(struct supervisor *supervisor, uint32_t faults)
{
    const uint32_t state = hal_critical_enter();
    supervisor->latched |= faults;
    supervisor->state = PROTO_STATE_STOPPED;
    hal_critical_exit(state);
}

bool supervisor_step(struct supervisor *supervisor, const struct tuning *tuning,
                     const struct supervisor_view *view)
{
    if (supervisor_is_moving(supervisor) && supervisor->silence_ms < UINT32_MAX) {
        supervisor->silence_ms = supervisor->silence_ms + 1u;
    }
    uint32_t active = 0;
    for (uint32_t bit = 0; bit < ROWS; bit++) {
        if (!rows[bit].present(supervisor, tuning, view)) {
            supervisor->present_ms[bit] = 0;
        } else if (supervisor->present_ms[bit] < rows[bit].hold_ms) {
            supervisor->present_ms[bit]++;
        } else {
            active |= 1u << bit;
        }
    }
    supervisor->active = active;
    supervisor->overrun = false;
    supervisor->sequence_damaged = false;
    const uint32_t stopping = active & PROTO_FAULTS_THAT_STOP;
    if (stopping == 0 || !supervisor_is_moving(supervisor)) {
        return false;
    }
    supervisor->latched |= stopping;
    supervisor->state = PROTO_STATE_STOPPED;
    return true;
}

uint32_t supervisor_self_check(const struct supervisor *supervisor, const struct tuning *tuning,
                               const struct supervisor_view *view, bool from_rest)
{
    uint32_t unfit =
        supervisor->active & PROTO_FAULTS_THAT_STOP & faults_that_clear(SUPERVISOR_CLEARS_WHEN_GONE);
    if (from_rest && !view->still[0]) {
        unfit |= PROTO_FAULT_ENCODER_LEFT_IMPLAUSIBLE;
    }
    if (from_rest && !view->still[1]) {
        unfit |= PROTO_FAULT_ENCODER_RIGHT_IMPLAUSIBLE;
    }
    if (view->emergency_stop) {
        unfit |= PROTO_FAULT_EMERGENCY_STOP;
    }
    if (view->supply_dip) {
        unfit |= PROTO_FAULT_SUPPLY_DIP;
    }
    if (!view->battery_valid) {
        unfit |= PROTO_FAULT_BATTERY_UNREAD;
    } else if (view->battery_mv < tuning->battery_low_mv) {
        /* At rest the supply does not sag: one reading suffices to refuse. */
        unfit |= PROTO_FAULT_BATTERY_LOW;
    }
    if (supply_too_high(tuning, view)) {
        unfit |= PROTO_FAULT_BATTERY_HIGH;
    }
    return unfit;
}

uint32_t supervisor_clear(struct supervisor *supervisor)
{
    const uint32_t present =
        supervisor->active & PROTO_FAULTS_THAT_STOP & faults_that_clear(SUPERVISOR_CLEARS_WHEN_GONE);
    if (present != 0) {
        return present;
    }
    supervisor->latched = 0;
    supervisor->noted &= faults_that_clear(SUPERVISOR_LASTS);
    supervisor->active &= faults_that_clear(SUPERVISOR_LASTS);
    if (supervisor->state == PROTO_STATE_STOPPED) {
        supervisor->state = PROTO_STATE_IDLE;
    }
    return 0;
}
