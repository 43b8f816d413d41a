/* A board in memory: the caller sets what the core senses and receives, and reads its outputs. */
#ifndef HAL_HOST_H
#define HAL_HOST_H

#include "hal.h"

/* Time advances by one tick with each reading of the sensors. */
enum {
    HAL_HOST_RECEIVE_SIZE = 8192,
    HAL_HOST_SEND_SIZE = 65536,
    HAL_HOST_TICK_US = 1000,
    HAL_HOST_CAN_FRAMES = 512,
    HAL_HOST_LOG_SIZE = 65536,
    HAL_HOST_IMAGE_SIZE = 8192
};

struct hal_host {
    struct hal_sample sample; /* what the core senses */
    uint32_t after_tick_us;   /* time that has passed since it was sensed */
    struct hal_identity identity;
    struct hal_fault_record fault_record; /* count 0: there was none */
    int16_t effort_e4[HAL_WHEELS];        /* last command to the bridges */
    uint32_t drive_calls;
    uint32_t watchdog_feeds;
    bool emergency_switch_open;
    bool moving;         /* what hal_note_moving was last given */
    bool driver_enabled; /* what hal_enable_driver was last given */
    uint32_t critical_depth;
    uint8_t received[HAL_HOST_RECEIVE_SIZE]; /* on its way to the core */
    size_t received_length;
    size_t received_at;
    size_t peeked_at;
    uint8_t sent[HAL_HOST_SEND_SIZE]; /* written by the core, not yet taken by the caller */
    size_t sent_length;
    size_t line_room; /* bytes that the line still takes; SIZE_MAX: no limit */
    uint8_t store[HAL_STORE_SLOTS][HAL_STORE_SLOT_SIZE];
    uint8_t image[HAL_IMAGE_SLOTS][HAL_HOST_IMAGE_SIZE];
    uint32_t image_running;
    uint32_t restarts;         /* calls of hal_restart */
    uint32_t store_operations; /* erases and programmed words so far */
    uint32_t store_cut_at; /* the operation during which the power fails, counted from 0; UINT32_MAX: none */
    uint32_t store_refuse_at; /* from this operation on the memory is worn out; UINT32_MAX: it is not */
    uint32_t store_noise;     /* decides which bits an operation cut off has reached */
    bool store_dead;          /* the power has failed */
    uint32_t erase_ticks;     /* control ticks that an erase costs */
    struct hal_can_frame can_received[HAL_HOST_CAN_FRAMES]; /* on their way to the core */
    size_t can_received_count;
    size_t can_received_at;
    size_t can_peeked_at;
    struct hal_can_frame can_sent[HAL_HOST_CAN_FRAMES]; /* written by the core, not yet taken by the caller */
    size_t can_sent_count;
    size_t can_room;         /* frames that the bus still takes; SIZE_MAX: no limit */
    uint32_t can_bits_per_s; /* what the core joined the bus with */
    uint16_t can_ids[2];
    struct hal_can_report can_report;
    uint8_t log_memory[HAL_LOG_MEMORIES][HAL_HOST_LOG_SIZE];
    size_t log_memory_size[HAL_LOG_MEMORIES]; /* what of it there is */
};

/* A board at rest with 12 V, whose line takes everything and whose store is blank. */
void hal_host_init(struct hal_host *board);

/* The same after a power cycle: only the store and the images keep their content. */
void hal_host_power_cycle(struct hal_host *board);

/* The board that hal.h's functions act on from now on, in this thread. */
void hal_host_select(struct hal_host *board);

/* Puts bytes on the line to the core; returns how many its buffer took. */
size_t hal_host_receive(struct hal_host *board, const uint8_t *data, size_t length);

/* Takes what the core has written; returns how many bytes. */
size_t hal_host_take_sent(struct hal_host *board, uint8_t *out, size_t capacity);

#endif
