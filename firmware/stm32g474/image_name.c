/* Identifies the image within its bytes, behind the vectors: `strings truing-g474.bin`. */
#include "wiring.h"

__attribute__((section(".image_name"), used)) static const char image_name[] = BOARD_IMAGE " " TRUING_VERSION;
