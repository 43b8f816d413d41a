/* From the control tick, which takes records, to the main loop, which codes them. */
#include "log_feed.h"

#include <stddef.h>

void log_feed_init(struct log_feed *feed)
{
    feed->written = 0;
    feed->read = 0;
}

/* The place for the next item, or NULL when fewer than `spare` would be left after it. */
static struct log_feed_item *next_place(struct log_feed *feed, uint32_t spare)
{
    const uint32_t waiting = feed->written - feed->read;
    return waiting + spare < (uint32_t)LOG_FEED_SIZE ? &feed->items[feed->written % (uint32_t)LOG_FEED_SIZE]
                                                     : NULL;
}

/* The fence keeps the item's bytes before the word that makes it visible; there is one core. */
static void publish(struct log_feed *feed)
{
    __atomic_signal_fence(__ATOMIC_SEQ_CST);
    feed->written = feed->written + 1u;
}

void log_feed_open(struct log_feed *feed, const struct log_opening *opening)
{
    struct log_feed_item *const item = next_place(feed, 0);
    if (item != NULL) {
        item->kind = LOG_FEED_OPEN;
        item->of.opening = *opening;
        publish(feed);
    }
}

void log_feed_record(struct log_feed *feed, const struct proto_log_record *record)
{
    struct log_feed_item *const item = next_place(feed, LOG_FEED_KEPT);
    if (item != NULL) {
        item->kind = LOG_FEED_RECORD;
        item->of.record = *record;
        publish(feed);
    }
}

void log_feed_fire(struct log_feed *feed, uint32_t t_ms)
{
    struct log_feed_item *const item = next_place(feed, 0);
    if (item != NULL) {
        item->kind = LOG_FEED_FIRE;
        item->of.fired_t_ms = t_ms;
        publish(feed);
    }
}

void log_feed_close(struct log_feed *feed, uint8_t end)
{
    struct log_feed_item *const item = next_place(feed, 0);
    if (item != NULL) {
        item->kind = LOG_FEED_CLOSE;
        item->end = end;
        publish(feed);
    }
}

void log_feed_drain(struct log_feed *feed, struct log *log)
{
    while (feed->read != feed->written) {
        const struct log_feed_item *const item = &feed->items[feed->read % (uint32_t)LOG_FEED_SIZE];
        __atomic_signal_fence(__ATOMIC_SEQ_CST);
        switch (item->kind) {
        case LOG_FEED_OPEN:
            log_open(log, &item->of.opening);
            break;
        case LOG_FEED_RECORD:
            log_append(log, &item->of.record);
            break;
        case LOG_FEED_FIRE:
            log_fire(log, item->of.fired_t_ms);
            break;
        default:
            log_close(log, item->end);
            break;
        }
        __atomic_signal_fence(__ATOMIC_SEQ_CST);
        feed->read = feed->read + 1u;
    }
}
