/* Power control, RM0090 section 5. */
#include "machine.h"

bool pwr_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    if (offset == 0x0) {
        b->pwr_cr = write ? *value & 0x43F3u : b->pwr_cr;
        *value = b->pwr_cr;
        return true;
    }
    if (offset == 0x4) { /* CSR: VOSRDY, the regulator follows at once */
        *value = 1u << 14;
        return true;
    }
    return false;
}
