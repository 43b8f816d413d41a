/* Why a request is refused, as it goes over the wire. */
#ifndef REFUSAL_H
#define REFUSAL_H

#include <stdint.h>

#include "proto.h"

struct refusal {
    uint8_t reason; /* enum proto_refusal_reason; REFUSAL_NONE: accepted */
    uint32_t detail;
};

enum { REFUSAL_NONE = 0 };

static inline struct refusal accepted(void)
{
    return (struct refusal){.reason = REFUSAL_NONE};
}

static inline struct refusal refused(enum proto_refusal_reason reason, uint32_t detail)
{
    return (struct refusal){.reason = (uint8_t)reason, .detail = detail};
}

#endif
