/* Requests from the host: each is checked, carried out or refused by name, and answered with one frame. */
#ifndef REQUESTS_H
#define REQUESTS_H

#include <stddef.h>
#include <stdint.h>

#include "controller.h"

/* The largest frame that answers this request. */
size_t requests_reply_size(uint8_t id);

/* Carries a request out and queues its reply. */
void requests_answer(struct controller *controller, const struct frame *request);

#endif
