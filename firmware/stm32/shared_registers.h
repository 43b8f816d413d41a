/* Registers of the peripherals that the STM32 families of this firmware have alike: their layout and their
 * bits. Where they lie says each chip's registers.h.
 *
 * Sections are those of RM0090 (STM32F405). RM0440 (STM32G474) has the same in its chapters of the same
 * names. */
#ifndef SHARED_REGISTERS_H
#define SHARED_REGISTERS_H

#include "cortex_registers.h"

/* General-purpose pins, RM0090 section 8.4. */
struct gpio {
    reg32 moder;
    reg32 otyper;
    reg32 ospeedr;
    reg32 pupdr;
    reg32 idr;
    reg32 odr;
    reg32 bsrr;
    reg32 lckr;
    reg32 afr[2];
};

/* External interrupts, RM0090 section 12.3: one bit for each of the first 32 lines. */
struct exti {
    reg32 imr;
    reg32 emr;
    reg32 rtsr;
    reg32 ftsr;
    reg32 swier;
    reg32 pr;
};

/* Timers, RM0090 sections 17.4, 18.4 and 19.5. Those without a break lack RCR and BDTR; TIM2 has 32 bits.
 * From 0x48 on the families differ. */
struct timer {
    reg32 cr1;
    reg32 cr2;
    reg32 smcr;
    reg32 dier;
    reg32 sr;
    reg32 egr;
    reg32 ccmr1;
    reg32 ccmr2;
    reg32 ccer;
    reg32 cnt;
    reg32 psc;
    reg32 arr;
    reg32 rcr;
    reg32 ccr[4];
    reg32 bdtr;
    reg32 reserved_48[2];
    reg32 option; /* STM32F405: TIM11 */
    reg32 reserved_54[2];
    reg32 tisel; /* STM32G474: where a channel's input comes from */
    reg32 af1;   /* STM32G474, TIM1 and TIM8: where a break comes from */
};
_Static_assert(sizeof(struct timer) == 0x64, "TIMx_AF1 lies at 0x60");
#define TIM_CR1_CEN         (1u << 0)
#define TIM_CR1_ARPE        (1u << 7)
#define TIM_CR1_CKD_DIV4    (2u << 8)
#define TIM_CR2_OIS(ch)     (1u << (8u + 2u * (ch))) /* idle level of channel 0..3 */
#define TIM_SMCR_ENCODER_X4 3u
#define TIM_EGR_UG          (1u << 0)
#define TIM_CCMR_PWM1       (6u << 4) /* low byte of CCMR1/2; the high byte is the next channel */
#define TIM_CCMR_ACTIVE     (5u << 4)
#define TIM_CCMR_INACTIVE   (4u << 4)
#define TIM_CC_FLAG(ch)     (2u << (ch)) /* CCxIF in SR, CCxIE in DIER, of channel 0..3 */
#define TIM_CCMR_PRELOAD    (1u << 3)
#define TIM_CCMR_INPUT      (1u << 0) /* channel is an input from its own pin */
#define TIM_CCMR_FILTER(f)  ((uint32_t)(f) << 4)
#define TIM_CCER_ENABLE(ch) (1u << (4u * (ch)))
#define TIM_CCER_INVERT(ch) (2u << (4u * (ch)))
#define TIM_BDTR_OSSI       (1u << 10)
#define TIM_BDTR_BKE        (1u << 12)
#define TIM_BDTR_BKP        (1u << 13) /* a break while the input is high */
#define TIM_BDTR_MOE        (1u << 15)
#define TIM_CCMR_EACH_8     (3u << 2) /* each eighth edge is captured */
#define TIM_SR_CC1IF        (1u << 1)
#define TIM_SR_CC1OF        (1u << 9) /* a capture came while the last one was not read */
#define TIM_SR_BIF          (1u << 7) /* there was a break; cleared by writing 0 once the input is quiet */

/* Random number generator, RM0090 section 24.4. */
#define RNG_CR_RNGEN (1u << 2)
#define RNG_SR_DRDY  (1u << 0)
#define RNG_SR_CECS  (1u << 1)
#define RNG_SR_SECS  (1u << 2)

/* Independent watchdog, RM0090 section 21.4. */
struct iwdg {
    reg32 kr;
    reg32 pr;
    reg32 rlr;
    reg32 sr;
};
#define IWDG_KEY_RELOAD 0xAAAAu
#define IWDG_KEY_ACCESS 0x5555u
#define IWDG_KEY_START  0xCCCCu
#define IWDG_PR_DIV4    0u
#define IWDG_PR_DIV32   3u
#define IWDG_SR_PVU     (1u << 0) /* a new prescaler is under way */
#define IWDG_SR_RVU     (1u << 1) /* a new reload value is under way */

#endif
