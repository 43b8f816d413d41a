/* The chip's CAN controller, as main.c and can_queue.c see it. */
#ifndef CAN_PORT_H
#define CAN_PORT_H

#include <stdbool.h>
#include <stdint.h>

/* Prepares pins and interrupts; hal_can_start joins the bus, unless the clock is too inexact for one. */
void can_prepare(uint32_t controller_hz, bool exact);

/* Every millisecond, from the tick: recovery from bus-off, and discards frames without acknowledgment. */
void can_tick(void);

/* Whether the controller is on the bus. */
bool can_joined(void);

/* Gives the controller the frames that wait, as far as it takes them. The caller holds CAN's interrupts off,
 * or is one. */
void can_feed(void);

/* can_queue.c: whether hal_can_peek would show a frame. */
bool can_has_unheard(void);

/* can_queue.c: whether the main loop has work: frames wait to be read, or there is room for more to be sent.
 */
bool can_take_call(void);

#endif
