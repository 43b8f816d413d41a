/* Reset cause of the last start by name, and the faults that follow from it. */
#include "boot.h"

#include <stddef.h>

#include "proto.h"

/* RM0090 section 7.3.21: the flags stay set until cleared, and a power-on sets the brown-out and pin flags as
 * well. Where the option bytes leave the brown-out reset off, a dip of the supply looks like a power-on;
 * memory that is still intact distinguishes the two. */
uint8_t boot_reset_cause(const struct hal_identity *identity)
{
    static const struct {
        uint8_t flag;
        uint8_t cause;
    } causes[] = {
        {1u << 3, PROTO_RESET_CAUSE_POWER_ON},  /* PORRSTF */
        {1u << 5, PROTO_RESET_CAUSE_WATCHDOG},  /* IWDGRSTF */
        {1u << 6, PROTO_RESET_CAUSE_WATCHDOG},  /* WWDGRSTF */
        {1u << 7, PROTO_RESET_CAUSE_LOW_POWER}, /* LPWRRSTF */
        {1u << 4, PROTO_RESET_CAUSE_SOFTWARE},  /* SFTRSTF */
        {1u << 1, PROTO_RESET_CAUSE_BROWN_OUT}, /* BORRSTF */
        {1u << 2, PROTO_RESET_CAUSE_PIN},       /* PINRSTF */
    };
    for (size_t i = 0; i < sizeof causes / sizeof causes[0]; i++) {
        if ((identity->reset_cause & causes[i].flag) != 0) {
            const bool dip = causes[i].cause == PROTO_RESET_CAUSE_POWER_ON && identity->memory_kept;
            return dip ? (uint8_t)PROTO_RESET_CAUSE_BROWN_OUT : causes[i].cause;
        }
    }
    return PROTO_RESET_CAUSE_UNKNOWN;
}

uint32_t boot_faults(const struct hal_identity *identity)
{
    uint32_t faults = 0;
    if (identity->clock_fallback) {
        faults |= PROTO_FAULT_CLOCK_FALLBACK;
    }
    if (identity->crystal_wrong) {
        faults |= PROTO_FAULT_CRYSTAL_WRONG;
    }
    if (!identity->brown_out_reset) {
        faults |= PROTO_FAULT_BROWN_OUT_RESET_OFF;
    }
    if (identity->program_fault) {
        faults |= PROTO_FAULT_PROGRAM_FAULT;
    }
    switch (boot_reset_cause(identity)) {
    case PROTO_RESET_CAUSE_BROWN_OUT:
        faults |= PROTO_FAULT_BROWN_OUT;
        break;
    case PROTO_RESET_CAUSE_WATCHDOG:
        faults |= PROTO_FAULT_WATCHDOG_RESET;
        break;
    default:
        /* The reset button and a probe reset on purpose, but not while the robot drives. */
        if (identity->was_moving && !identity->program_fault) {
            faults |= PROTO_FAULT_UNEXPECTED_RESET;
        }
        break;
    }
    return faults;
}
