/* A board with an STM32F405 in LQFP64 whose USB pins are free: right bridge on TIM8, crystal of 12 MHz. */
#ifndef F405_USB_H
#define F405_USB_H

#define BOARD_NAME  "stm32f405-usb"
#define BOARD_IMAGE "truing-f405-usb"

#define BOARD_CRYSTAL_HZ 12000000u

#define BOARD_DRIVER        DRIVER_IN_IN
#define BOARD_LEFT_TIMER    1u
#define BOARD_LEFT_CHANNEL  1u
#define BOARD_LEFT_PIN_1    PA(8)
#define BOARD_LEFT_PIN_2    PA(9)
#define BOARD_RIGHT_TIMER   8u
#define BOARD_RIGHT_CHANNEL 1u
#define BOARD_RIGHT_PIN_1   PC(6)
#define BOARD_RIGHT_PIN_2   PC(7)
/* The right bridge's timer: its break takes this pin away together with that bridge. */
#define BOARD_ENABLE_TIMER   8u
#define BOARD_ENABLE_CHANNEL 3u
#define BOARD_ENABLE_PIN     PC(8)

#define BOARD_TIM1_BREAK_PIN PB(12)
#define BOARD_TIM8_BREAK_PIN PA(6) /* never open here: each holds one bridge */

#define BOARD_LEFT_ENCODER_TIMER  4u
#define BOARD_LEFT_ENCODER_A      PB(6)
#define BOARD_LEFT_ENCODER_B      PB(7)
#define BOARD_RIGHT_ENCODER_TIMER 3u
#define BOARD_RIGHT_ENCODER_A     PB(4)
#define BOARD_RIGHT_ENCODER_B     PB(5)

#define BOARD_BATTERY_PIN       PC(0)
#define BOARD_REFERENCE_MV      3300u
#define BOARD_DIVIDER_UPPER_OHM 15000u
#define BOARD_DIVIDER_LOWER_OHM 1500u

#define BOARD_SERIAL_TX PC(10)
#define BOARD_SERIAL_RX PC(11)
#define BOARD_CAN_RX    PB(8)
#define BOARD_CAN_TX    PB(9)
#define BOARD_LED       PC(13)

/* USB: ID, D-, D+. */
#define BOARD_FREE_PINS (PIN_BIT(PA(10)) | PIN_BIT(PA(11)) | PIN_BIT(PA(12)))

#endif
