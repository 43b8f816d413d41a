/* Drives two H-bridges with IN/IN inputs (DRV8871 class) from TIM1 at 20 kHz, in slow decay.
 *
 *   IN1 IN2  bridge            used for
 *    0   0   coast, then sleep reset, power-up, ROM loader: the pins float, the driver's pull-downs hold them
 * low 1   0   forward           the driven part of the period at positive effort 0   1   reverse the driven
 * part of the period at negative effort 1   1   brake             the rest of the period, zero effort, and
 * every fault
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

enum { EFFORT_FULL_E4 = 10000, PIN_FUNCTION_TIM1 = 1, FIRST_PIN = 8, CHANNELS = 4 };

/* MODER's two bits for each of the four pins, PA8 to PA11. */
enum { ALL_TO_PERIPHERAL = 0xAA };

/* The emergency stop: a normally closed contact from PB12, TIM1_BKIN (AF1), to ground. Pressed, or with a
 * broken wire, the pull-up raises the pin, and the timer clears MOE by itself, without a clock or a program
 * (RM0090 section 17.3.12). MOE stays low, and cannot be set while the contact is open. */
enum { STOP_PIN = 12 };

/* Outputs at their idle level, with the emergency stop armed. */
#define BRAKED (TIM_BDTR_OSSI | TIM_BDTR_BKE | TIM_BDTR_BKP)

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
    TIM1->ccr[2u * wheel] = effort_e4 < 0 ? period - driven : period;
    TIM1->ccr[2u * wheel + 1u] = effort_e4 > 0 ? period - driven : period;
}

void motors_start(uint32_t timer_hz)
{
    period = timer_hz / MOTOR_PWM_HZ;
    TIM1->cr1 = TIM_CR1_ARPE;
    TIM1->psc = 0;
    TIM1->arr = period - 1u;
    TIM1->ccmr1 = (TIM_CCMR_PWM1 | TIM_CCMR_PRELOAD) * 0x0101u;
    TIM1->ccmr2 = (TIM_CCMR_PWM1 | TIM_CCMR_PRELOAD) * 0x0101u;
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        set_bridge(wheel, 0);
    }
    /* With the main output off, OSSI keeps the pins driven at their idle level (RM0090 section 17.4.9):
     * brake. */
    uint32_t idle_high = 0;
    uint32_t enable = 0;
    for (uint32_t channel = 0; channel < CHANNELS; channel++) {
        idle_high |= TIM_CR2_OIS(channel);
        enable |= TIM_CCER_ENABLE(channel);
    }
    TIM1->cr2 = idle_high;
    pin_to_peripheral(GPIOB, STOP_PIN, PIN_FUNCTION_TIM1, PULL_UP);
    TIM1->bdtr = BRAKED;
    TIM1->ccer = enable;
    TIM1->egr = TIM_EGR_UG;
    TIM1->cr1 = TIM_CR1_ARPE | TIM_CR1_CEN;
    for (uint32_t channel = 0; channel < CHANNELS; channel++) {
        pin_prepare(GPIOA, FIRST_PIN + channel, PIN_FUNCTION_TIM1, PULL_NONE);
    }
    /* All four at once: a bridge with one input high and the other still floating low would drive. */
    pin_field(&GPIOA->moder, FIRST_PIN / CHANNELS, 2 * CHANNELS, ALL_TO_PERIPHERAL);
    TIM1->sr = ~TIM_SR_BIF;
    motors_go();
}

void motors_stop(void)
{
    TIM1->bdtr = BRAKED;
    driver_enable_off();
}

void motors_go(void)
{
    if ((TIM1->sr & TIM_SR_BIF) == 0) {
        TIM1->bdtr = BRAKED | TIM_BDTR_MOE;
    }
}

static bool is_contact_open(void)
{
    return (GPIOB->idr & 1u << STOP_PIN) != 0;
}

bool motors_emergency_stop(void)
{
    return (TIM1->sr & TIM_SR_BIF) != 0 || is_contact_open();
}

bool hal_release_emergency_stop(void)
{
    if (is_contact_open()) {
        return false;
    }
    TIM1->sr = ~TIM_SR_BIF;
    driver_enable_release();
    motors_go();
    return (TIM1->sr & TIM_SR_BIF) == 0;
}

void hal_drive(const int16_t effort_e4[HAL_WHEELS])
{
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        set_bridge(wheel, effort_e4[wheel]);
    }
}
