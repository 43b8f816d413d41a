/* Counts quadrature edges in hardware and extends the counts to 32 bits. */
#include "encoders.h"

#include "pins.h"
#include "registers.h"

enum { PIN_FUNCTION_TIM3_TIM4 = 2 };

/* A level must hold for eight samples at 84 MHz / 4 / 8, that is 3.05 us, before it counts (RM0090 section
 * 18.4.7). Edges of the bridges couple pulses of about a microsecond into encoder wires. The fastest encoder
 * this passes gives 650 000 counts a second. */
enum { FILTER = 9 };

static struct timer *const timers[HAL_WHEELS] = {TIM3, TIM4};
static uint16_t last[HAL_WHEELS];
static uint32_t total[HAL_WHEELS]; /* unsigned: it wraps */

void encoders_start(void)
{
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        struct timer *const timer = timers[wheel];
        timer->cr1 = TIM_CR1_CKD_DIV4;
        timer->ccmr1 = (TIM_CCMR_INPUT | TIM_CCMR_FILTER(FILTER)) * 0x0101u;
        timer->ccer = 0; /* rising edges, not inverted */
        timer->smcr = TIM_SMCR_ENCODER_X4;
        timer->psc = 0;
        timer->arr = 0xFFFFu;
        timer->egr = TIM_EGR_UG;
        timer->cr1 = TIM_CR1_CKD_DIV4 | TIM_CR1_CEN;
        /* Pull-ups serve encoders with open collectors, and hold the lines of one that is not there. */
        pin_to_peripheral(GPIOB, 4u + 2u * wheel, PIN_FUNCTION_TIM3_TIM4, PULL_UP);
        pin_to_peripheral(GPIOB, 5u + 2u * wheel, PIN_FUNCTION_TIM3_TIM4, PULL_UP);
        last[wheel] = (uint16_t)timer->cnt;
        total[wheel] = 0;
    }
}

void encoders_update(void)
{
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        const uint16_t now = (uint16_t)timers[wheel]->cnt;
        const int16_t moved = (int16_t)(uint16_t)(now - last[wheel]);
        last[wheel] = now;
        total[wheel] += (uint32_t)moved;
    }
}

void encoders_read(int32_t counts[HAL_WHEELS])
{
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        counts[wheel] = (int32_t)total[wheel];
    }
}
