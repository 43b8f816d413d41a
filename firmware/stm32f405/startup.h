/* The way from reset to main. */
#ifndef STARTUP_H
#define STARTUP_H

#include <stdint.h>

_Noreturn void Reset_Handler(void);

/* Bytes of stack that have been in use since reset, at the deepest. */
uint32_t stack_high_water(void);

#endif
