/* ADC1, for conversions of the battery divider one by one. */
#ifndef ADC_PORT_H
#define ADC_PORT_H

#include <stdbool.h>
#include <stdint.h>

#include "registers.h"
#include "wiring.h"

/* Inputs of ADC1: PA0 to PA3, PB0, PB1, PC0 to PC3. */
#define ADC_CHANNEL                                                                                          \
    (BOARD_BATTERY_PIN < PB(0)    ? 1u + BOARD_BATTERY_PIN                                                   \
     : BOARD_BATTERY_PIN == PB(0) ? 15u                                                                      \
     : BOARD_BATTERY_PIN == PB(1) ? 12u                                                                      \
                                  : 6u + BOARD_BATTERY_PIN - PC(0))

/* A conversion takes 653 ADC clocks, 15 us at 42.5 MHz. */
enum { CHANNELS_OF_SMPR1 = 10, SAMPLE_640_CYCLES = 7 };

/* Reads of a register at the least, of some cycles each: 20 us for the regulator, and a calibration of 116
 * ADC clocks, with its pause of 4 before the converter is enabled. */
enum { REGULATOR_READS = 4000, CALIBRATION_READS = 4000, PAUSE_READS = 16 };

static inline void adc_wait(uint32_t reads)
{
    for (uint32_t i = 0; i < reads; i++) {
        (void)ADC1->isr;
    }
}

/* Out of deep power-down, with its regulator on, calibrated. It is ready before the first tick, which asks
 * for the first conversion. */
static inline void adc_start(void)
{
    ADC_CCR = ADC_CCR_HCLK_DIV4; /* 42.5 MHz from 170 MHz; the limit is 60 MHz */
    ADC1->cr = 0;
    ADC1->cr = ADC_CR_ADVREGEN;
    adc_wait(REGULATOR_READS);
    ADC1->cr = ADC_CR_ADVREGEN | ADC_CR_ADCAL;
    for (uint32_t i = 0; i < CALIBRATION_READS && (ADC1->cr & ADC_CR_ADCAL) != 0; i++) {
    }
    adc_wait(PAUSE_READS);
    ADC1->cfgr = ADC_CFGR_OVRMOD; /* 12 bits, one conversion */
    if (ADC_CHANNEL < CHANNELS_OF_SMPR1) {
        ADC1->smpr1 = SAMPLE_640_CYCLES << (3u * (ADC_CHANNEL % CHANNELS_OF_SMPR1));
    } else {
        ADC1->smpr2 = SAMPLE_640_CYCLES << (3u * (ADC_CHANNEL % CHANNELS_OF_SMPR1));
    }
    ADC1->sqr1 = ADC_SQR1_FIRST(ADC_CHANNEL); /* a sequence of one */
    ADC1->isr = ADC_ISR_ADRDY;
    ADC1->cr = ADC_CR_ADVREGEN | ADC_CR_ADEN;
}

static inline bool adc_has_finished(void)
{
    return (ADC1->isr & ADC_ISR_EOC) != 0;
}

/* The conversion's 12 bits; reading them clears EOC. */
static inline uint32_t adc_take(void)
{
    return ADC1->dr & 0xFFFu;
}

/* Zeros leave the other requests of CR as they are. */
static inline void adc_convert(void)
{
    ADC1->cr = ADC_CR_ADVREGEN | ADC_CR_ADSTART;
}

#endif
