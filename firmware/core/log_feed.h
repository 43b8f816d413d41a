/* From the control tick, which takes records, to the main loop, which codes them: one writer, one reader, no
 * lock. */
#ifndef LOG_FEED_H
#define LOG_FEED_H

#include <stdbool.h>
#include <stdint.h>

#include "log.h"
#include "proto.h"

/* Records that may wait: a third of a second at 200 Hz, 56 bytes each; the main loop runs every millisecond.
 * The last few places are reserved for opening and closing a log. */
enum { LOG_FEED_SIZE = 64, LOG_FEED_KEPT = 4 };

enum log_feed_kind { LOG_FEED_OPEN, LOG_FEED_RECORD, LOG_FEED_FIRE, LOG_FEED_CLOSE };

struct log_feed_item {
    uint8_t kind; /* enum log_feed_kind */
    uint8_t end;  /* enum proto_log_end or LOG_END_DISCARDED, of a close */
    union {
        struct proto_log_record record;
        struct log_opening opening;
        uint32_t fired_t_ms;
    } of;
};

struct log_feed {
    struct log_feed_item items[LOG_FEED_SIZE];
    volatile uint32_t written; /* by the tick only */
    volatile uint32_t read;    /* by the main loop only */
};

void log_feed_init(struct log_feed *feed);

/* From the tick. A record that finds no room is lost. */
void log_feed_open(struct log_feed *feed, const struct log_opening *opening);
void log_feed_record(struct log_feed *feed, const struct proto_log_record *record);
void log_feed_fire(struct log_feed *feed, uint32_t t_ms);
void log_feed_close(struct log_feed *feed, uint8_t end);

/* From the main loop: writes the waiting records into the log. */
void log_feed_drain(struct log_feed *feed, struct log *log);

#endif
