/* No update over the link: there is no loader, and one place for an image. A slot has no room, so that an
 * update is refused before anything is erased. */
#include <string.h>

#include "cortex.h"
#include "hal.h"
#include "registers.h"

uint32_t hal_image_running(void)
{
    return 0;
}

uint32_t hal_image_size(void)
{
    return 0;
}

void hal_image_read(uint32_t slot, uint32_t offset, uint8_t *out, size_t length)
{
    (void)slot;
    (void)offset;
    memset(out, 0xFF, length); /* as erased */
}

bool hal_image_program(uint32_t slot, uint32_t offset, uint32_t word)
{
    (void)slot;
    (void)offset;
    (void)word;
    return false;
}

uint32_t hal_image_sectors(uint32_t slot)
{
    (void)slot;
    return 0;
}

bool hal_image_erase(uint32_t slot, uint32_t sector, uint32_t *missed_ticks)
{
    (void)slot;
    (void)sector;
    *missed_ticks = 0;
    return false;
}

void hal_restart(void)
{
    SCB_AIRCR = AIRCR_VECTKEY | AIRCR_SYSRESETREQ;
    cpu_barrier();
    for (;;) {
    }
}
