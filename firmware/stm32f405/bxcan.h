/* Moves frames between CAN1 and two queues, by interrupt; rejoins the bus after it had to leave it. */
#ifndef BXCAN_H
#define BXCAN_H

#include <stdbool.h>
#include <stdint.h>

/* Prepares pins and interrupts; hal_can_start joins the bus, unless the clock is too inexact for one. */
void bxcan_prepare(uint32_t bus_hz, bool exact);

/* Every millisecond, from the tick: recovery from bus-off, and discards frames without acknowledgment. */
void bxcan_tick(void);

/* Whether hal_can_peek would show a frame. */
bool bxcan_has_unheard(void);

/* Whether the main loop has work: frames wait to be read, or there is room for more to be sent. */
bool bxcan_take_call(void);

void CAN1_TX_Handler(void);
void CAN1_RX0_Handler(void);
void CAN1_SCE_Handler(void);

#endif
