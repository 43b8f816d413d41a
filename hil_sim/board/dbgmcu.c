/* The debug support unit, RM0090 section 38: the identity of the chip. */
#include "machine.h"

bool dbgmcu_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    if (offset == 0) { /* IDCODE of an STM32F405, revision Z (RM0090 38.6.1) */
        *value = 0x10076413u;
        return true;
    }
    uint32_t *store = &b->dbgmcu[offset / 4 - 1];
    *store = write ? *value : *store;
    *value = *store;
    return true;
}
