/* Reset cause of the last start by name, and the faults that follow from it. */
#ifndef BOOT_H
#define BOOT_H

#include "hal.h"

/* enum proto_reset_cause. */
uint8_t boot_reset_cause(const struct hal_identity *identity);

/* Faults that are there from the start. */
uint32_t boot_faults(const struct hal_identity *identity);

#endif
