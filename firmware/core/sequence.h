/* The uploaded sequence: timed segments that the board runs by itself, to the millisecond. */
#ifndef SEQUENCE_H
#define SEQUENCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "command_check.h"
#include "refusal.h"
#include "tuning.h"

enum { SEQUENCE_LONGEST_SEGMENT_MS = 600000, SEQUENCE_FASTEST_LOG_HZ = 200 };

struct sequence {
    struct proto_segment segments[PROTO_MAX_SEGMENTS];
    uint8_t state;          /* enum proto_sequence_state */
    uint16_t segment_count; /* announced */
    uint16_t received;
    uint16_t log_rate_hz; /* 0: the parameter's */
    uint32_t crc;         /* over the packed bytes received so far */
    uint32_t duration_ms; /* of the segments received so far */
    uint16_t current;     /* while running: the segment that runs */
    uint32_t elapsed_ms;  /* since the start */
    uint32_t current_end_ms;
    uint16_t audited;   /* segments that audit_crc covers */
    uint32_t audit_crc; /* of this round of sequence_audit */
    uint16_t log_id;    /* of the last run, 0 before the first */
};

/* Result of a tick of a running sequence. */
enum sequence_event { SEQUENCE_GOES_ON = 0, SEQUENCE_NEXT_SEGMENT, SEQUENCE_FINISHED };

/* Forgets what was held and awaits `segment_count` segments. */
struct refusal sequence_begin(struct sequence *sequence, uint16_t segment_count, uint16_t log_rate_hz);

/* Takes the next segments, packed as on the wire; all of them or none. */
struct refusal sequence_append(struct sequence *sequence, const struct tuning *tuning, uint16_t first,
                               const uint8_t *packed, size_t count);

/* All segments are there and have this CRC. */
struct refusal sequence_commit(struct sequence *sequence, uint32_t crc);

/* Whether the committed sequence may run: it is the one meant, and within the limits as they are now. */
struct refusal sequence_check(const struct sequence *sequence, const struct tuning *tuning, uint32_t crc);

/* Time zero; the first segment's command is in force from now on. */
void sequence_start(struct sequence *sequence, uint16_t log_id);

/* All segments as they lie in memory still have the committed CRC. */
bool sequence_is_intact(const struct sequence *sequence);

/* The same for a running sequence, one segment a call, repeatedly; false at the end of a pass that failed. */
bool sequence_audit(struct sequence *sequence);

/* One millisecond later. */
enum sequence_event sequence_step(struct sequence *sequence);

/* Ends a run, if there is one. */
void sequence_abort(struct sequence *sequence);

/* Forgets an upload in progress, if any. Not for the tick: the main loop may be in the middle of it. */
void sequence_forget_upload(struct sequence *sequence);

/* The command of the segment that runs. */
struct wheel_command sequence_command(const struct sequence *sequence, const struct tuning *tuning);

#endif
