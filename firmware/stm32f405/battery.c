/* One conversion a millisecond of the battery divider (ADC1), started and fetched by the tick. */
#include "battery.h"

#include "pins.h"
#include "registers.h"

#define FULL_SCALE 4096u
#define FULL_SCALE_MV                                                                                        \
    (BOARD_REFERENCE_MV * (BOARD_DIVIDER_UPPER_OHM + BOARD_DIVIDER_LOWER_OHM) / BOARD_DIVIDER_LOWER_OHM)
_Static_assert(FULL_SCALE_MV <= UINT16_MAX, "millivolts of the supply are 16 bits wide on the link");

/* Inputs of ADC1: PA0 to PA7, PB0 and PB1, PC0 to PC5 (datasheet DocID022152, table 7). */
#define CHANNEL                                                                                              \
    (BOARD_BATTERY_PIN < PB(0)   ? BOARD_BATTERY_PIN                                                         \
     : BOARD_BATTERY_PIN < PC(0) ? 8u + BOARD_BATTERY_PIN - PB(0)                                            \
                                 : 10u + BOARD_BATTERY_PIN - PC(0))

/* A conversion takes 492 ADC clocks, 23 us at 21 MHz. One that has not ended by the fifth tick is started
 * anew. */
enum { CHANNELS_OF_SMPR2 = 10, SAMPLE_480_CYCLES = 7, RETRY_MS = 5, STALE_MS = 100 };

static uint32_t last_mv;
static uint32_t age_ms;     /* of last_mv */
static uint32_t pending_ms; /* since the conversion was started */

void battery_start(void)
{
    pin_to_analogue(BOARD_BATTERY_PIN);
    ADC_CCR = ADC_CCR_PCLK_DIV4; /* 21 MHz from 84 MHz; the limit is 36 MHz */
    ADC1->cr1 = 0;               /* 12 bits, one conversion */
    if (CHANNEL < CHANNELS_OF_SMPR2) {
        ADC1->smpr2 = SAMPLE_480_CYCLES << (3u * (CHANNEL % CHANNELS_OF_SMPR2));
    } else {
        ADC1->smpr1 = SAMPLE_480_CYCLES << (3u * (CHANNEL % CHANNELS_OF_SMPR2));
    }
    ADC1->sqr1 = 0; /* a sequence of one */
    ADC1->sqr3 = CHANNEL;
    ADC1->cr2 = ADC_CR2_ADON; /* needs 3 us before the first start, which the first tick gives it */
    last_mv = 0;
    age_ms = STALE_MS;
    pending_ms = RETRY_MS;
}

void battery_update(void)
{
    if (age_ms < STALE_MS) {
        age_ms++;
    }
    pending_ms++;
    if ((ADC1->sr & ADC_SR_EOC) != 0) {
        last_mv = (ADC1->dr & 0xFFFu) * FULL_SCALE_MV / FULL_SCALE; /* reading it clears EOC */
        age_ms = 0;
    } else if (pending_ms < RETRY_MS) {
        return;
    }
    ADC1->cr2 = ADC_CR2_ADON | ADC_CR2_SWSTART;
    pending_ms = 0;
}

bool battery_read(uint16_t *millivolts)
{
    *millivolts = (uint16_t)last_mv;
    return age_ms < STALE_MS;
}
