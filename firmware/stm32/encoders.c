/* Counts quadrature edges in hardware, extends the counts to 32 bits, and dates one edge per wheel and tick.
 *
 * In encoder mode a timer captures counts, not time, and its captures see rising edges alone (RM0090
 * section 18.4.9: both edges of an input "must not be used for encoder mode"). But compare matches work as
 * usual (section 18.3.12): so channels 3 and 4, which have no pin here, wait for the counts above and below
 * that of the tick, and the match interrupts. It comes with whichever of the four edges of a period is the
 * next, and with none that the inputs' filters have not passed, since it compares the counter. What is read
 * then is the time of TIM2.
 *
 * That edge silences its wheel until the next tick: however fast a wheel turns, and whatever a loose wire
 * does, a wheel interrupts once a millisecond at most. Later edges of the same tick would add nothing: speed
 * is worked out over many ticks, and between two dated edges the counter has missed none. */
#include "encoders.h"

#include "cortex.h"
#include "pins.h"
#include "registers.h"

enum { TIMEBASE_HZ = 1000000 };

/* A level must hold for ENCODER_FILTER, 3 us, before it counts (RM0090 section 18.4.7). Edges of the bridges
 * couple pulses of about a microsecond into encoder wires. The fastest encoder this passes gives 650 000
 * counts a second. All edges are dated later by this much, which no difference shows. */

/* Channels that wait for the next count in each direction, from 0. */
#define ABOVE   2u
#define BELOW   3u
#define MATCHES (TIM_CC_FLAG(ABOVE) | TIM_CC_FLAG(BELOW))

#define LEFT_TIMER  TIMER(BOARD_LEFT_ENCODER_TIMER)
#define RIGHT_TIMER TIMER(BOARD_RIGHT_ENCODER_TIMER)

static struct timer *const timers[HAL_WHEELS] = {LEFT_TIMER, RIGHT_TIMER};
static uint16_t last[HAL_WHEELS];
static uint32_t total[HAL_WHEELS]; /* unsigned: it wraps */
static uint32_t read_us;           /* when the counters were read */

/* The first edge beyond `last`. Written by the interrupt while its wheel is watched, by the tick before. */
struct stamp {
    volatile int8_t direction; /* 0: none yet */
    volatile uint32_t us;
};
static struct stamp stamps[HAL_WHEELS];

/* What the tick makes of it. */
struct dated_edge {
    bool dated;
    uint32_t us;
    uint32_t from;
    uint32_t strays; /* stamps without a count, since start-up */
};
static struct dated_edge edges[HAL_WHEELS];

static void start_timebase(uint32_t timer_apb1_hz)
{
    TIM2->psc = timer_apb1_hz / TIMEBASE_HZ - 1u;
    TIM2->arr = UINT32_MAX;
    TIM2->egr = TIM_EGR_UG;
    TIM2->cr1 = TIM_CR1_CEN;
}

void encoders_start(uint32_t timer_apb1_hz)
{
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        struct timer *const timer = timers[wheel];
        timer->cr1 = TIM_CR1_CKD_DIV4;
        timer->ccmr1 = (TIM_CCMR_INPUT | TIM_CCMR_FILTER(ENCODER_FILTER)) * 0x0101u;
        timer->ccmr2 = 0; /* outputs that do nothing but match */
        timer->ccer = 0;  /* rising edges, not inverted */
        timer->smcr = TIM_SMCR_ENCODER_X4;
        timer->psc = 0;
        timer->arr = 0xFFFFu;
        timer->egr = TIM_EGR_UG;
        timer->cr1 = TIM_CR1_CKD_DIV4 | TIM_CR1_CEN;
        /* Pull-ups serve encoders with open collectors, and hold the lines of an absent one. */
        pin_to_peripheral(wheel == 0u ? BOARD_LEFT_ENCODER_A : BOARD_RIGHT_ENCODER_A, FUNCTION_OF_ENCODER,
                          PULL_UP);
        pin_to_peripheral(wheel == 0u ? BOARD_LEFT_ENCODER_B : BOARD_RIGHT_ENCODER_B, FUNCTION_OF_ENCODER,
                          PULL_UP);
        last[wheel] = (uint16_t)timer->cnt;
        total[wheel] = 0;
    }
    start_timebase(timer_apb1_hz);
    NVIC_IPR(IRQ_TIM3) = PRIORITY_EDGE;
    NVIC_IPR(IRQ_TIM4) = PRIORITY_EDGE;
    NVIC_ISER(0) = 1u << IRQ_TIM3 | 1u << IRQ_TIM4;
}

