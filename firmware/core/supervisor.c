/* Whether the robot may move, and what stops it: states, and a table of faults.
 *
 * Faults are *active* while their cause is present. In the moving states an active fault that stops is
 * latched at once. While the robot stands there is nothing to stop, so that a robot pushed by hand needs no
 * clearing afterwards; there the self check keeps it from moving. */
#include "supervisor.h"

#include "proto.h"

/* Faults whose cause is over once it has been seen: nothing has to go away before they can be cleared. */
static const uint32_t passing_faults = (uint32_t)PROTO_FAULT_HOST_SILENT | (uint32_t)PROTO_FAULT_LOOP_OVERRUN;

struct rule {
    uint32_t fault; /* enum proto_fault */
    bool (*present)(const struct supervisor *, const struct tuning *, const struct supervisor_view *);
};

bool supervisor_is_moving(const struct supervisor *supervisor)
{
    return supervisor->state == PROTO_STATE_LIVE || supervisor->state == PROTO_STATE_SEQUENCE;
}

static bool wheel_implausible(const struct supervisor *supervisor, const struct tuning *tuning,
                              const struct supervisor_view *view, int wheel)
{
    const float speed = view->speed_mps[wheel];
    const bool too_fast = speed > tuning->encoder_speed_max_mps || speed < -tuning->encoder_speed_max_mps;
    /* On the move a slope or the other wheel may turn a braked wheel; that is no reason to stop. */
    const bool turns_at_rest = !supervisor_is_moving(supervisor) && view->at_rest && !view->still[wheel];
    return too_fast || turns_at_rest;
}

static bool left_implausible(const struct supervisor *supervisor, const struct tuning *tuning,
                             const struct supervisor_view *view)
{
    return wheel_implausible(supervisor, tuning, view, 0);
}

static bool right_implausible(const struct supervisor *supervisor, const struct tuning *tuning,
                              const struct supervisor_view *view)
{
    return wheel_implausible(supervisor, tuning, view, 1);
}

static bool battery_unread(const struct supervisor *supervisor, const struct tuning *tuning,
                           const struct supervisor_view *view)
{
    (void)supervisor;
    (void)tuning;
    return !view->battery_valid;
}

static bool battery_low(const struct supervisor *supervisor, const struct tuning *tuning,
                        const struct supervisor_view *view)
{
    (void)tuning;
    (void)view;
    return supervisor->battery_low;
}

static bool host_silent(const struct supervisor *supervisor, const struct tuning *tuning,
                        const struct supervisor_view *view)
{
    (void)view;
    return supervisor->state == PROTO_STATE_LIVE && supervisor->silence_ms >= tuning->command_timeout_ms;
}

static bool loop_overrun(const struct supervisor *supervisor, const struct tuning *tuning,
                         const struct supervisor_view *view)
{
    (void)tuning;
    (void)view;
    return supervisor->overrun;
}

static bool clock_fallback(const struct supervisor *supervisor, const struct tuning *tuning,
                           const struct supervisor_view *view)
{
    (void)tuning;
    (void)view;
    return supervisor->clock_fallback;
}

static bool store_damaged(const struct supervisor *supervisor, const struct tuning *tuning,
                          const struct supervisor_view *view)
{
    (void)tuning;
    (void)view;
    return supervisor->store_damaged;
}

static const struct rule rules[] = {
    {PROTO_FAULT_ENCODER_LEFT_IMPLAUSIBLE, left_implausible},
    {PROTO_FAULT_ENCODER_RIGHT_IMPLAUSIBLE, right_implausible},
    {PROTO_FAULT_BATTERY_UNREAD, battery_unread},
    {PROTO_FAULT_BATTERY_LOW, battery_low},
    {PROTO_FAULT_HOST_SILENT, host_silent},
    {PROTO_FAULT_LOOP_OVERRUN, loop_overrun},
    {PROTO_FAULT_CLOCK_FALLBACK, clock_fallback},
    {PROTO_FAULT_PARAMETER_STORE_DAMAGED, store_damaged},
};

_Static_assert(sizeof rules / sizeof rules[0] == PROTO_FAULT_COUNT, "every fault of the schema has a rule");

void supervisor_init(struct supervisor *supervisor, bool clock_is_fallback)
{
    *supervisor = (struct supervisor){.state = PROTO_STATE_IDLE, .clock_fallback = clock_is_fallback};
}

static void watch_battery(struct supervisor *supervisor, const struct tuning *tuning,
                          const struct supervisor_view *view)
{
    if (!view->battery_valid) {
        return; /* nothing is known; battery_unread says so */
    }
    if (view->battery_mv >= tuning->battery_low_mv) {
        supervisor->battery_below_ms = 0;
        if (view->battery_mv >= tuning->battery_recovered_mv) {
            supervisor->battery_low = false;
        }
    } else if (supervisor->battery_below_ms < SUPERVISOR_BATTERY_LOW_MS) {
        supervisor->battery_below_ms++;
    } else {
        supervisor->battery_low = true;
    }
}

bool supervisor_step(struct supervisor *supervisor, const struct tuning *tuning,
                     const struct supervisor_view *view)
{
    watch_battery(supervisor, tuning, view);
    if (supervisor->state == PROTO_STATE_LIVE && supervisor->silence_ms < UINT32_MAX) {
        supervisor->silence_ms++;
    }
    uint32_t active = 0;
    for (uint32_t i = 0; i < PROTO_FAULT_COUNT; i++) {
        if (rules[i].present(supervisor, tuning, view)) {
            active |= rules[i].fault;
        }
    }
    supervisor->active = active;
    supervisor->overrun = false;
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
    uint32_t unfit = supervisor->active & PROTO_FAULTS_THAT_STOP & ~passing_faults;
    if (from_rest && !view->still[0]) {
        unfit |= PROTO_FAULT_ENCODER_LEFT_IMPLAUSIBLE;
    }
    if (from_rest && !view->still[1]) {
        unfit |= PROTO_FAULT_ENCODER_RIGHT_IMPLAUSIBLE;
    }
    if (!view->battery_valid) {
        unfit |= PROTO_FAULT_BATTERY_UNREAD;
    } else if (view->battery_mv < tuning->battery_low_mv) {
        /* At rest nothing sags: one reading is enough to refuse. */
        unfit |= PROTO_FAULT_BATTERY_LOW;
    }
    return unfit;
}

uint32_t supervisor_clear(struct supervisor *supervisor)
{
    const uint32_t present = supervisor->active & PROTO_FAULTS_THAT_STOP & ~passing_faults;
    if (present == 0) {
        supervisor->latched = 0;
        if (supervisor->state == PROTO_STATE_STOPPED) {
            supervisor->state = PROTO_STATE_IDLE;
        }
    }
    return present;
}
