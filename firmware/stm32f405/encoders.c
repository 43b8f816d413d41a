/* Counts quadrature edges in hardware, extends the counts to 32 bits, and dates one edge per wheel and tick.
 *
 * In encoder mode a timer captures counts, not time. So the same pins also lead to external interrupts (an
 * input stage serves both, RM0090 section 8.3.11), and the first edge after each tick reads the time from
 * TIM2. That edge silences its wheel's lines until the next tick: however fast a wheel turns, and however
 * noisy a loose wire is, a wheel interrupts once a millisecond at most. Later edges of the same tick would
 * add nothing: speed is worked out over many ticks, and between two dated edges the counter has missed none.
 */
#include "encoders.h"

#include "cortex.h"
#include "pins.h"
#include "registers.h"

enum { PIN_FUNCTION_TIM3_TIM4 = 2, TIMEBASE_HZ = 1000000 };

/* A level must hold for eight samples at 84 MHz / 4 / 8, that is 3.05 us, before it counts (RM0090 section
 * 18.4.7). Edges of the bridges couple pulses of about a microsecond into encoder wires. The fastest encoder
 * this passes gives 650 000 counts a second. */
enum { FILTER = 9 };

/* An edge interrupts at once but counts only behind the filter. A counter that is read this long after the
 * watch began holds every edge from before it: an edge dated after that reading is the first beyond its
 * count. The tick's own work takes longer; the loop covers the case that it does not, and its limit the case
 * that TIM2 does not count. */
enum { SETTLE_US = 5, SETTLE_LIMIT = 300 };

#define LEFT_LINES  (3u << 4) /* PB4, PB5 */
#define RIGHT_LINES (3u << 6) /* PB6, PB7 */

static struct timer *const timers[HAL_WHEELS] = {TIM3, TIM4};
static const uint32_t lines[HAL_WHEELS] = {LEFT_LINES, RIGHT_LINES};
static uint16_t last[HAL_WHEELS];
static uint32_t total[HAL_WHEELS]; /* unsigned: it wraps */
static uint32_t watched_us;        /* when the watch began */
static uint32_t read_us;           /* when the counters were read */

/* Written by the interrupt while its lines are open, by the tick while they are closed. */
struct stamp {
    volatile bool taken;
    volatile uint32_t us;
};
static struct stamp stamps[HAL_WHEELS];
static bool unclear[HAL_WHEELS]; /* which count the edge left */
static uint32_t settled[HAL_WHEELS];
static bool dated[HAL_WHEELS];
static uint32_t dated_us[HAL_WHEELS];
static uint32_t dated_from[HAL_WHEELS];

static void start_timebase(uint32_t timer_apb1_hz)
{
    TIM2->psc = timer_apb1_hz / TIMEBASE_HZ - 1u;
    TIM2->arr = UINT32_MAX;
    TIM2->egr = TIM_EGR_UG;
    TIM2->cr1 = TIM_CR1_CEN;
}

static void start_edges(void)
{
    SYSCFG_EXTICR2 = SYSCFG_EXTICR_PORT_B(4u) | SYSCFG_EXTICR_PORT_B(5u) | SYSCFG_EXTICR_PORT_B(6u) |
                     SYSCFG_EXTICR_PORT_B(7u);
    EXTI->imr = 0;
    EXTI->rtsr = LEFT_LINES | RIGHT_LINES;
    EXTI->ftsr = LEFT_LINES | RIGHT_LINES;
    NVIC_IPR(IRQ_EXTI4) = PRIORITY_EDGE;
    NVIC_IPR(IRQ_EXTI9_5) = PRIORITY_EDGE;
    NVIC_ISER(0) = 1u << IRQ_EXTI4 | 1u << IRQ_EXTI9_5;
}

void encoders_start(uint32_t timer_apb1_hz)
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
        /* Pull-ups serve encoders with open collectors, and hold the lines of an absent one. */
        pin_to_peripheral(GPIOB, 4u + 2u * wheel, PIN_FUNCTION_TIM3_TIM4, PULL_UP);
        pin_to_peripheral(GPIOB, 5u + 2u * wheel, PIN_FUNCTION_TIM3_TIM4, PULL_UP);
        last[wheel] = (uint16_t)timer->cnt;
        total[wheel] = 0;
        unclear[wheel] = true;
    }
    start_timebase(timer_apb1_hz);
    start_edges();
}

/* One handler for all lines: the left wheel's lie on two vectors, one of them shared with the right wheel's.
 */
static void date_edges(void)
{
    const uint32_t now_us = TIM2->cnt;
    const uint32_t open = EXTI->imr;
    const uint32_t pending = EXTI->pr & open;
    uint32_t close = 0;
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        if ((pending & lines[wheel]) != 0) {
            stamps[wheel].us = now_us;
            stamps[wheel].taken = true;
            close |= lines[wheel];
        }
    }
    EXTI->imr = open & ~close;
}

void EXTI4_Handler(void)
{
    date_edges();
}

void EXTI9_5_Handler(void)
{
    date_edges();
}

static void count(void)
{
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        const uint16_t now = (uint16_t)timers[wheel]->cnt;
        const int16_t moved = (int16_t)(uint16_t)(now - last[wheel]);
        last[wheel] = now;
        total[wheel] += (uint32_t)moved;
    }
}

void encoders_update(void)
{
    EXTI->imr &= ~(LEFT_LINES | RIGHT_LINES);
    cpu_barrier(); /* no stamp is taken beyond this point */
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        dated[wheel] = stamps[wheel].taken && !unclear[wheel];
        dated_us[wheel] = stamps[wheel].us;
        dated_from[wheel] = settled[wheel];
        stamps[wheel].taken = false;
    }
    count();
    read_us = TIM2->cnt;
    watched_us = read_us;
    EXTI->pr = LEFT_LINES | RIGHT_LINES; /* ones clear */
    EXTI->imr |= LEFT_LINES | RIGHT_LINES;
}

void encoders_settle(void)
{
    for (uint32_t i = 0; i < SETTLE_LIMIT && TIM2->cnt - watched_us < SETTLE_US; i++) {
    }
    /* Kept separate from the tick's own counts, which the sample already holds. */
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        const uint16_t now = (uint16_t)timers[wheel]->cnt;
        const int16_t moved = (int16_t)(uint16_t)(now - last[wheel]);
        /* An edge that is already dated has moved the counter, or will. */
        const bool early = stamps[wheel].taken;
        settled[wheel] = early ? total[wheel] : total[wheel] + (uint32_t)moved;
        unclear[wheel] = early && (moved > 1 || moved < -1);
    }
}

uint32_t encoders_now_us(void)
{
    return TIM2->cnt;
}

void encoders_read(struct hal_sample *out)
{
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        out->counts[wheel] = (int32_t)total[wheel];
        out->edge_dated[wheel] = dated[wheel];
        out->edge_us[wheel] = dated_us[wheel];
        out->edge_from[wheel] = (int32_t)dated_from[wheel];
    }
    out->now_us = read_us;
}
