/* Requests from the host: each is checked, carried out or refused by name, and answered with one frame. */
#ifndef REQUESTS_H
#define REQUESTS_H

#include "controller_state.h"
#include "frame.h"

/* Carries a request out and queues its reply. A request that finds no room for its reply is dropped, as if
 * the line had lost it, and its sender retries; a stop is executed in any case. */
void requests_answer(struct controller *controller, enum controller_port port, const struct frame *request);

#endif
