/* A board made of memory: the caller sets what the core senses and receives, and reads what it does. */
#include "hal_host.h"

#include <string.h>

static _Thread_local struct hal_host *current;

static size_t least(size_t a, size_t b)
{
    return a < b ? a : b;
}

void hal_host_init(struct hal_host *board)
{
    memset(board, 0, sizeof *board);
    board->sample.battery_mv = 12000;
    board->sample.battery_valid = true;
    board->identity.core_hz = 168000000;
    board->identity.reset_cause =
        0x0E; /* power-on, pin and brown-out flags, as after connecting the supply */
    board->identity.boot_id = 1;
    board->line_room = SIZE_MAX;
}

void hal_host_select(struct hal_host *board)
{
    current = board;
}

size_t hal_host_receive(struct hal_host *board, const uint8_t *data, size_t length)
{
    if (board->received_at == board->received_length) {
        board->received_at = 0;
        board->received_length = 0;
    }
    const size_t taken = least(length, sizeof board->received - board->received_length);
    memcpy(board->received + board->received_length, data, taken);
    board->received_length += taken;
    return taken;
}

size_t hal_host_take_sent(struct hal_host *board, uint8_t *out, size_t capacity)
{
    const size_t taken = least(capacity, board->sent_length);
    memcpy(out, board->sent, taken);
    memmove(board->sent, board->sent + taken, board->sent_length - taken);
    board->sent_length -= taken;
    return taken;
}

void hal_identity(struct hal_identity *out)
{
    *out = current->identity;
}

void hal_sense(struct hal_sample *out)
{
    *out = current->sample;
}

void hal_drive(const int16_t effort_e4[HAL_WHEELS])
{
    current->effort_e4[0] = effort_e4[0];
    current->effort_e4[1] = effort_e4[1];
    current->drive_calls++;
}

size_t hal_link_read(uint8_t *out, size_t capacity)
{
    const size_t taken = least(capacity, current->received_length - current->received_at);
    memcpy(out, current->received + current->received_at, taken);
    current->received_at += taken;
    return taken;
}

size_t hal_link_writable(void)
{
    return least(current->line_room, sizeof current->sent - current->sent_length);
}

size_t hal_link_write(const uint8_t *data, size_t length)
{
    const size_t taken = least(length, hal_link_writable());
    memcpy(current->sent + current->sent_length, data, taken);
    current->sent_length += taken;
    if (current->line_room != SIZE_MAX) {
        current->line_room -= taken;
    }
    return taken;
}

void hal_watchdog_feed(void)
{
    current->watchdog_feeds++;
}

uint32_t hal_critical_enter(void)
{
    return current->critical_depth++;
}

void hal_critical_exit(uint32_t state)
{
    current->critical_depth = state;
}
