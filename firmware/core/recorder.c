/* Records of one log: what to write, and when. */
#include "recorder.h"

#include "rounding.h"

void recorder_init(struct recorder *recorder)
{
    *recorder = (struct recorder){.next_log_id = 1};
}

uint16_t recorder_request(struct recorder *recorder, uint16_t rate_hz, uint32_t sequence_crc)
{
    recorder->opening = true;
    recorder->opening_ending = PROTO_LOG_END_OPEN;
    recorder->rate_hz = rate_hz;
    recorder->sequence_crc = sequence_crc;
    recorder->armed = false;
    return recorder->next_log_id;
}

uint16_t recorder_arm(struct recorder *recorder, uint16_t rate_hz, uint32_t before_ms)
{
    const uint16_t log_id = recorder_request(recorder, rate_hz, 0);
    recorder->armed = true;
    recorder->before_ms = before_ms;
    return log_id;
}

bool recorder_is_busy(const struct recorder *recorder)
{
    return recorder->opening || (recorder->active && recorder->ending == (uint8_t)PROTO_LOG_END_OPEN);
}

void recorder_finish_armed(struct recorder *recorder, uint8_t end)
{
    recorder->armed = false;
    recorder_finish(recorder, end);
}

void recorder_finish(struct recorder *recorder, uint8_t end)
{
    if (recorder->armed) {
        return;
    }
    if (recorder->opening) {
        if (recorder->opening_ending == PROTO_LOG_END_OPEN) {
            recorder->opening_ending = end;
        }
    } else if (recorder->active && recorder->ending == PROTO_LOG_END_OPEN) {
        recorder->ending = end;
    }
}

void recorder_pass(struct recorder *recorder, const int16_t applied_e4[HAL_WHEELS])
{
    if (recorder->active) {
        recorder->elapsed_ms++;
        for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
            recorder->effort_sum_e4[wheel] += applied_e4[wheel];
        }
    }
}

bool recorder_due(const struct recorder *recorder)
{
    return recorder->active &&
           (recorder->elapsed_ms == recorder->next_row_ms || recorder->ending != PROTO_LOG_END_OPEN);
}

/* floor(1000 k / rate) without a product that could overflow. */
static void schedule_next_row(struct recorder *recorder)
{
    const uint32_t rate = recorder->open_rate_hz;
    recorder->next_row_ms += 1000u / rate;
    recorder->next_row_part += 1000u % rate;
    if (recorder->next_row_part >= rate) {
        recorder->next_row_part -= rate;
        recorder->next_row_ms++;
    }
}

static int16_t rounded_mean(int32_t sum, int32_t count)
{
    return (int16_t)((sum + (sum >= 0 ? count / 2 : -count / 2)) / count);
}

/* What only the recorder knows of a record, over the interval that ends now. */
static void complete(struct recorder *recorder, struct recorder_view *view)
{
    struct proto_log_record *const record = &view->record;
    const uint32_t interval_ms = recorder->elapsed_ms - recorder->row_ms;
    int16_t effort[HAL_WHEELS] = {0, 0};
    int16_t speed[HAL_WHEELS] = {0, 0};
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        if (interval_ms > 0) {
            const int32_t moved = wrapped_difference(view->counts[wheel], recorder->counts_at_row[wheel]);
            effort[wheel] = rounded_mean(recorder->effort_sum_e4[wheel], (int32_t)interval_ms);
            speed[wheel] = log_replay_speed(&recorder->replay, moved, interval_ms);
        }
        recorder->effort_sum_e4[wheel] = 0;
        recorder->counts_at_row[wheel] = view->counts[wheel];
    }
    record->t_ms = recorder->elapsed_ms;
    record->effort_left = effort[0];
    record->effort_right = effort[1];
    record->speed_left = speed[0];
    record->speed_right = speed[1];
    record->counts_left = wrapped_difference(view->counts[0], recorder->counts_at_open[0]);
    record->counts_right = wrapped_difference(view->counts[1], recorder->counts_at_open[1]);
    recorder->row_ms = recorder->elapsed_ms;
}

void recorder_write(struct recorder *recorder, struct log_feed *feed, struct recorder_view *view)
{
    complete(recorder, view);
    log_feed_record(feed, &view->record);
    if (recorder->elapsed_ms == recorder->next_row_ms) {
        schedule_next_row(recorder);
    }
    if (recorder->ending != PROTO_LOG_END_OPEN) {
        log_feed_close(feed, recorder->ending);
        recorder->active = false;
        recorder->ending = PROTO_LOG_END_OPEN;
    }
}

void recorder_open(struct recorder *recorder, struct log_feed *feed, struct recorder_view *view)
{
    const struct log_opening opening = {
        .log_id = recorder->next_log_id,
        .armed = recorder->armed,
        .before_ms = recorder->before_ms,
        .start_ms = view->now_ms,
        .sequence_crc = recorder->sequence_crc,
        .format = {.geometry = view->geometry, .rate_hz = recorder->rate_hz},
    };
    log_feed_open(feed, &opening);
    log_replay_start(&recorder->replay, &view->geometry);
    recorder->next_log_id = (uint16_t)(recorder->next_log_id == UINT16_MAX ? 1 : recorder->next_log_id + 1);
    recorder->opening = false;
    recorder->active = true;
    recorder->ending = recorder->opening_ending;
    recorder->open_rate_hz = recorder->rate_hz;
    recorder->elapsed_ms = 0;
    recorder->row_ms = 0;
    recorder->next_row_ms = 0;
    recorder->next_row_part = 0;
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        recorder->counts_at_open[wheel] = view->counts[wheel];
        recorder->counts_at_row[wheel] = view->counts[wheel];
        recorder->effort_sum_e4[wheel] = 0;
    }
    recorder_write(recorder, feed, view);
}
