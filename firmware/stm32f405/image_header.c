/* What an image begins with: its name, which says its board, for the loader and for updates over the link.
 * `make_images.py` fills in the rest when the image has been linked. */
#include "image_slot.h"
#include "wiring.h"

_Static_assert(sizeof(BOARD_IMAGE " " TRUING_VERSION) <= IMAGE_NAME_SIZE, "the name fits the header");

__attribute__((section(".image_header"), used)) static const struct image_header image_header = {
    .magic = IMAGE_MAGIC,
    .format = IMAGE_FORMAT,
    .slot = IMAGE_ERASED,
    .size = IMAGE_ERASED,
    .content_crc = IMAGE_ERASED,
    .name = BOARD_IMAGE " " TRUING_VERSION,
    .header_crc = IMAGE_ERASED,
};
