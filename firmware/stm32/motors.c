/* Drives two H-bridges from TIM1, TIM8 or both at 20 kHz, in slow decay, through drivers of three kinds.
 *
 * IN/IN (DRV8871 class):
 *   both low: coast, then sleep. In a reset and before power-up: the pins float, and the driver's pull-downs
 *       hold them.
 *   IN1 high, IN2 low: forward. The driven part of each period at positive effort.
 *   IN1 low, IN2 high: reverse. The driven part of each period at negative effort.
 *   both high: brake. The rest of each period, zero effort, and every fault.
 * PWM and direction (MD10C class): PWM is high for the driven part, and low brakes; direction low is forward.
 * Enable and phase (DRV8838, DRV8876 class): the same, but phase high is forward.
 *
 * Slow decay (drive and brake in turn) makes mean voltage, and so speed, linear in effort; drive and coast
 * would let the current decay to zero at small efforts. Idle is brake, for the same reason that zero effort
 * is: a robot without a command should stand, also on a slope. Coast occurs only while no program runs. A
 * change of effort may take effect in two halves, since the four compare registers are written one after the
 * other; the worst case is one period (50 us) of coast or brake. */
#include "motors.h"

#include "driver_enable.h"
#include "hal.h"
#include "pins.h"
#include "registers.h"

enum { EFFORT_FULL_E4 = 10000 };

/* Outputs at their idle level, with the emergency stop armed: a normally closed contact from the timer's
 * break input to ground. Pressed, or with a broken wire, the pull-up raises the pin, and the timer clears MOE
 * by itself, without a clock or a program (RM0090 section 17.3.12). MOE stays low, and cannot be set while
 * the contact is open. Bridges on two timers have such an input each, wired to the one contact. */
#define BRAKED (TIM_BDTR_OSSI | TIM_BDTR_BKE | TIM_BDTR_BKP)

#define LEFT_TIMER  TIMER(BOARD_LEFT_TIMER)
#define RIGHT_TIMER TIMER(BOARD_RIGHT_TIMER)

/* Whether a bridge uses a pair of channels, of which the first is 1 or 3. */
#define PAIR_USED(timer, first)                                                                              \
    ((BOARD_LEFT_TIMER == (timer) && BOARD_LEFT_CHANNEL == (first)) ||                                       \
     (BOARD_RIGHT_TIMER == (timer) && BOARD_RIGHT_CHANNEL == (first)))

/* Idle levels that brake, of a pair's channels from 0: both inputs high, or PWM low whatever the direction.
 */
#define IDLE_LEVELS(channel)                                                                                 \
    (BOARD_DRIVER == DRIVER_IN_IN ? TIM_CR2_OIS(channel) | TIM_CR2_OIS((channel) + 1u) : 0u)

/* MODER's two bits of a pin. */
#define MODE(pin, mode) ((uint32_t)(mode) << (2u * ((pin) % 16u)))

/* Timer counts in one PWM period. A compare value this large is never reached: the output stays high. */
static uint32_t period;

/* Counts that the inputs of one bridge are high. */
static void set_bridge(uint32_t wheel, int32_t effort_e4)
{
    if (effort_e4 > EFFORT_FULL_E4) {
        effort_e4 = EFFORT_FULL_E4;
    } else if (effort_e4 < -EFFORT_FULL_E4) {
        effort_e4 = -EFFORT_FULL_E4;
    }
    const uint32_t magnitude = (uint32_t)(effort_e4 < 0 ? -effort_e4 : effort_e4);
    const uint32_t driven = (magnitude * period + EFFORT_FULL_E4 / 2u) / EFFORT_FULL_E4;
    uint32_t first;
    uint32_t second;
    if (BOARD_DRIVER == DRIVER_IN_IN) {
        first = effort_e4 < 0 ? period - driven : period;
        second = effort_e4 > 0 ? period - driven : period;
    } else { /* the second input is a level, of a channel that turns over with the first at the next period */
        first = driven;
        second = (effort_e4 < 0) == (BOARD_DRIVER == DRIVER_PWM_DIR) ? period : 0u;
    }
    if (BRIDGES_ON_ONE_TIMER && BOARD_LEFT_CHANNEL < BOARD_RIGHT_CHANNEL) {
        LEFT_TIMER->ccr[2u * wheel] = first;
        LEFT_TIMER->ccr[2u * wheel + 1u] = second;
    } else if (wheel == 0u) {
        LEFT_TIMER->ccr[BOARD_LEFT_CHANNEL - 1u] = first;
        LEFT_TIMER->ccr[BOARD_LEFT_CHANNEL] = second;
    } else {
        RIGHT_TIMER->ccr[BOARD_RIGHT_CHANNEL - 1u] = first;
        RIGHT_TIMER->ccr[BOARD_RIGHT_CHANNEL] = second;
    }
}

/* With the main output off, OSSI keeps the pins driven at their idle level (RM0090 section 17.4.9): brake.
 * What the enable pin has in the same registers stays. */
