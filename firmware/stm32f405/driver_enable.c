/* The enable pin of the motor drivers: PC6, channel 1 of TIM8, an output that the timer's break takes away.
 *
 * The channel is forced active and the counter stands still: the pin is active while MOE is set. The
 * emergency stop's contact is wired to TIM8's break input PA6 as well as to TIM1's; while it is open the
 * timer clears MOE by itself, without a clock or a program, and OSSI with the idle level holds the pin
 * inactive (RM0090 section 17.3.12). While a debugger halts the core the same happens (debugger.c). In a
 * reset the pin floats, and the resistor outside holds it inactive. */
#include "driver_enable.h"

#include "hal.h"
#include "pins.h"
#include "registers.h"

enum { ENABLE_PIN = 6, BREAK_PIN = 6, PIN_FUNCTION_TIM8 = 3 };

#define DISABLED (TIM_BDTR_OSSI | TIM_BDTR_BKE | TIM_BDTR_BKP)

void driver_enable_start(void)
{
    const bool low = DRIVER_ENABLE_ACTIVE_LOW != 0;
    pin_prepare(GPIOC, ENABLE_PIN, PIN_FUNCTION_TIM8, low ? PULL_UP : PULL_DOWN);
    pin_to_peripheral(GPIOA, BREAK_PIN, PIN_FUNCTION_TIM8, PULL_UP);
    TIM8->bdtr = DISABLED;
    TIM8->cr2 = low ? TIM_CR2_OIS(0) : 0;
    TIM8->ccmr1 = TIM_CCMR_ACTIVE;
    TIM8->ccer = TIM_CCER_ENABLE(0) | (low ? TIM_CCER_INVERT(0) : 0u);
    pin_field(&GPIOC->moder, ENABLE_PIN, 2, 2);
    driver_enable_release();
}

void driver_enable_off(void)
{
    TIM8->bdtr = DISABLED;
}

void driver_enable_release(void)
{
    TIM8->sr = ~TIM_SR_BIF; /* comes back at once while the contact is open */
}

void hal_enable_driver(bool enabled)
{
    const uint32_t wanted = enabled && (TIM8->sr & TIM_SR_BIF) == 0 ? DISABLED | TIM_BDTR_MOE : DISABLED;
    if (TIM8->bdtr != wanted) { /* a break has cleared MOE by itself */
        TIM8->bdtr = wanted;
    }
}
