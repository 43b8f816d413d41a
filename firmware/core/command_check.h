/* Which commands the wheels may be given. */
#ifndef COMMAND_CHECK_H
#define COMMAND_CHECK_H

#include <stdint.h>

#include "refusal.h"
#include "tuning.h"

/* The wheel command behind a segment or a live command: a mode of the drive and one number per wheel. */
struct wheel_command {
    uint8_t mode; /* enum proto_mode */
    float left;
    float right;
};

/* Turns the two numbers of a `kind` (enum proto_segment_kind) into wheel commands and checks them against the
 * limits. A refusal's detail is the number's position, 0 or 1. */
struct refusal command_check(const struct tuning *tuning, uint8_t kind, float a, float b,
                             struct wheel_command *out);

#endif
