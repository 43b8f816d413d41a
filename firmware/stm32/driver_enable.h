/* The enable pin of the motor drivers: active only while the board allows them to drive or brake. */
#ifndef DRIVER_ENABLE_H
#define DRIVER_ENABLE_H

#include <stdbool.h>
#include <stdint.h>

#include "wiring.h"

/* The pin's bits in CCER and CR2 of its timer, for a bridge that shares that timer; zero in any other. */
#define ENABLE_INDEX (BOARD_ENABLE_CHANNEL - 1u)
#define ENABLE_CCER_IN(timer)                                                                                \
    ((timer) != BOARD_ENABLE_TIMER                                                                           \
         ? 0u                                                                                                \
         : TIM_CCER_ENABLE(ENABLE_INDEX) |                                                                   \
               (DRIVER_ENABLE_ACTIVE_LOW != 0 ? TIM_CCER_INVERT(ENABLE_INDEX) : 0u))
#define ENABLE_CR2_IN(timer)                                                                                 \
    ((timer) != BOARD_ENABLE_TIMER || DRIVER_ENABLE_ACTIVE_LOW == 0 ? 0u : TIM_CR2_OIS(ENABLE_INDEX))

/* From here on the pin holds its inactive level. */
void driver_enable_start(void);

/* At once, from any interrupt, until hal_enable_driver says otherwise. */
void driver_enable_off(void);

/* Forgets that the emergency stop was open. */
void driver_enable_release(void);

#endif
