/* Measures the crystal against the RC oscillator before anything runs from it: a PLL that makes 168 MHz from
 * 8 makes 252 from 12, far beyond what flash and CPU bear.
 *
 * A timer counts the RC oscillator and captures the crystal, which reaches its channel 1 inside the chip,
 * divided there, and again by 8 by the channel's prescaler. */
#include "crystal.h"

#include <stdint.h>

#include "crystal_port.h"
#include "registers.h"
#include "wiring.h"

/* What SysTick, the timer and the CPU run from meanwhile. */
#define RC_HZ 16000000u

enum { PRESCALER = 8, CAPTURES = 64 };

/* 2 ms: the end of each period is known to a count of 62.5 ns. */
#define COUNTS (RC_HZ / 1000u * CRYSTAL_DIVIDER * PRESCALER * CAPTURES / (BOARD_CRYSTAL_HZ / 1000u))

/* Datasheet DocID022152, section 5.3.9: the factory's calibration of the RC oscillator holds within -8 and
 * +4.5 % from -40 to 105 C, and within 1 % at 25 C. Half a per cent more is left to the crystal and to the
 * counts. In place of 8 MHz, at 25 C a crystal below 7.6 or above 8.8 MHz is noticed, at any temperature one
 * below 7.0 or above 9.2; of the usual ones 8.192 MHz passes, with which the CPU runs 2.4 % too fast. */
#define COUNTS_MIN (COUNTS * 915u / 1000u)
#define COUNTS_MAX (COUNTS * 1050u / 1000u)

/* A crystal of 4 MHz, the slowest that the chip takes, needs 62 us for a capture. */
#define CAPTURE_LIMIT (RC_HZ / 4000u)

/* False: none came in time. */
static bool next_capture(uint16_t *count)
{
    const uint32_t start = SYSTICK->val;
    while ((CRYSTAL_TIMER->sr & TIM_SR_CC1IF) == 0) {
        if (((start - SYSTICK->val) & SYSTICK_MAX) > CAPTURE_LIMIT) {
            return false;
        }
    }
    *count = (uint16_t)CRYSTAL_TIMER->ccr[0]; /* clears the flag */
    return true;
}

/* Counts of the RC oscillator in 64 captures; 0: it does not oscillate at anything near. */
static uint32_t measure(void)
{
    uint16_t last;
    uint16_t next;
    uint32_t counts = 0;
    if (!next_capture(&last)) {
        return 0;
    }
    for (uint32_t i = 0; i < CAPTURES; i++) {
        if (!next_capture(&next)) {
            return 0;
        }
        counts += (uint16_t)(next - last);
        last = next;
    }
    return (CRYSTAL_TIMER->sr & TIM_SR_CC1OF) == 0 ? counts : 0; /* one was missed: far too fast */
}

bool crystal_is_right(void)
{
    crystal_connect();
    CRYSTAL_TIMER->ccmr1 = TIM_CCMR_INPUT | TIM_CCMR_EACH_8;
    CRYSTAL_TIMER->ccer = TIM_CCER_ENABLE(0);
    CRYSTAL_TIMER->cr1 = TIM_CR1_CEN;
    const uint32_t counts = measure();
    CRYSTAL_TIMER->cr1 = 0;
    CRYSTAL_TIMER->ccer = 0;
    crystal_disconnect();
    return counts >= COUNTS_MIN && counts <= COUNTS_MAX;
}
