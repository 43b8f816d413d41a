/* ST NUCLEO-G474RE (STM32G474RET6, LQFP64) with two H-bridges with IN/IN inputs. */
#ifndef NUCLEO_G474RE_H
#define NUCLEO_G474RE_H

#define BOARD_NAME   "stm32g474"   /* in HELLO; 15 characters at most */
#define BOARD_IMAGE  "truing-g474" /* what the image is called, and carries behind its vectors */
#define BOARD_DRIVER DRIVER_IN_IN

#define BOARD_CRYSTAL_HZ 24000000u

/* Two channels of one timer for each bridge, the first of them 1 or 3. */
#define BOARD_LEFT_TIMER     1u
#define BOARD_LEFT_CHANNEL   1u
#define BOARD_LEFT_PIN_1     PC(0)
#define BOARD_LEFT_PIN_2     PC(1)
#define BOARD_RIGHT_TIMER    1u
#define BOARD_RIGHT_CHANNEL  3u
#define BOARD_RIGHT_PIN_1    PC(2)
#define BOARD_RIGHT_PIN_2    PC(3)
#define BOARD_ENABLE_TIMER   8u
#define BOARD_ENABLE_CHANNEL 3u
#define BOARD_ENABLE_PIN     PC(8)

/* The emergency stop's contact is wired to both. */
#define BOARD_TIM1_BREAK_PIN PB(12)
#define BOARD_TIM8_BREAK_PIN PA(6)

#define BOARD_LEFT_ENCODER_TIMER  3u
#define BOARD_LEFT_ENCODER_A      PC(6)
#define BOARD_LEFT_ENCODER_B      PC(7)
#define BOARD_RIGHT_ENCODER_TIMER 4u
#define BOARD_RIGHT_ENCODER_A     PB(6)
#define BOARD_RIGHT_ENCODER_B     PB(7)

#define BOARD_BATTERY_PIN       PA(0)
#define BOARD_REFERENCE_MV      3300u /* of the converter: the board's own supply */
#define BOARD_DIVIDER_UPPER_OHM 10000u
#define BOARD_DIVIDER_LOWER_OHM 1000u

#define BOARD_SERIAL_TX PA(2) /* to the ST-LINK's virtual COM port */
#define BOARD_SERIAL_RX PA(3)
#define BOARD_CAN_RX    PA(11)
#define BOARD_CAN_TX    PA(12)
#define BOARD_LED       PA(5) /* LD2 */

/* Pins that nothing of the above may take: BOOT0, the user's button. */
#define BOARD_FREE_PINS (PIN_BIT(PB(8)) | PIN_BIT(PC(13)))

#endif
