/* The two slots for an image of the firmware: what an image begins with, and which one a start runs.
 *
 * An image begins with a header of 512 bytes. Its first part is made with the image, the rest stays erased in
 * an update's file and is written on the board, each of its words once and for one step:
 *
 *   sequence -> commit   the image is whole; from here on a start may run it
 *   trial, three times   a start runs it on trial
 *   confirmed            a host has greeted it: it stays
 *   rejected             every trial has passed without: never again
 *
 * A slot is retired (commit to 0) before it is erased. The loader and the controller share this file. */
#ifndef IMAGE_SLOT_H
#define IMAGE_SLOT_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"

#define IMAGE_MAGIC     0x474D4954u /* "TIMG" */
#define IMAGE_COMMIT    0x5AA5C33Cu
#define IMAGE_CONFIRMED 0x3CC3A55Au
#define IMAGE_ERASED    0xFFFFFFFFu

enum {
    IMAGE_FORMAT = 1,
    IMAGE_HEADER_SIZE = 512, /* vectors follow it, which lie at a multiple of that (PM0214 section 4.4.4) */
    IMAGE_NAME_SIZE = 40,
    IMAGE_TRIALS = 3,
    IMAGE_NONE = 0xFF /* no slot */
};

/* Made with the image. */
struct image_header {
    uint32_t magic;
    uint32_t format;
    uint32_t slot;              /* the image is linked for this one */
    uint32_t size;              /* bytes, header included */
    uint32_t content_crc;       /* CRC-32 of what follows the header */
    char name[IMAGE_NAME_SIZE]; /* what its board's images are called, a space, its version; zeros */
    uint32_t header_crc;        /* CRC-32 of all above */
};

/* Written on the board, at IMAGE_MARKS_AT. */
struct image_marks {
    uint32_t sequence;
    uint32_t commit;
    uint32_t trial[IMAGE_TRIALS];
    uint32_t confirmed;
    uint32_t rejected;
};

enum { IMAGE_MARKS_AT = IMAGE_HEADER_SIZE - 32 };

struct image_slot {
    struct image_header header;
    struct image_marks marks;
    uint8_t state; /* enum proto_image_state */
};

/* What is wrong with a header for that slot: enum proto_image_defect, or IMAGE_NONE. */
uint8_t image_header_defect(const struct image_header *header, uint32_t slot);

/* Whether two names are of images for one board. */
bool image_is_for(const struct image_header *header, const char *name);

void image_slot_read(uint32_t slot, struct image_slot *out);

/* Whether what follows the header is what it was when the image was made. */
bool image_slot_is_whole(uint32_t slot, const struct image_header *header);

/* The slot that this start runs, IMAGE_NONE: there is none. `name` is that of an image for this board. */
uint32_t image_slot_choose(const char *name);

/* The steps; false: the memory did not take it. */
bool image_slot_commit(uint32_t slot, uint32_t sequence);
bool image_slot_confirm(uint32_t slot);
bool image_slot_retire(uint32_t slot);

#endif