/* The edge above or below the tick's count came at this time. From here on the other channel waits for the
 * way back, and needs no interrupt for it: noise that outlasts the filters goes to and fro. */
static void stamp(uint32_t wheel, bool above, uint32_t us)
{
    struct timer *const timer = timers[wheel];
    const uint32_t back = above ? BELOW : ABOVE;
    timer->ccr[back] = last[wheel];
    timer->sr = ~TIM_CC_FLAG(back); /* zeros clear */
    stamps[wheel].us = us;
    stamps[wheel].direction = above ? (int8_t)1 : (int8_t)-1;
}

static void date_edge(uint32_t wheel)
{
    const uint32_t now_us = TIM2->cnt;
    timers[wheel]->dier = 0;
    /* Read after that was written, so that the request is gone before the interrupt returns. */
    stamp(wheel, (timers[wheel]->sr & TIM_CC_FLAG(ABOVE)) != 0, now_us);
}

void TIM3_Handler(void)
{
    date_edge(BOARD_LEFT_ENCODER_TIMER == 3u ? 0u : 1u);
}

void TIM4_Handler(void)
{
    date_edge(BOARD_LEFT_ENCODER_TIMER == 4u ? 0u : 1u);
}

/* Waits for the first count beyond `last`. */
static void watch(uint32_t wheel)
{
    struct timer *const timer = timers[wheel];
    stamps[wheel].direction = 0;
    timer->ccr[ABOVE] = (last[wheel] + 1u) & 0xFFFFu;
    timer->ccr[BELOW] = (last[wheel] - 1u) & 0xFFFFu;
    timer->sr = ~MATCHES; /* zeros clear */
    const int16_t moved = (int16_t)(uint16_t)(timer->cnt - last[wheel]);
    if (moved == 0) {
        timer->dier = MATCHES; /* the enabling bits lie where the flags do */
    } else { /* it came since the counter was read, a microsecond ago, and may match no more */
        stamp(wheel, moved > 0, TIM2->cnt);
    }
}

/* A stamp dates an edge if the wheel has moved in its direction since, and has not been back in between. */
static void take(uint32_t wheel, uint16_t now)
{
    struct dated_edge *const edge = &edges[wheel];
    const int16_t moved = (int16_t)(uint16_t)(now - last[wheel]);
    const int8_t direction = stamps[wheel].direction;
    const uint32_t back = TIM_CC_FLAG(direction > 0 ? BELOW : ABOVE);
    const bool stays = (timers[wheel]->sr & back) == 0;
    edge->dated = stays && ((direction > 0 && moved > 0) || (direction < 0 && moved < 0));
    edge->us = stamps[wheel].us;
    edge->from = total[wheel];
    if (direction != 0 && !edge->dated) {
        edge->strays++;
    }
    last[wheel] = now;
    total[wheel] += (uint32_t)moved;
}

void encoders_update(void)
{
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        timers[wheel]->dier = 0;
    }
    cpu_barrier(); /* no stamp is taken beyond this point */
    const uint16_t counts[HAL_WHEELS] = {(uint16_t)LEFT_TIMER->cnt, (uint16_t)RIGHT_TIMER->cnt};
    read_us = TIM2->cnt;
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        take(wheel, counts[wheel]);
    }
    for (uint32_t wheel = 0; wheel < HAL_WHEELS; wheel++) {
        watch(wheel);
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
        out->edge_dated[wheel] = edges[wheel].dated;
        out->edge_us[wheel] = edges[wheel].us;
        out->edge_from[wheel] = (int32_t)edges[wheel].from;
        out->stray_edges[wheel] = edges[wheel].strays;
    }
    out->now_us = read_us;
}
