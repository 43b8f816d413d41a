/* The board as the core sees it: wheels, battery, identity, link, watchdog and a store that outlives power.
 */
#ifndef HAL_H
#define HAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { HAL_WHEELS = 2 }; /* 0 left, 1 right */

struct hal_sample {
    int32_t counts[HAL_WHEELS]; /* quadrature counts since reset, wrap modulo 2^32 */
    uint32_t now_us;            /* when the counts were read, wraps modulo 2^32 */
    /* One edge since the sample before: when it came, and the count that it left. */
    bool edge_dated[HAL_WHEELS];
    uint32_t edge_us[HAL_WHEELS];
    int32_t edge_from[HAL_WHEELS];
    uint32_t stray_edges[HAL_WHEELS]; /* edges since start-up that were dated and then taken back: noise */
    uint16_t battery_mv;              /* supply of the bridges, at the terminals, last finished conversion */
    bool battery_valid;               /* a conversion finished within the last 100 ms */
    bool supply_dip; /* the board's own supply is low, or was since the sample before: it brakes by itself */
    bool emergency_stop; /* the wired stop is open, or was: the bridges brake whatever hal_drive says */
};

struct hal_identity {
    uint8_t board_id[12]; /* unique device id, all zero where it cannot be read */
    uint32_t boot_id;     /* differs from one boot to the next */
    uint8_t reset_cause;  /* RCC_CSR bits 31:24 as found at reset */
    uint32_t cpu_hz;      /* the CPU clock that start-up settled on */
    bool memory_kept;     /* memory that resets leave alone was intact at start-up */
    bool program_fault;   /* the start followed a fault of the program, see hal_fault_record */
    bool was_moving;      /* memory was kept, and holds what hal_note_moving was last given: true */
    bool brown_out_reset; /* a sag of the board's own supply resets it before it errs */
    bool crystal_wrong;   /* it oscillates at another frequency than the image is made for, and is not used */
    bool clock_fallback;  /* the crystal or the PLL failed: timing has the accuracy of the RC oscillator */
};

/* Registers of the processor at the last fault of the program; kept through resets, not through power-off. */
struct hal_fault_record {
    uint32_t count;     /* faults since power-up */
    uint32_t exception; /* the processor's number of it */
    uint32_t has_frame; /* 0: the stack was lost, r0 to xpsr mean nothing */
    uint32_t r0, r1, r2, r3, r12, lr, pc, xpsr;
    uint32_t cfsr, hfsr, mmfar, bfar;
};

/* False: there was none. */
bool hal_fault_record(struct hal_fault_record *out);

/* Who this board is and how it came up; constant after start-up. */
void hal_identity(struct hal_identity *out);

/* Whether the robot drives, kept for the next start: a reset on the move is none that anybody wanted. */
void hal_note_moving(bool moving);

/* The sensors as of this tick; never blocks. For controller_tick: elsewhere a tick may come in between. */
void hal_sense(struct hal_sample *out);

/* The time now on the clock of hal_sample.now_us. */
uint32_t hal_now_us(void);

/* Applied effort, 1e-4 of supply, -10000..10000; drive/brake (slow decay), 0 = brake. */
void hal_drive(const int16_t effort_e4[HAL_WHEELS]);

/* The enable pin of the motor drivers, for those that have one. An open emergency stop takes it away by
 * itself, until hal_release_emergency_stop. */
void hal_enable_driver(bool enabled);

/* Lets the bridges follow hal_drive again after an emergency stop; false while the switch is open. */
bool hal_release_emergency_stop(void);

/* Takes up to `capacity` received bytes out of the link, of those that hal_link_peek has shown; returns how
 * many. */
size_t hal_link_read(uint8_t *out, size_t capacity);

/* The received bytes where they lie, for the tick, or with the tick held off: those since the last peek, or
 * their first part; returns how many, 0 once all have been shown. They stay to be read. */
size_t hal_link_peek(const uint8_t **bytes);

/* Whether hal_link_peek or hal_can_peek would show something: bytes or frames have come since. */
bool hal_has_unheard(void);

