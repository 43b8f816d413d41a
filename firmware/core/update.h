/* Receives an image of the firmware into the slot that does not run.
 *
 * Chunks form a chain: each brings the SHA-256 of what follows it, data and digest together, and update_begin
 * brings that of the first. So one digest of 32 bytes stands for the whole image, and nothing is written that
 * does not belong to it. The image that runs is never touched. */
#ifndef UPDATE_H
#define UPDATE_H

#include <stdbool.h>
#include <stdint.h>

#include "image_slot.h"
#include "refusal.h"
#include "robot_state.h"
#include "sha256.h"

enum {
    UPDATE_CHUNK = 512,
    UPDATE_SILENCE_MS = 10000, /* without a chunk for so long, the board may be armed again */
    /* An image on trial that no host has greeted for so long starts anew, and so uses its trials up. */
    UPDATE_TRIAL_MS = 20000,
    UPDATE_RESTART_MS = 20 /* for the reply to leave */
};

struct update {
    uint8_t head[SHA256_SIZE];     /* of the image that is received */
    uint8_t expected[SHA256_SIZE]; /* of the next chunk */
    uint32_t size;
    uint16_t chunks; /* 0: no image is being received */
    uint16_t next;
    bool receiving;    /* and its host was heard lately */
    uint32_t heard_ms; /* when */
    bool on_trial;     /* the image that runs is; nobody has greeted it yet */
    bool greeted;      /* a host has */
    bool restarts;     /* asked for by the host */
    uint32_t restart_ms;
};

void update_init(struct update *update);

void update_report(const struct update *update, const struct robot *robot,
                   struct proto_update_state_reply *out);

struct refusal update_begin(struct update *update, struct robot *robot,
                            const struct proto_update_begin_request *in,
                            struct proto_update_begin_reply *out);
struct refusal update_data(struct update *update, uint32_t now_ms,
                           const struct proto_update_data_request *in);
struct refusal update_finish(struct update *update, uint32_t *sequence);

/* An image is received, or a start is about to come: the board is not armed. */
bool update_is_under_way(const struct update *update);

/* Starts anew a while later. */
struct refusal update_restart(struct update *update, struct robot *robot, uint32_t boot_id);

/* Once a millisecond, from the main loop: time-outs, the confirmation of an image on trial, and restarts. */
void update_step(struct update *update, uint32_t now_ms);

#endif
