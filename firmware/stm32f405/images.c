/* The slot that runs, and the erase of the other one. */
#include "cortex.h"
#include "flash_erase.h"
#include "hal.h"
#include "image_places.h"
#include "registers.h"

/* From the linker script; only its address means anything. */
extern const uint8_t __image_start[];

uint32_t hal_image_running(void)
{
    return (uintptr_t)__image_start == IMAGE_PLACE_0 ? 0 : 1;
}

uint32_t hal_image_sectors(uint32_t slot)
{
    return slot == 0u ? 2 : 1;
}

bool hal_image_erase(uint32_t slot, uint32_t sector, uint32_t *missed_ticks)
{
    enum { FIRST_SECTOR_0 = 3, FIRST_SECTOR_1 = 5 };
    *missed_ticks = 0;
    if (slot == hal_image_running()) {
        return false;
    }
    const uint32_t first = slot == 0u ? FIRST_SECTOR_0 : FIRST_SECTOR_1;
    return flash_erase(first + sector, WATCHDOG_LARGE_SECTOR, missed_ticks);
}

void hal_restart(void)
{
    SCB_AIRCR = AIRCR_VECTKEY | AIRCR_SYSRESETREQ;
    cpu_barrier();
    for (;;) {
    }
}
