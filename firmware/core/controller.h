/* The whole controller, for the target's main: one static struct, init once, tick every millisecond, poll for
 * ever. */
#ifndef CONTROLLER_H
#define CONTROLLER_H

#include "controller_state.h"

/* Before the tick interrupt is enabled. */
void controller_init(struct controller *controller);

/* Exactly every millisecond, from the tick interrupt. Constant work. Feeds the watchdog as long as the main
 * loop gets on. */
void controller_tick(struct controller *controller);

/* From the main loop, as often as possible. */
void controller_poll(struct controller *controller);

/* From the tick interrupt's handler, when the next tick was due before this one had ended. */
void controller_note_overrun(struct controller *controller);

#endif
