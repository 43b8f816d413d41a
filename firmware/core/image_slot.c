/* The two slots for an image of the firmware: what an image begins with, and which one a start runs. */
#include "image_slot.h"

#include <stddef.h>

#include "crc32.h"
#include "proto.h"

_Static_assert(sizeof(struct image_header) == 64, "the header has no gaps: it lies in flash as it is");
_Static_assert(sizeof(struct image_marks) == 28, "nor have the marks");

static bool program(uint32_t slot, size_t mark, uint32_t word)
{
    return hal_image_program(slot, IMAGE_MARKS_AT + (uint32_t)mark, word);
}

uint8_t image_header_defect(const struct image_header *header, uint32_t slot)
{
    const uint32_t crc = crc32_update(0, (const uint8_t *)header, offsetof(struct image_header, header_crc));
    if (header->magic != IMAGE_MAGIC || header->format != (uint32_t)IMAGE_FORMAT ||
        header->header_crc != crc || header->name[IMAGE_NAME_SIZE - 1] != '\0') {
        return PROTO_IMAGE_DEFECT_HEADER;
    }
    if (header->slot != slot) {
        return PROTO_IMAGE_DEFECT_SLOT;
    }
    const bool fits = header->size > (uint32_t)IMAGE_HEADER_SIZE && header->size <= hal_image_size();
    return fits ? (uint8_t)IMAGE_NONE : (uint8_t)PROTO_IMAGE_DEFECT_SIZE;
}

bool image_is_for(const struct image_header *header, const char *name)
{
    uint32_t i = 0;
    while (i < (uint32_t)IMAGE_NAME_SIZE && header->name[i] == name[i] && name[i] != ' ' && name[i] != '\0') {
        i++;
    }
    return i > 0u && i < (uint32_t)IMAGE_NAME_SIZE && header->name[i] == ' ' && name[i] == ' ';
}

static uint8_t state_of(const struct image_slot *slot)
{
    if (slot->marks.commit != IMAGE_COMMIT) {
        return PROTO_IMAGE_STATE_NONE;
    }
    if (slot->marks.rejected != IMAGE_ERASED) {
        return PROTO_IMAGE_STATE_REJECTED;
    }
    return slot->marks.confirmed == IMAGE_CONFIRMED ? PROTO_IMAGE_STATE_CONFIRMED : PROTO_IMAGE_STATE_TRIAL;
}

void image_slot_read(uint32_t slot, struct image_slot *out)
{
    hal_image_read(slot, 0, (uint8_t *)&out->header, sizeof out->header);
    hal_image_read(slot, IMAGE_MARKS_AT, (uint8_t *)&out->marks, sizeof out->marks);
    out->state = image_header_defect(&out->header, slot) == (uint8_t)IMAGE_NONE
                     ? state_of(out)
                     : (uint8_t)PROTO_IMAGE_STATE_NONE;
}

bool image_slot_is_whole(uint32_t slot, const struct image_header *header)
{
    uint8_t piece[64];
    uint32_t crc = 0;
    uint32_t at = IMAGE_HEADER_SIZE;
    while (at < header->size) {
        const uint32_t left = header->size - at;
        const uint32_t length = left < sizeof piece ? left : (uint32_t)sizeof piece;
        hal_image_read(slot, at, piece, length);
        crc = crc32_update(crc, piece, length);
        at += length;
    }
    return crc == header->content_crc;
}

/* Marks one more trial before it begins, so that one that hangs has been counted. A mark that was cut off in
 * the middle counts as well. */
static bool begin_trial(uint32_t slot, const struct image_slot *image)
{
    for (uint32_t i = 0; i < (uint32_t)IMAGE_TRIALS; i++) {
        if (image->marks.trial[i] == IMAGE_ERASED) {
            return program(slot, offsetof(struct image_marks, trial) + i * sizeof(uint32_t), 0);
        }
    }
    return false;
}

/* The newest of the slots that may still be chosen, or IMAGE_NONE. */
static uint32_t newest_of(const struct image_slot images[HAL_IMAGE_SLOTS])
{
    uint32_t newest = IMAGE_NONE;
    for (uint32_t slot = 0; slot < (uint32_t)HAL_IMAGE_SLOTS; slot++) {
        const bool runs = images[slot].state == (uint8_t)PROTO_IMAGE_STATE_TRIAL ||
                          images[slot].state == (uint8_t)PROTO_IMAGE_STATE_CONFIRMED;
        if (runs &&
            (newest == (uint32_t)IMAGE_NONE || images[slot].marks.sequence > images[newest].marks.sequence)) {
            newest = slot;
        }
    }
    return newest;
}

uint32_t image_slot_choose(const char *name)
{
    struct image_slot images[HAL_IMAGE_SLOTS];
    for (uint32_t slot = 0; slot < (uint32_t)HAL_IMAGE_SLOTS; slot++) {
        image_slot_read(slot, &images[slot]);
        if (!image_is_for(&images[slot].header, name)) {
            images[slot].state = PROTO_IMAGE_STATE_NONE;
        }
    }
    uint32_t slot = newest_of(images);
    while (slot != (uint32_t)IMAGE_NONE && images[slot].state == (uint8_t)PROTO_IMAGE_STATE_TRIAL) {
        /* A start on trial costs 50 ms for the CRC; one of a confirmed image costs nothing. */
        if (image_slot_is_whole(slot, &images[slot].header) && begin_trial(slot, &images[slot])) {
            return slot;
        }
        (void)program(slot, offsetof(struct image_marks, rejected), 0);
        images[slot].state = PROTO_IMAGE_STATE_REJECTED;
        slot = newest_of(images);
    }
    return slot;
}

bool image_slot_commit(uint32_t slot, uint32_t sequence)
{
    return program(slot, offsetof(struct image_marks, sequence), sequence) &&
           program(slot, offsetof(struct image_marks, commit), IMAGE_COMMIT);
}

bool image_slot_confirm(uint32_t slot)
{
    return program(slot, offsetof(struct image_marks, confirmed), IMAGE_CONFIRMED);
}

bool image_slot_retire(uint32_t slot)
{
    return program(slot, offsetof(struct image_marks, commit), 0);
}
