/* The loader: from reset to the image that this start runs. Nothing but a probe or the ROM loader writes it.
 *
 * It runs at 16 MHz without interrupts and touches nothing but the flash, so that an image finds the chip as
 * a reset leaves it. A start on trial has the watchdog running, in case the image does not get as far as
 * starting it. */
#include "cortex.h"
#include "image_places.h"
#include "image_slot.h"
#include "proto.h"
#include "registers.h"
#include "watchdog.h"
#include "wiring.h"

/* RM0090 table 61: 82 interrupts behind the 15 exceptions. */
enum { HANDLERS = 15 + 82 };

struct loader_vectors {
    uint32_t *stack_top;
    void (*handlers[HANDLERS])(void);
};

extern uint32_t __stack_top[];

_Noreturn void loader_start(void);
_Noreturn void loader_fault(void);

__attribute__((section(".vectors"), used)) static const struct loader_vectors vectors = {
    .stack_top = __stack_top,
    .handlers = {loader_start, [1 ... HANDLERS - 1] = loader_fault},
};

/* Behind the vectors, where programs on the host look for a chip's board: `truing flash`. */
__attribute__((section(".image_name"), used)) static const char board_image[] =
    BOARD_IMAGE " " TRUING_VERSION;

_Noreturn void loader_fault(void)
{
    SCB_AIRCR = AIRCR_VECTKEY | AIRCR_SYSRESETREQ;
    cpu_barrier();
    for (;;) {
    }
}

/* The slot may have been written since its last lines were cached, and no reset is said to empty the caches:
 * that takes a write while they are off, as they are here (RM0090 section 3.5.2). */
static void empty_caches(void)
{
    FLASH_ACR = FLASH_ACR_ICRST | FLASH_ACR_DCRST;
    FLASH_ACR = 0;
}

/* An image's vectors lie behind its header: the stack's top, then where it starts (PM0214 section 2.3.4). */
static _Noreturn void run(uint32_t slot)
{
    uint32_t first[2];
    hal_image_read(slot, IMAGE_HEADER_SIZE, (uint8_t *)first, sizeof first);
    __asm volatile("msr msp, %0\n\tbx %1" ::"r"(first[0]), "r"(first[1]) : "memory");
    __builtin_unreachable();
}

_Noreturn void loader_start(void)
{
    struct image_slot image;
    /* The ROM loader's Go command arrives here too, with its own timer settings. */
    cpu_interrupts_off();
    SYSTICK->ctrl = 0;
    const uint32_t slot = image_slot_choose(board_image);
    if (slot != (uint32_t)IMAGE_NONE) {
        image_slot_read(slot, &image);
        if (image.state == (uint8_t)PROTO_IMAGE_STATE_TRIAL) {
            watchdog_start();
        }
        empty_caches();
        run(slot);
    }
    for (;;) { /* no image: the pins float until somebody flashes one */
    }
}
