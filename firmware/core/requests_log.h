/* The requests that read the log. */
#ifndef REQUESTS_LOG_H
#define REQUESTS_LOG_H

#include <stddef.h>
#include <stdint.h>

#include "frame.h"
#include "log.h"
#include "refusal.h"

/* Where a handler writes its reply's payload. */
struct reply {
    uint8_t *bytes;
    size_t capacity;
    size_t length;
};

struct refusal requests_log_list(const struct log *log, const struct frame *request, struct reply *reply);
struct refusal requests_log_read(const struct log *log, const struct frame *request, struct reply *reply);
struct refusal requests_log_digest(const struct log *log, const struct frame *request, struct reply *reply);

#endif
