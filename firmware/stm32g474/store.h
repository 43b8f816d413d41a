/* The store that outlives power. */
#ifndef STORE_H
#define STORE_H

#include <stdbool.h>

/* A parameter is being read, which may hold two wrong bits. The NMI asks this, and not
 * the flash where it found them: a reset within a write may leave that wrong. */
extern volatile bool store_reads;

#endif
