/* Battery voltage through a divider on ADC1, without ever waiting for a conversion. */
#ifndef BATTERY_H
#define BATTERY_H

#include <stdbool.h>
#include <stdint.h>

void battery_start(void);

/* Takes a finished conversion and starts the next one; call every millisecond. */
void battery_update(void);

/* Last finished conversion; false if none finished within the last 100 ms. */
bool battery_read(uint16_t *millivolts);

#endif
