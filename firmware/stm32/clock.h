/* The clock tree that start-up settles on. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdbool.h>
#include <stdint.h>

/* What everything runs from after a reset: the internal RC oscillator. */
#define CLOCK_RESET_HZ 16000000u

enum clock_source {
    CLOCK_CRYSTAL_PLL,  /* the board's crystal, at the chip's full speed */
    CLOCK_INTERNAL_PLL, /* the crystal is not there, or another: RC oscillator through the PLL */
    CLOCK_INTERNAL,     /* nor did the PLL: RC oscillator, 16 MHz */
};

struct clock {
    enum clock_source source;
    bool crystal_wrong;     /* it oscillates, at another frequency than the board's */
    uint32_t cpu_hz;        /* HCLK, and SysTick */
    uint32_t apb1_hz;       /* the serial port */
    uint32_t can_hz;        /* the CAN controller */
    uint32_t timer_apb1_hz; /* TIM2 to TIM4 */
    uint32_t timer_apb2_hz; /* TIM1 */
};

/* Brings the clocks up; takes 65 ms at most, and always returns with one that runs. */
void clock_start(struct clock *out);

/* The rest is the chip's, in its clock_tree.c. */

/* Clocks of all peripherals that this firmware uses. */
void clock_peripherals(void);

/* From reset's clock: the voltage that full speed needs. */
void clock_tree_prepare(void);

/* Flash and buses are slowed down before the CPU speeds up; false: flash does not take it. */
bool clock_tree_brace(void);

/* After the CPU has sped up. */
void clock_tree_settle(void);

#endif
