/* One wheel: a first-order model with delay and dry friction that holds exactly. */
#ifndef TRUING_WHEEL_H
#define TRUING_WHEEL_H

#include <stdbool.h>

enum parameter {
    GAIN,
    TIME_CONSTANT,
    DELAY,
    FRICTION,
    BREAKAWAY_EXCESS,
    STRIBECK,
    STRIBECK_SHAPE,
    DRAG,
    OFFSET,
    REVERSE_GAIN,
    REVERSE_TIME_CONSTANT,
    REVERSE_FRICTION,
    REVERSE_EXCESS,
    LAG,
    DEADBAND,
    PARAMETERS,
};

enum { QUEUE = 4096 }; /* changes of effort on their way */

/* An effort on its way: it acts from `arrival` on. */
struct coming {
    double arrival_s;
    double effort;
};

struct wheel {
    double parameter[PARAMETERS];
    double input;  /* as last set */
    double effort; /* that acts now */
    double lagged; /* drive behind the lag */
    double speed_mps;
    double travel_m;
    struct coming queue[QUEUE]; /* ring, oldest first */
    unsigned first;
    unsigned count;
};

/* Run for a time under the effort in `input`; false: more changes of effort are on their way than QUEUE. */
bool wheel_step(struct wheel *wheel, double begin_s, double duration_s);

/* NULL, or what is wrong with the parameters. */
const char *wheel_problem(const struct wheel *wheel);

#endif
