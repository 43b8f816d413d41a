/* Olimex STM32-H405 with drivers that take PWM and a direction (MD10C class). */
#ifndef H405_PWM_DIR_H
#define H405_PWM_DIR_H

#define BOARD_NAME   "stm32f405-pwm"
#define BOARD_IMAGE  "truing-f405-pwm"
#define BOARD_DRIVER DRIVER_PWM_DIR
#include "olimex_h405.h"

#endif
