/* The virtual board: an STM32F405 that runs the image that is flashed, modelled at its pins and its
 * supply. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#pragma GCC visibility push(default)

struct board;

/* A package pin, for example {'B', 10}. */
struct board_pin {
    char port;
    uint8_t number;
};

enum board_reset {
    BOARD_RESET_POWER,    /* power-on: SRAM holds noise afterwards */
    BOARD_RESET_BROWNOUT, /* supply dipped: SRAM keeps its content */
    BOARD_RESET_PIN,      /* NRST pulled low */
    BOARD_RESET_SOFTWARE, /* AIRCR.SYSRESETREQ */
    BOARD_RESET_WATCHDOG  /* IWDG ran out */
};

/* What is soldered around the chip. Every time is virtual, in picoseconds since creation. */
struct board_wires {
    void *context;
    /* A watched pin's drive changed: fraction of time it is high (0, 1, or the PWM duty), or below 0: not
     * driven. */
    void (*pin_driven)(void *context, struct board_pin pin, double duty, uint64_t time_ps);
    /* Position of an encoder wired with board_wire_encoder, in quadrature counts (x4). */
    int64_t (*encoder_position)(void *context, int encoder, uint64_t time_ps);
    /* Which of its lines are at the wrong level at that time, as by a disturbance: A bit 0, B bit 1. May be
     * NULL. */
    uint8_t (*encoder_noise)(void *context, int encoder, uint64_t time_ps);
    /* A later time before which neither can change; they may change there. */
    uint64_t (*encoder_quiet_until)(void *context, int encoder, uint64_t time_ps);
    /* Voltage at an analogue pin. */
    double (*pin_voltage)(void *context, struct board_pin pin, uint64_t time_ps);
    /* A byte left the transmitter of USART 1..3; line_baud is what the divider makes of the clock. */
    void (*usart_sent)(void *context, int usart, uint8_t byte, double line_baud, uint64_t time_ps);
    /* Whether the level at a receiver is the wrong one at that time, as by a disturbance. May be NULL. */
    bool (*usart_noise)(void *context, int usart, uint64_t time_ps);
};

/* A frame of classic CAN. */
struct board_can_frame {
    uint32_t id; /* 11 or 29 bits */
    bool extended, remote;
    uint8_t length; /* bytes of data, 0 to 8 */
    uint8_t data[8];
};

struct board_options {
    uint64_t seed; /* of SRAM noise at power-on and of the random number generator */
    uint8_t unique_id[12];
    uint32_t crystal_hz; /* 0: no crystal ever starts */
    struct board_wires wires;
};

/* NULL when the CPU engine cannot be opened. */
struct board *board_create(const struct board_options *options);
void board_destroy(struct board *board);

/* Writes an image into flash as a programmer would, before power-on. False: outside flash. */
bool board_flash(struct board *board, uint32_t address, const uint8_t *data, size_t length);

void board_watch_pin(struct board *board, struct board_pin pin);
/* Wires encoder (0..3) with phase A to one pin and phase B to another. */
void board_wire_encoder(struct board *board, int encoder, struct board_pin a, struct board_pin b);
/* What encoder_quiet_until has said of this encoder does not hold any more. Noisy: encoder_noise may answer
 * other than 0 from now on. */
void board_encoder_disturbed(struct board *board, int encoder, bool noisy);

/* What is wired to a pin: low, high, or nothing, in which case its pull resistor decides. */
enum board_level { BOARD_OPEN, BOARD_LOW, BOARD_HIGH };
void board_set_pin(struct board *board, struct board_pin pin, enum board_level level);

/* The chip's supply, 3.3 V while it is on. Below a threshold of the option bytes' the chip is held in reset;
 * below 1.2 V its SRAM is noise afterwards. */
void board_set_supply(struct board *board, double volts);
/* FLASH_OPTCR as it is loaded at a reset; as a programmer would set it. Factory: 0x0FFFAAEC. */
void board_set_option_bytes(struct board *board, uint32_t option_bytes);
uint32_t board_option_bytes(const struct board *board);

/* Supply and reset button. */
void board_power(struct board *board, bool on);
void board_reset(struct board *board, enum board_reset cause);

/* The crystal stops (or starts) now. */
void board_set_crystal(struct board *board, bool alive);
/* The crystal's true frequency from now on, not the nominal one. */
void board_set_crystal_hz(struct board *board, uint32_t hz);
/* From its next start on the PLL never locks. */
void board_set_pll_dead(struct board *board, bool dead);
/* The internal high-speed oscillator's true frequency from now on; 16 MHz within 8 % below and 4.5 % above on
 * the chip. */
void board_set_hsi_hz(struct board *board, uint32_t hz);
/* What DBGMCU_IDCODE reads: 0x10076413 at first. Revision A of an STM32F405 reads 0x20006411. */
void board_set_idcode(struct board *board, uint32_t idcode);
/* The internal low-speed oscillator's true frequency, 17 to 47 kHz on the chip; from the next reset on. */
void board_set_lsi_hz(struct board *board, uint32_t hz);
/* A debugger halts the core, or lets it go on; what DBGMCU freezes stops with it. */
void board_set_halted(struct board *board, bool halted);
/* From now on the cycles of code in flash include its wait states; the emulation gets slower by it. False:
 * the CPU engine refuses. */