/* Queues bytes for sending; returns how many were taken (all or the part that fits). */
size_t hal_link_write(const uint8_t *data, size_t length);

/* A classic CAN frame with an 11-bit id. */
struct hal_can_frame {
    uint16_t id;
    uint8_t length;
    uint8_t data[8];
};

/* In the order of the schema's can_bus_state, which explains each. */
enum hal_can_state {
    HAL_CAN_OFF,
    HAL_CAN_JOINING,
    HAL_CAN_ACTIVE,
    HAL_CAN_WARNING,
    HAL_CAN_PASSIVE,
    HAL_CAN_BUS_OFF,
    HAL_CAN_NO_CRYSTAL
};

/* The CAN controller; its numbers count from start-up. */
struct hal_can_report {
    uint8_t state; /* enum hal_can_state */
    uint8_t transmit_errors;
    uint8_t receive_errors;
    uint8_t last_error; /* RM0090 CAN_ESR.LEC */
    uint32_t sent;
    uint32_t received;
    uint32_t overruns;
    uint32_t bus_offs;
    uint32_t discarded;
};

/* Joins the bus, or joins it anew, and lets in the frames with these two ids. Frames that waited to be sent
 * are lost. */
void hal_can_start(uint32_t bits_per_s, const uint16_t ids[2]);

/* The oldest frame received, of those that hal_can_peek has shown; false when there is none. */
bool hal_can_read(struct hal_can_frame *out);

/* The received frames one after the other, for the tick, or with the tick held off. They stay to be read. */
bool hal_can_peek(struct hal_can_frame *out);

/* Frames that hal_can_write takes now; none while the board is not on the bus. They leave in order. */
size_t hal_can_writable(void);
void hal_can_write(const struct hal_can_frame *frame);

void hal_can_report(struct hal_can_report *out);

/* Restarts the watchdog's count. */
void hal_watchdog_feed(void);

/* Memory that keeps its content without power: slots that are erased as a whole, to ones, and programmed word
 * by word, which only makes zeros of ones. Losing power meanwhile leaves what was being written undefined,
 * and nothing else. The wheels must be braked. */
enum { HAL_STORE_SLOTS = 2, HAL_STORE_SLOT_SIZE = 16384 };

/* The CPU is stalled for up to 0.8 s; `missed_ticks` are the control ticks that did not come and will not
 * come. False: the memory reported an error. */
bool hal_store_erase(uint32_t slot, uint32_t *missed_ticks);

/* One 32-bit word at a multiple of 4; the CPU is stalled for up to 0.1 ms. False: as above. */
bool hal_store_program(uint32_t slot, uint32_t offset, uint32_t word);

void hal_store_read(uint32_t slot, uint32_t offset, uint8_t *out, size_t length);

/* Two slots for an image of the firmware, in memory of the same kind; the image that runs lies in one. */
enum { HAL_IMAGE_SLOTS = 2 };
uint32_t hal_image_running(void);
uint32_t hal_image_size(void); /* bytes of a slot */
void hal_image_read(uint32_t slot, uint32_t offset, uint8_t *out, size_t length);

/* As hal_store_program. */
bool hal_image_program(uint32_t slot, uint32_t offset, uint32_t word);

/* A slot is erased in pieces; the CPU is stalled for up to 2 s for each. Not the slot that runs. */
uint32_t hal_image_sectors(uint32_t slot);
bool hal_image_erase(uint32_t slot, uint32_t sector, uint32_t *missed_ticks);

/* Starts the board anew. In a test it returns. */
void hal_restart(void);

/* Memory for the log, in up to two pieces; its initial content is undefined. */
enum { HAL_LOG_MEMORIES = 2 };
struct hal_memory {
    uint8_t *start;
    size_t size; /* bytes; 0: there is no such piece, which can only be so for the last */
};
void hal_log_memory(uint32_t piece, struct hal_memory *out);

/* Holds off the control tick; returns what hal_critical_exit needs to restore the state before. Nests. */
uint32_t hal_critical_enter(void);
void hal_critical_exit(uint32_t state);

#endif
