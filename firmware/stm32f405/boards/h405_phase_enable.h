/* Olimex STM32-H405 with drivers that take enable and phase (DRV8838, DRV8876 class). */
#ifndef H405_PHASE_ENABLE_H
#define H405_PHASE_ENABLE_H

#define BOARD_NAME   "stm32f405-phase"
#define BOARD_IMAGE  "truing-f405-phase"
#define BOARD_DRIVER DRIVER_PHASE_ENABLE
#include "olimex_h405.h"

#endif