bool board_count_flash_waits(struct board *board);
/* Flash takes the longest times of the datasheet instead of the typical ones. */
void board_set_flash_slow(struct board *board, bool slow);
/* From now on no conversion of any ADC ends. */
void board_set_adc_dead(struct board *board, bool dead);
/* An interrupt's request line is stuck: its handler is called again as soon as it has returned. */
/* Every instruction goes to the CPU engine, none to the interpreter: slow, and the same. */
void board_set_engine_only(struct board *board, bool only);
void board_set_interrupt_stuck(struct board *board, unsigned irq, bool stuck);
/* The flash operation after this many more stops half way, at a point drawn by the seed, and the board loses
 * power; negative: never. Power that fails, or a reset that comes, at any other time tears the operation
 * under way by the share of its time gone by. Torn means: each bit that was to change has changed or not, by
 * a random draw. */
void board_cut_power_at_flash_write(struct board *board, int64_t operations);
/* The board loses power after this many more instructions, at the end of the stretch of code without a branch
   in which the last one lies; negative: never. */
void board_cut_power_at_instruction(struct board *board, int64_t instructions);

/* Runs until the given virtual time; how a span is split into calls changes nothing. */
void board_run_until(struct board *board, uint64_t time_ps);
uint64_t board_time_ps(const struct board *board);

/* A byte comes in on the line of USART 1..3, start bit at the given time or when the line is free again. */
void board_usart_receive(struct board *board, int usart, uint8_t byte, double line_baud, uint64_t start_ps);
/* usart_noise may answer true from now on. */
void board_usart_disturbed(struct board *board, bool noisy);
/* Bytes that have not yet been clocked in completely. */
size_t board_usart_inbound(const struct board *board, int usart);

/* CAN1, as the bus sees it. Unattached, its receive line is held dominant: the controller never joins. */
void board_can_attach(struct board *board, bool attached);
/* The frame that the controller sends next, and since when it waits; false: none, or it is not on the bus. */
bool board_can_offer(const struct board *board, struct board_can_frame *frame, uint64_t *since_ps);
/* How a node divides a bit: quanta up to its sample point and after it, and the most that an edge moves it.
 */
struct board_can_timing {
    double bit_ps;
    uint32_t before, after, jump;
};
/* False: it does not listen to the bus. `acknowledges`: it is not in silent mode. */
bool board_can_timing(const struct board *board, struct board_can_timing *timing, bool *acknowledges);

enum board_can_outcome { BOARD_CAN_SENT, BOARD_CAN_UNACKNOWLEDGED, BOARD_CAN_DAMAGED };
/* Reports the outcome of that frame, effective at that time. Until then the controller sends nothing else. */
void board_can_conclude(struct board *board, enum board_can_outcome outcome, uint64_t end_ps);
/* A frame of another node ends at that time. Damaged: an error frame ended it. */
void board_can_deliver(struct board *board, const struct board_can_frame *frame, bool damaged,
                       uint64_t end_ps);
/* Bits of the frame including stuff bits, without the three bits of intermission after it. */
uint32_t board_can_bits(const struct board_can_frame *frame);
/* Its levels on the wire up to the acknowledgment, one byte each, 1 recessive; returns how many. */
enum { BOARD_CAN_BITS_MAX = 192 };
uint32_t board_can_wire(const struct board_can_frame *frame, uint8_t out[BOARD_CAN_BITS_MAX]);

/* Memory as a debugger sees it: no side effects on registers. False: not memory. */
bool board_read_memory(const struct board *board, uint32_t address, uint8_t *out, size_t length);
bool board_write_memory(struct board *board, uint32_t address, const uint8_t *data, size_t length);

/* The stack pointer in use, as a debugger sets it. */
void board_set_stack_pointer(struct board *board, uint32_t value);
/* A register as a debugger reads it, with what reading does to it. */
uint32_t board_read_register(struct board *board, uint32_t address);

/* Hash over all time-stamped events at the pins so far, 128 bits. */
void board_trace_hash(const struct board *board, uint64_t out[2]);
uint64_t board_trace_count(const struct board *board);

/* When SysTick next reaches zero, picoseconds of virtual time; UINT64_MAX: never. */
uint64_t board_next_tick_ps(const struct board *board);

enum { BOARD_EXCEPTIONS = 98 }; /* 16 of the CPU, 82 of the chip */

/* Cost of one exception number (0: thread mode). Nested exceptions are not counted in. */
struct board_cost {
    uint64_t activations;
    uint64_t instructions;
    uint64_t worst_instructions; /* of one activation */
    uint64_t cycles;
    uint64_t worst_cycles;
};
void board_cost(const struct board *board, unsigned exception, struct board_cost *out);

struct board_stats {
    uint64_t cycles;       /* of the CPU clock, asleep or not */
    uint64_t sleep_cycles; /* in WFI */
    uint64_t instructions;
    uint64_t interrupts;
    uint64_t tail_chains;
    uint64_t registers; /* peripheral accesses */
    uint64_t resets;
    uint32_t cpu_hz;
    bool locked_up; /* a fault inside the hard fault handler: only a reset helps */
    bool powered;
};
void board_stats(const struct board *board, struct board_stats *out);

/* What the process is busy with in board_run_until, for a profiler that asks from another thread. */
enum board_phase { BOARD_OUTSIDE, BOARD_CODE, BOARD_INTERRUPTS, BOARD_PERIPHERALS, BOARD_PLANT };
enum board_phase board_phase(const struct board *board);
/* A callback tells what it does; returns the phase before, to go back to. */
enum board_phase board_enter(struct board *board, enum board_phase phase);

/* Warnings so far: registers not modelled, peripherals without clock, pins not routed. One line each, NULL
 * past the end; `hits` counts the occurrences. */
const char *board_warning(const struct board *board, size_t index, uint64_t *hits);

#pragma GCC visibility pop

#endif
