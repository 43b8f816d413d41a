/* Olimex STM32-H405 (STM32F405RGT6, LQFP64) with two H-bridges with IN/IN inputs. */
#ifndef OLIMEX_H405_H
#define OLIMEX_H405_H

/* The same board with other drivers has a header of its own, which names it and includes this one. */
#ifndef BOARD_NAME
#define BOARD_NAME   "stm32f405"   /* in HELLO; 15 characters at most */
#define BOARD_IMAGE  "truing-f405" /* what the image is called, and carries behind its vectors */
#define BOARD_DRIVER DRIVER_IN_IN
#endif

#define BOARD_CRYSTAL_HZ 8000000u

/* Two channels of one timer for each bridge, the first of them 1 or 3. */
#define BOARD_LEFT_TIMER     1u
#define BOARD_LEFT_CHANNEL   1u
#define BOARD_LEFT_PIN_1     PA(8)
#define BOARD_LEFT_PIN_2     PA(9)
#define BOARD_RIGHT_TIMER    1u
#define BOARD_RIGHT_CHANNEL  3u
#define BOARD_RIGHT_PIN_1    PA(10)
#define BOARD_RIGHT_PIN_2    PA(11) /* also D- of the board's USB socket */
#define BOARD_ENABLE_TIMER   8u
#define BOARD_ENABLE_CHANNEL 1u
#define BOARD_ENABLE_PIN     PC(6)

/* The emergency stop's contact is wired to both. */
#define BOARD_TIM1_BREAK_PIN PB(12)
#define BOARD_TIM8_BREAK_PIN PA(6)

#define BOARD_LEFT_ENCODER_TIMER  3u
#define BOARD_LEFT_ENCODER_A      PB(4)
#define BOARD_LEFT_ENCODER_B      PB(5)
#define BOARD_RIGHT_ENCODER_TIMER 4u
#define BOARD_RIGHT_ENCODER_A     PB(6)
#define BOARD_RIGHT_ENCODER_B     PB(7)

#define BOARD_BATTERY_PIN       PA(4)
#define BOARD_REFERENCE_MV      3300u /* of the converter: the board's own supply */
#define BOARD_DIVIDER_UPPER_OHM 10000u
#define BOARD_DIVIDER_LOWER_OHM 1000u

#define BOARD_SERIAL_TX PB(10)
#define BOARD_SERIAL_RX PB(11)
#define BOARD_CAN_RX    PB(8)
#define BOARD_CAN_TX    PB(9)
#define BOARD_LED       PC(12)

/* Pins that nothing of the above may take. */
#define BOARD_FREE_PINS NO_PINS

#endif
