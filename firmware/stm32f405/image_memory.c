/* Where the two slots for an image lie in flash; for the image that runs, and for the loader. */
#include <string.h>

#include "flash_cells.h"
#include "hal.h"
#include "image_places.h"

static uintptr_t place(uint32_t slot, uint32_t offset)
{
    return (slot == 0u ? (uintptr_t)IMAGE_PLACE_0 : (uintptr_t)IMAGE_PLACE_1) + offset;
}

uint32_t hal_image_size(void)
{
    return IMAGE_PLACE_SIZE;
}

void hal_image_read(uint32_t slot, uint32_t offset, uint8_t *out, size_t length)
{
    memcpy(out, (const uint8_t *)place(slot, offset), length);
}

bool hal_image_program(uint32_t slot, uint32_t offset, uint32_t word)
{
    return flash_program((volatile uint32_t *)place(slot, offset), word);
}
