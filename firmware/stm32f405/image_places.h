/* Where the two slots for an image lie in flash (RM0090 table 5); stm32f405.ld says the same. */
#ifndef IMAGE_PLACES_H
#define IMAGE_PLACES_H

#define IMAGE_PLACE_0    0x0800C000u /* sector 3, of 16 KiB, and sector 4, of 64 */
#define IMAGE_PLACE_1    0x08020000u /* the first 80 KiB of sector 5, of 128 */
#define IMAGE_PLACE_SIZE 0x14000u

#endif
