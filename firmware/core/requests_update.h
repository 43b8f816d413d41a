/* The requests that bring a new image of the firmware, and that start the board anew. */
#ifndef REQUESTS_UPDATE_H
#define REQUESTS_UPDATE_H

#include "frame.h"
#include "refusal.h"
#include "requests_log.h"
#include "update.h"

struct refusal requests_update_state(const struct update *update, const struct robot *robot,
                                     const struct frame *request, struct reply *reply);
struct refusal requests_update_begin(struct update *update, struct robot *robot, const struct frame *request,
                                     struct reply *reply);
struct refusal requests_update_data(struct update *update, uint32_t now_ms, const struct frame *request,
                                    struct reply *reply);
struct refusal requests_update_finish(struct update *update, const struct frame *request,
                                      struct reply *reply);
struct refusal requests_restart(struct update *update, struct robot *robot, const struct frame *request);

#endif
