/* ADC1, for conversions of the battery divider one by one. */
#ifndef ADC_PORT_H
#define ADC_PORT_H

#include <stdbool.h>
#include <stdint.h>

#include "registers.h"
#include "wiring.h"

/* Inputs of ADC1: PA0 to PA7, PB0 and PB1, PC0 to PC5 (datasheet DocID022152, table 7). */
#define ADC_CHANNEL                                                                                          \
    (BOARD_BATTERY_PIN < PB(0)   ? BOARD_BATTERY_PIN                                                         \
     : BOARD_BATTERY_PIN < PC(0) ? 8u + BOARD_BATTERY_PIN - PB(0)                                            \
                                 : 10u + BOARD_BATTERY_PIN - PC(0))

/* A conversion takes 492 ADC clocks, 23 us at 21 MHz. */
enum { CHANNELS_OF_SMPR2 = 10, SAMPLE_480_CYCLES = 7 };

/* Takes 3 us before the first conversion, which the first tick gives it. */
static inline void adc_start(void)
{
    ADC_CCR = ADC_CCR_PCLK_DIV4; /* 21 MHz from 84 MHz; the limit is 36 MHz */
    ADC1->cr1 = 0;               /* 12 bits, one conversion */
    if (ADC_CHANNEL < CHANNELS_OF_SMPR2) {
        ADC1->smpr2 = SAMPLE_480_CYCLES << (3u * (ADC_CHANNEL % CHANNELS_OF_SMPR2));
    } else {
        ADC1->smpr1 = SAMPLE_480_CYCLES << (3u * (ADC_CHANNEL % CHANNELS_OF_SMPR2));
    }
    ADC1->sqr1 = 0; /* a sequence of one */
    ADC1->sqr3 = ADC_CHANNEL;
    ADC1->cr2 = ADC_CR2_ADON;
}

static inline bool adc_has_finished(void)
{
    return (ADC1->sr & ADC_SR_EOC) != 0;
}

/* The conversion's 12 bits; reading them clears EOC. */
static inline uint32_t adc_take(void)
{
    return ADC1->dr & 0xFFFu;
}

static inline void adc_convert(void)
{
    ADC1->cr2 = ADC_CR2_ADON | ADC_CR2_SWSTART;
}

#endif
