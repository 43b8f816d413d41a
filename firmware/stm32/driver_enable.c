/* The enable pin of the motor drivers, an output of TIM1 or TIM8 that the timer's break takes away.
 *
 * The channel's output is forced. Where the pin has a timer to itself it is forced active, the counter stands
 * still, and the pin is active while MOE is set. Where it shares a bridge's timer, MOE is the bridge's, and
 * the output is forced active or inactive instead. The emergency stop's contact is wired to the break inputs
 * of both timers; while it is open they clear MOE by themselves, without a clock or a program, and OSSI with
 * the idle level holds the pin inactive (RM0090 section 17.3.12). While a debugger halts the core the same
 * happens (debugger.c). In a reset the pin floats, and the resistor outside holds it inactive. */
#include "driver_enable.h"

#include "hal.h"
#include "pins.h"
#include "registers.h"

#define ENABLE_TIMER TIMER(BOARD_ENABLE_TIMER)

#define DISABLED (TIM_BDTR_OSSI | TIM_BDTR_BKE | TIM_BDTR_BKP)

/* Writes the register of the channel's pair, which no bridge uses (wiring_checks.h). */
static inline void force(uint32_t mode)
{
    const uint32_t ccmr = mode << (8u * (ENABLE_INDEX % 2u));
    if (BOARD_ENABLE_CHANNEL <= 2u) {
        ENABLE_TIMER->ccmr1 = ccmr;
    } else {
        ENABLE_TIMER->ccmr2 = ccmr;
    }
}

void driver_enable_start(void)
{
    const bool low = DRIVER_ENABLE_ACTIVE_LOW != 0;
    pin_prepare(BOARD_ENABLE_PIN, FUNCTION_OF_TIMER(BOARD_ENABLE_TIMER), low ? PULL_UP : PULL_DOWN);
    pin_to_peripheral(BREAK_PIN_OF(BOARD_ENABLE_TIMER), FUNCTION_OF_BREAK(BOARD_ENABLE_TIMER), PULL_UP);
    ENABLE_TIMER->bdtr = DISABLED;
    ENABLE_TIMER->cr2 = ENABLE_CR2_IN(BOARD_ENABLE_TIMER);
    force(ENABLE_HAS_OWN_TIMER ? TIM_CCMR_ACTIVE : TIM_CCMR_INACTIVE);
    ENABLE_TIMER->ccer = ENABLE_CCER_IN(BOARD_ENABLE_TIMER);
    pin_field(&pin_port(BOARD_ENABLE_PIN)->moder, pin_number(BOARD_ENABLE_PIN), 2, 2);
    driver_enable_release();
}

void driver_enable_off(void)
{
    if (ENABLE_HAS_OWN_TIMER) {
        ENABLE_TIMER->bdtr = DISABLED;
    } else {
        force(TIM_CCMR_INACTIVE);
    }
}

void driver_enable_release(void)
{
    ENABLE_TIMER->sr = ~TIM_SR_BIF; /* comes back at once while the contact is open */
}

void hal_enable_driver(bool enabled)
{
    const bool active = enabled && (ENABLE_TIMER->sr & TIM_SR_BIF) == 0;
    if (ENABLE_HAS_OWN_TIMER) {
        const uint32_t wanted = active ? DISABLED | TIM_BDTR_MOE : DISABLED;
        if (ENABLE_TIMER->bdtr != wanted) { /* a break has cleared MOE by itself */
            ENABLE_TIMER->bdtr = wanted;
        }
    } else {
        force(active ? TIM_CCMR_ACTIVE : TIM_CCMR_INACTIVE);
    }
}
