/* A board in memory: the caller sets what the core senses and receives, and reads its outputs. */
#include "hal_host.h"

#include <string.h>

static _Thread_local struct hal_host *current;

static size_t min_size(size_t a, size_t b)
{
    return a < b ? a : b;
}

void hal_host_init(struct hal_host *board)
{
    memset(board, 0, sizeof *board);
    board->sample.battery_mv = 12000;
    board->sample.battery_valid = true;
    board->identity.cpu_hz = 168000000;
    board->identity.reset_cause =
        0x0E; /* power-on, pin and brown-out flags, as after connecting the supply */
    board->identity.boot_id = 1;
    board->identity.brown_out_reset = true;
    board->line_room = SIZE_MAX;
    board->can_room = SIZE_MAX;
    memset(board->store, 0xFF, sizeof board->store);
    memset(board->image, 0xFF, sizeof board->image);
    board->store_cut_at = UINT32_MAX;
    board->store_refuse_at = UINT32_MAX;
    board->store_noise = 1;
    board->erase_ticks = 250;
    board->log_memory_size[0] = 32768;
    board->log_memory_size[1] = HAL_HOST_LOG_SIZE;
}

void hal_host_power_cycle(struct hal_host *board)
{
    static _Thread_local uint8_t kept[HAL_STORE_SLOTS][HAL_STORE_SLOT_SIZE];
    static _Thread_local uint8_t images[HAL_IMAGE_SLOTS][HAL_HOST_IMAGE_SIZE];
    const uint32_t noise = board->store_noise;
    memcpy(kept, board->store, sizeof kept);
    memcpy(images, board->image, sizeof images);
    hal_host_init(board);
    memcpy(board->store, kept, sizeof kept);
    memcpy(board->image, images, sizeof images);
    board->store_noise = noise;
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
        board->peeked_at = 0;
    }
    const size_t taken = min_size(length, sizeof board->received - board->received_length);
    memcpy(board->received + board->received_length, data, taken);
    board->received_length += taken;
    return taken;
}

size_t hal_host_take_sent(struct hal_host *board, uint8_t *out, size_t capacity)
{
    const size_t taken = min_size(capacity, board->sent_length);
    memcpy(out, board->sent, taken);
    memmove(board->sent, board->sent + taken, board->sent_length - taken);
    board->sent_length -= taken;
    return taken;
}

void hal_log_memory(uint32_t piece, struct hal_memory *out)
{
    *out = (struct hal_memory){.start = current->log_memory[piece], .size = current->log_memory_size[piece]};
}

void hal_enable_driver(bool enabled)
{
    current->driver_enabled = enabled;
}

void hal_note_moving(bool moving)
{
    current->moving = moving;
}

void hal_identity(struct hal_identity *out)
{
    *out = current->identity;
}

bool hal_fault_record(struct hal_fault_record *out)
{
    *out = current->fault_record;
    return out->count != 0;
}

void hal_sense(struct hal_sample *out)
{
    current->sample.now_us += HAL_HOST_TICK_US;
    current->sample.emergency_stop = current->sample.emergency_stop || current->emergency_switch_open;
    *out = current->sample;
}

bool hal_release_emergency_stop(void)
{
    current->sample.emergency_stop = current->emergency_switch_open;
    return !current->emergency_switch_open;
}

uint32_t hal_now_us(void)
{
    return current->sample.now_us + current->after_tick_us;
}

void hal_drive(const int16_t effort_e4[HAL_WHEELS])
{
    current->effort_e4[0] = effort_e4[0];
    current->effort_e4[1] = effort_e4[1];
    current->drive_calls++;
}

size_t hal_link_read(uint8_t *out, size_t capacity)
{
    const size_t taken = min_size(capacity, current->received_length - current->received_at);
    memcpy(out, current->received + current->received_at, taken);
    current->received_at += taken;
    return taken;
}

size_t hal_link_peek(const uint8_t **bytes)
{
    const size_t count = current->received_length - current->peeked_at;
    *bytes = current->received + current->peeked_at;
    current->peeked_at += count;
    return count;
}

bool hal_has_unheard(void)
{
    return current->peeked_at != current->received_length ||
           current->can_peeked_at != current->can_received_count;
}

size_t hal_link_write(const uint8_t *data, size_t length)
{
    const size_t taken =
        min_size(length, min_size(current->line_room, sizeof current->sent - current->sent_length));
    memcpy(current->sent + current->sent_length, data, taken);
    current->sent_length += taken;
    if (current->line_room != SIZE_MAX) {
        current->line_room -= taken;
    }
    return taken;
}

void hal_can_start(uint32_t bits_per_s, const uint16_t ids[2])
{
    current->can_bits_per_s = bits_per_s;
    current->can_ids[0] = ids[0];
    current->can_ids[1] = ids[1];
}

