/* The system configuration controller, RM0090 section 9: which port feeds each external interrupt line. */
#include "machine.h"

bool syscfg_access(struct board *b, uint32_t offset, bool write, uint32_t *value)
{
    uint32_t *const store[] = {&b->syscfg_memrmp,    &b->syscfg_pmc,       &b->syscfg_exticr[0],
                               &b->syscfg_exticr[1], &b->syscfg_exticr[2], &b->syscfg_exticr[3]};
    if (offset == 0x20) { /* CMPCR: the compensation cell is ready at once */
        *value = 0x100u;
        return true;
    }
    if (offset > 0x14) {
        return false;
    }
    if (write) {
        exti_sync(b); /* EXTICR chooses the pins whose edges count */
        *store[offset / 4] = *value;
        encoder_lines_schedule(b);
    }
    *value = *store[offset / 4];
    return true;
}