static inline void start_timer(uint32_t number)
{
    struct timer *const timer = TIMER(number);
    uint32_t idle = ENABLE_CR2_IN(number);
    uint32_t enabled = ENABLE_CCER_IN(number);
    timer->cr1 = TIM_CR1_ARPE;
    timer->psc = 0;
    timer->arr = period - 1u;
    if (PAIR_USED(number, 1u)) {
        timer->ccmr1 = (TIM_CCMR_PWM1 | TIM_CCMR_PRELOAD) * 0x0101u;
        idle |= IDLE_LEVELS(0u);
        enabled |= TIM_CCER_ENABLE(0u) | TIM_CCER_ENABLE(1u);
    }
    if (PAIR_USED(number, 3u)) {
        timer->ccmr2 = (TIM_CCMR_PWM1 | TIM_CCMR_PRELOAD) * 0x0101u;
        idle |= IDLE_LEVELS(2u);
        enabled |= TIM_CCER_ENABLE(2u) | TIM_CCER_ENABLE(3u);
    }
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        if ((wheel == 0u ? BOARD_LEFT_TIMER : BOARD_RIGHT_TIMER) == number) {
            set_bridge(wheel, 0);
        }
    }
    timer->cr2 = idle;
    pin_to_peripheral(BREAK_PIN_OF(number), FUNCTION_OF_BREAK(number), PULL_UP);
    timer->bdtr = BRAKED;
    timer->ccer = enabled;
    timer->egr = TIM_EGR_UG;
    timer->cr1 = TIM_CR1_ARPE | TIM_CR1_CEN;
}

/* Both pins of a bridge at once, and both bridges where they share a port: a bridge with one input high and
 * the other still floating low would drive. */
static inline void hand_over_pins(void)
{
    const bool one_port = pin_port(BOARD_LEFT_PIN_1) == pin_port(BOARD_RIGHT_PIN_1);
    reg32 *const left = &pin_port(BOARD_LEFT_PIN_1)->moder;
    reg32 *const right = &pin_port(BOARD_RIGHT_PIN_1)->moder;
    const uint32_t left_mask = MODE(BOARD_LEFT_PIN_1, 3) | MODE(BOARD_LEFT_PIN_2, 3);
    const uint32_t left_used = MODE(BOARD_LEFT_PIN_1, 2) | MODE(BOARD_LEFT_PIN_2, 2);
    const uint32_t right_mask = MODE(BOARD_RIGHT_PIN_1, 3) | MODE(BOARD_RIGHT_PIN_2, 3);
    const uint32_t right_used = MODE(BOARD_RIGHT_PIN_1, 2) | MODE(BOARD_RIGHT_PIN_2, 2);
    if (one_port) {
        *left = (*left & ~(left_mask | right_mask)) | left_used | right_used;
    } else {
        *left = (*left & ~left_mask) | left_used;
        *right = (*right & ~right_mask) | right_used;
    }
}

static inline void forget_break(void)
{
    LEFT_TIMER->sr = ~TIM_SR_BIF;
    if (!BRIDGES_ON_ONE_TIMER) {
        RIGHT_TIMER->sr = ~TIM_SR_BIF;
    }
}

/* A break that has reached one timer only, by a broken wire, holds the other bridge from the next tick on. */
static inline bool was_broken(void)
{
    return (LEFT_TIMER->sr & TIM_SR_BIF) != 0 ||
           (!BRIDGES_ON_ONE_TIMER && (RIGHT_TIMER->sr & TIM_SR_BIF) != 0);
}

static inline void set_outputs(uint32_t bdtr)
{
    LEFT_TIMER->bdtr = bdtr;
    if (!BRIDGES_ON_ONE_TIMER) {
        RIGHT_TIMER->bdtr = bdtr;
    }
}

void motors_start(uint32_t timer_hz)
{
    period = timer_hz / MOTOR_PWM_HZ;
    start_timer(BOARD_LEFT_TIMER);
    if (!BRIDGES_ON_ONE_TIMER) {
        start_timer(BOARD_RIGHT_TIMER);
    }
    pin_prepare(BOARD_LEFT_PIN_1, FUNCTION_OF_TIMER(BOARD_LEFT_TIMER), PULL_NONE);
    pin_prepare(BOARD_LEFT_PIN_2, FUNCTION_OF_TIMER(BOARD_LEFT_TIMER), PULL_NONE);
    pin_prepare(BOARD_RIGHT_PIN_1, FUNCTION_OF_TIMER(BOARD_RIGHT_TIMER), PULL_NONE);
    pin_prepare(BOARD_RIGHT_PIN_2, FUNCTION_OF_TIMER(BOARD_RIGHT_TIMER), PULL_NONE);
    hand_over_pins();
    forget_break();
    motors_go();
}

void motors_await_period(void)
{
    enum { READS = 8400 }; /* more than a period of 8400 cycles takes, in case the timer stands */
    uint32_t before = LEFT_TIMER->cnt;
    for (uint32_t i = 0; i < (uint32_t)READS; i++) {
        const uint32_t now = LEFT_TIMER->cnt;
        if (now < before) {
            return;
        }
        before = now;
    }
}

void motors_stop(void)
{
    set_outputs(BRAKED);
    driver_enable_off();
}

void motors_go(void)
{
    if (!was_broken()) {
        set_outputs(BRAKED | TIM_BDTR_MOE);
    }
}

static inline bool is_contact_open(void)
{
    return pin_is_high(BREAK_PIN_OF(BOARD_LEFT_TIMER)) ||
           (!BRIDGES_ON_ONE_TIMER && pin_is_high(BREAK_PIN_OF(BOARD_RIGHT_TIMER)));
}

bool motors_emergency_stop(void)
{
    return was_broken() || is_contact_open();
}

bool hal_release_emergency_stop(void)
{
    if (is_contact_open()) {
        return false;
    }
    forget_break();
    driver_enable_release();
    motors_go();
    return !was_broken();
}

void hal_drive(const int16_t effort_e4[HAL_WHEELS])
{
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        set_bridge(wheel, effort_e4[wheel]);
    }
}