bool hal_can_read(struct hal_can_frame *out)
{
    while (current->can_received_at < current->can_received_count) {
        *out = current->can_received[current->can_received_at++];
        if (out->id == current->can_ids[0] || out->id == current->can_ids[1]) {
            return true;
        }
    }
    current->can_received_at = 0;
    current->can_received_count = 0;
    current->can_peeked_at = 0;
    return false;
}

bool hal_can_peek(struct hal_can_frame *out)
{
    while (current->can_peeked_at < current->can_received_count) {
        *out = current->can_received[current->can_peeked_at++];
        if (out->id == current->can_ids[0] || out->id == current->can_ids[1]) {
            return true;
        }
    }
    return false;
}

size_t hal_can_writable(void)
{
    return min_size(current->can_room, HAL_HOST_CAN_FRAMES - current->can_sent_count);
}

void hal_can_write(const struct hal_can_frame *frame)
{
    if (hal_can_writable() > 0) {
        current->can_sent[current->can_sent_count++] = *frame;
        current->can_room -= current->can_room != SIZE_MAX ? 1u : 0u;
    }
}

void hal_can_report(struct hal_can_report *out)
{
    *out = current->can_report;
}

void hal_watchdog_feed(void)
{
    current->watchdog_feeds++;
}

/* xorshift32 (Marsaglia 2003). */
static uint32_t noise(void)
{
    uint32_t x = current->store_noise;
    x ^= x << 13;
    x ^= x >> 17;
    x ^= x << 5;
    current->store_noise = x;
    return x;
}

/* True when this operation fails: the power fails in it, has failed before, or the memory is worn out. */
static bool store_stops(bool *torn)
{
    const uint32_t operation = current->store_operations;
    current->store_operations++;
    *torn = !current->store_dead && operation == current->store_cut_at;
    current->store_dead = current->store_dead || *torn;
    return current->store_dead || operation >= current->store_refuse_at;
}

/* Bits that an interrupted operation has changed: from few to nearly all, at random. */
static uint8_t reached(uint32_t eagerness)
{
    const uint32_t draws = noise();
    const uint8_t a = (uint8_t)draws;
    const uint8_t b = (uint8_t)(draws >> 8);
    switch (eagerness % 4u) {
    case 0:
        return a & b & (uint8_t)(draws >> 16);
    case 1:
        return a & b;
    case 2:
        return a;
    default:
        return a | b;
    }
}

static bool erase(uint8_t *cells, size_t size, uint32_t *missed_ticks)
{
    bool torn;
    *missed_ticks = 0;
    if (store_stops(&torn)) {
        const uint32_t eagerness = torn ? noise() : 0;
        for (size_t i = 0; torn && i < size; i++) {
            cells[i] |= reached(eagerness);
        }
        return false;
    }
    memset(cells, 0xFF, size);
    *missed_ticks = current->erase_ticks;
    return true;
}

static bool program(uint8_t *cells, uint32_t word)
{
    bool torn;
    const bool stops = store_stops(&torn);
    const uint32_t eagerness = torn ? noise() : 0;
    for (uint32_t i = 0; i < 4u && (torn || !stops); i++) {
        const uint8_t zeros = (uint8_t) ~(word >> (8u * i));
        cells[i] &= (uint8_t) ~(torn ? zeros & reached(eagerness) : zeros);
    }
    return !stops;
}

bool hal_store_erase(uint32_t slot, uint32_t *missed_ticks)
{
    return erase(current->store[slot], HAL_STORE_SLOT_SIZE, missed_ticks);
}

bool hal_store_program(uint32_t slot, uint32_t offset, uint32_t word)
{
    return program(current->store[slot] + offset, word);
}

void hal_store_read(uint32_t slot, uint32_t offset, uint8_t *out, size_t length)
{
    memcpy(out, current->store[slot] + offset, length);
}

uint32_t hal_image_running(void)
{
    return current->image_running;
}

uint32_t hal_image_size(void)
{
    return HAL_HOST_IMAGE_SIZE;
}

void hal_image_read(uint32_t slot, uint32_t offset, uint8_t *out, size_t length)
{
    memcpy(out, current->image[slot] + offset, length);
}

bool hal_image_program(uint32_t slot, uint32_t offset, uint32_t word)
{
    return program(current->image[slot] + offset, word);
}

/* The first slot has two sectors, as on the chip. */
uint32_t hal_image_sectors(uint32_t slot)
{
    return slot == 0u ? 2 : 1;
}

bool hal_image_erase(uint32_t slot, uint32_t sector, uint32_t *missed_ticks)
{
    const uint32_t size = HAL_HOST_IMAGE_SIZE / hal_image_sectors(slot);
    return erase(current->image[slot] + (size_t)sector * size, size, missed_ticks);
}

void hal_restart(void)
{
    current->restarts++;
}

uint32_t hal_critical_enter(void)
{
    return current->critical_depth++;
}

void hal_critical_exit(uint32_t state)
{
    current->critical_depth = state;
}
