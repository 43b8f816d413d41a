/* The enable pin of the motor drivers: active only while the board allows them to drive or brake. */
#ifndef DRIVER_ENABLE_H
#define DRIVER_ENABLE_H

#include <stdbool.h>

/* The level at which the drivers are on. The resistor at the pin pulls to the other one. */
#ifndef DRIVER_ENABLE_ACTIVE_LOW
#define DRIVER_ENABLE_ACTIVE_LOW 0
#endif

/* From here on the pin holds its inactive level. */
void driver_enable_start(void);

/* At once, from any interrupt, until hal_enable_driver says otherwise. */
void driver_enable_off(void);

/* Forgets that the emergency stop was open. */
void driver_enable_release(void);

#endif
