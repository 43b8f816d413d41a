/* Whether the crystal that oscillates is the one that this image's clock tree is made for. */
#ifndef CRYSTAL_H
#define CRYSTAL_H

#include <stdbool.h>

/* The crystal runs, and everything else from the RC oscillator, undivided; SysTick counts. Takes 2 ms. */
bool crystal_is_right(void);

#endif
