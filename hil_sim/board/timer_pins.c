/* Outputs of timers: PWM, and the break input that takes them away. */
#include "machine.h"

enum { CEN = 1 << 0, CMS = 3 << 5, DIR = 1 << 4, MOE = 1 << 15, OSSI = 1 << 10 };
enum { BKE = 1 << 12, BKP = 1 << 13, BIF = 1 << 7 };

bool has_break(int timer)
{
    return timer == 1 || timer == 8;
}

/* Fraction of the period for which the reference OCxREF is high (RM0090 17.3.9 and 17.3.10). */
static double reference_duty(struct board *b, int timer, int channel)
{
    const struct timer *t = &b->timer[timer];
    uint32_t mode = t->ccmr[(channel - 1) / 2] >> (8 * ((channel - 1) % 2) + 4) & 7u;
    double compare = t->ccr_active[channel - 1];
    bool centred = (t->cr1 & CMS) != 0;
    double period = centred ? (double)t->arr_active : t->arr_active + 1.0;
    double duty;
    switch (mode) {
    case 5:
        return 1;
    case 6:
    case 7:
        if ((t->cr1 & CEN) == 0) {
            duty = t->from < t->ccr_active[channel - 1] ? 1 : 0; /* the counter does not run */
        } else {
            duty = period <= 0 || compare >= period ? 1 : compare / period;
        }
        return mode == 6 ? duty : 1 - duty;
    default: /* frozen, match and toggle modes: inactive until the first match, which is not modelled */
        return 0;
    }
}

/* Level or duty that a channel puts on its pin; below 0: it does not drive it. */
double timer_output(struct board *b, int timer, int channel)
{
    const struct timer *t = &b->timer[timer];
    uint32_t enable = t->ccer >> (4 * (channel - 1)) & 3u;
    bool input = (t->ccmr[(channel - 1) / 2] >> (8 * ((channel - 1) % 2)) & 3u) != 0;
    if (input || (enable & 1u) == 0) {
        return -1;
    }
    bool inverted = (enable & 2u) != 0;
    if (has_break(timer) && ((t->bdtr & MOE) == 0 || t->frozen)) {
        if ((t->bdtr & OSSI) == 0) {
            return -1; /* outputs released, RM0090 table 96 */
        }
        return (t->cr2 >> (8 + 2 * (channel - 1)) & 1u) != 0 ? 1 : 0; /* idle state OISx */
    }
    double duty = reference_duty(b, timer, channel);
    return inverted ? 1 - duty : duty;
}

/* The break input clears MOE by itself, and holds it and its flag for as long as it is active
 * (RM0090 17.3.12); its source in the clock security system is not modelled. */
void timer_break_update(struct board *b, int timer)
{
    struct timer *t = &b->timer[timer];
    if ((t->bdtr & BKE) != 0 && break_level(b, timer) == ((t->bdtr & BKP) != 0)) {
        t->bdtr &= ~(uint32_t)MOE;
        t->sr |= BIF;
    }
}
