/* The requests that read, change and store parameters. */
#ifndef REQUESTS_PARAMETERS_H
#define REQUESTS_PARAMETERS_H

#include "frame.h"
#include "refusal.h"
#include "requests_log.h"
#include "robot_state.h"

struct refusal requests_param_list(const struct robot *robot, const struct frame *request,
                                   struct reply *reply);
struct refusal requests_param_get(const struct robot *robot, const struct frame *request,
                                  struct reply *reply);
struct refusal requests_param_set(struct robot *robot, const struct frame *request, struct reply *reply);
struct refusal requests_param_save(struct robot *robot, const struct frame *request, struct reply *reply);
struct refusal requests_param_load(struct robot *robot, const struct frame *request, struct reply *reply);
struct refusal requests_param_defaults(struct robot *robot, const struct frame *request);
struct refusal requests_param_store(struct robot *robot, const struct frame *request, struct reply *reply);

#endif
