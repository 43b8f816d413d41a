/* The way from reset to main. */
#ifndef STARTUP_H
#define STARTUP_H

_Noreturn void Reset_Handler(void);

#endif
