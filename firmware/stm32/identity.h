/* Who the board is, and how it came to start. */
#ifndef IDENTITY_H
#define IDENTITY_H

#include "clock.h"

/* Collects what hal_identity reports; once, after the clocks are up. */
void identity_start(const struct clock *clock);

#endif
