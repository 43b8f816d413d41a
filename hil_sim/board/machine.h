/* The state of the virtual board and the functions that its parts share. Only files of this folder include
 * it. */
#ifndef BOARD_MACHINE_H
#define BOARD_MACHINE_H

#include <assert.h>
#include <unicorn/unicorn.h>

#include "board.h"
#include "cpu_registers.h"

enum {
    FLASH_BASE = 0x08000000,
    FLASH_SIZE = 1024 * 1024,
    SRAM_BASE = 0x20000000,
    SRAM_SIZE = 128 * 1024,
    CCM_BASE = 0x10000000,
    CCM_SIZE = 64 * 1024,
    SYSTEM_BASE = 0x1FFF0000, /* ROM loader, unique id, flash size; the loader itself is not modelled */
    SYSTEM_SIZE = 32 * 1024,
    TIMERS = 14,
    USARTS = 3,
    ADCS = 3,
    DMAS = 2,
    DMA_STREAMS = 8,
    PORTS = 9,
    ENCODERS = 4,
    WATCHED_PINS = 16,
    WARNINGS = 64,
    BUS_REGIONS = 7,
    BUS_PAGES = 256,
    CODE_PAGE = 1024 /* the engine's page size for this CPU */
};
#define NEVER     UINT64_MAX
#define PS_PER_S  1000000000000ULL
#define PS_PER_US 1000000ULL
#define LSI_HZ    32000U
#define HSI_HZ    16000000U
#define IDCODE    0x10076413U /* DBGMCU_IDCODE of an STM32F405, revision 1 (RM0090 section 38.6.1) */
#define XPSR_IT   0x0600FC00u /* ITSTATE */

/* ---- exceptions (ARMv7-M, PM0214 section 2.3) ---- */
enum {
    EXC_THREAD = 0,
    EXC_NMI = 2,
    EXC_HARD_FAULT = 3,
    EXC_MEMORY_FAULT = 4,
    EXC_BUS_FAULT = 5,
    EXC_USAGE_FAULT = 6,
    EXC_SVC = 11,
    EXC_DEBUG = 12,
    EXC_PENDSV = 14,
    EXC_SYSTICK = 15,
    EXC_IRQ0 = 16
};
/* Interrupt numbers used here, RM0090 table 62. */
enum {
    IRQ_PVD = 1,
    IRQ_EXTI0 = 6,
    IRQ_ADC = 18,
    IRQ_CAN1_TX = 19,
    IRQ_EXTI9_5 = 23,
    IRQ_TIM1_UP = 25,
    IRQ_USART1 = 37,
    IRQ_EXTI15_10 = 40
};

/* ---- events: things that happen at a known time ---- */
enum event_id {
    EVENT_SYSTICK,
    EVENT_RCC_HSI,
    EVENT_RCC_HSE,
    EVENT_RCC_PLL,
    EVENT_RCC_LSI,
    EVENT_IWDG,
    EVENT_FLASH,
    EVENT_TIMER0, /* one for each timer */
    EVENT_USART_TX0 = EVENT_TIMER0 + TIMERS,
    EVENT_USART_RX0 = EVENT_USART_TX0 + USARTS,
    EVENT_USART_IDLE0 = EVENT_USART_RX0 + USARTS,
    EVENT_ADC0 = EVENT_USART_IDLE0 + USARTS,
    EVENT_ENCODER0 = EVENT_ADC0 + ADCS, /* one for each encoder */
    EVENT_CAN = EVENT_ENCODER0 + ENCODERS,
    EVENT_CAN_JOIN,
    EVENTS
};
static_assert(EVENTS <= 64, "one bit for each in events_set");

struct event {
    uint64_t at;    /* cycle, NEVER when idle */
    uint64_t at_ps; /* set for events in real time; they keep it when the CPU clock changes */
    bool in_ps;
};

/* The CPU clock: cycles since creation, and which picosecond the present frequency began at. */
struct clock {
    uint64_t segment_cycle;
    uint64_t segment_ps;
    uint32_t hz;
    uint64_t ps_numerator, ps_denominator, exact_cycles,
        exact_ps; /* the last two: spans that 64 bits convert */
};

struct nvic {
    uint32_t pending[4], active[4], enabled[4], line[4]; /* bit maps over exception numbers */
    uint8_t priority[BOARD_EXCEPTIONS];
    uint8_t prigroup;
    unsigned best;     /* most urgent pending and enabled exception, 0 none */
    int best_priority; /* its number within all; smaller is more urgent */
    int active_group;  /* group priority that now executes, masks aside; 256 in thread mode */
};

struct scb {
    uint32_t vtor, scr, ccr, shcsr, cfsr, hfsr, dfsr, mmfar, bfar, cpacr, fpccr, fpcar, fpdscr, demcr;
};

struct systick {
    uint32_t ctrl, load;
    uint64_t origin; /* cycle at which the counter stood at `from` */
    uint32_t from;
    bool count_flag;
};

struct dwt {
    uint32_t ctrl;
    uint64_t origin;
    uint64_t frozen_at; /* while the core is halted */
};

struct rcc {
    uint32_t cr, pllcfgr, cfgr, cir, bdcr, csr, sscgr, plli2scfgr;
    uint32_t rstr[5], enr[5], lpenr[5]; /* AHB1, AHB2, AHB3, APB1, APB2 */
    uint32_t hpre, ppre1, ppre2;        /* divisors in force */
};

enum { FLASH_LINE = 16, FLASH_STALE_LINES = 8 };
struct flash {
    uint32_t acr, sr, cr, optcr;
    uint8_t key_step, opt_key_step;
    uint64_t busy_until_ps;
    uint32_t stale_first, stale_end; /* changed since the engine's cache was last updated; end 0: nothing */
    struct operation {
        uint32_t first, length;
        uint64_t begin_ps, end_ps;
    } operation;     /* the last one */
    bool cache_used; /* the data cache was on since it was last emptied */
    struct flash_stale_line {
        uint32_t offset;
        uint8_t cached[FLASH_LINE], erased[FLASH_LINE];
    } stale_line[FLASH_STALE_LINES]; /* of the data cache, after an erase */
    uint32_t stale_lines;
};

/* Wait states of flash (flash_waits.c); lines are numbered from 1, and 0 is none. */
enum { FLASH_LINES = FLASH_SIZE / FLASH_LINE, FLASH_KEPT_LINES = 64, FLASH_LITERALS = 64 };
struct flash_cache {
    uint32_t line[FLASH_KEPT_LINES];
    uint64_t used[FLASH_KEPT_LINES]; /* cycle of its last use */
    uint8_t place[FLASH_LINES + 2];  /* of each line of flash, from 1; 0: not kept */
};
struct flash_waits {
    bool counted;
    uint32_t executed, prefetched;
    uint64_t prefetched_at,
        free_at; /* cycles: when that line is there, and when the array can be read again */
    struct flash_cache code, data;
    uint32_t literal[FLASH_LITERALS], literals; /* loaded by the block under way */
};

struct gpio {
    uint32_t moder, otyper, ospeedr, pupdr, odr, lckr, afr[2];
};

struct timer {
    uint32_t cr1, cr2, smcr, dier, sr, ccmr[2], ccer, psc, arr, rcr, ccr[4], bdtr, dcr, option;
    uint32_t psc_active, arr_active, ccr_active[4];
    uint64_t origin;    /* cycle at which the counter stood at `from` */
    uint32_t from;      /* position within the counting period, in ticks */
    uint32_t repeats;   /* overflows left until the next update event */
    int encoder_source; /* at channels 1 and 2: 0 none, +n encoder n, -n with its phases swapped */
    bool down;
    bool frozen; /* by a debugger */
    struct timer_input {
        bool level, passed; /* at the pin, and behind the filter */
        uint64_t due_ps;    /* when a level that differs will have passed */
    } input[2];
};

struct usart {
    uint32_t sr, brr, cr1, cr2, cr3, gtpr;
    uint8_t rdr, tdr, shift;
    bool sr_read; /* first half of the read-SR-then-DR sequence */
    bool tdr_full, shifting;
    struct inbound {
        uint64_t end_ps;
        float baud;
        uint8_t byte;
    } * inbound;
    size_t in_capacity, in_head, in_count;
    uint64_t line_free_ps; /* when the last byte queued so far has left the line */
};

/* usart_sampling.c */
enum { USART_OVER8 = 1 << 15, USART_ONEBIT = 1 << 11 }; /* of CR1 and CR3 */
struct usart_sampled {
    uint8_t byte;
    bool heard, noise, framing; /* heard: its start bit was recognised */
};

enum { CAN_MAILBOXES = 3, CAN_FIFO_DEPTH = 3, CAN_BANKS = 28, CAN_HAPPENINGS = 16 };
struct can {
    uint32_t mcr, msr, tsr, rfr[2], ier, esr_lec, btr;
    struct can_box {
        uint32_t ir, dtr, dlr, dhr;
    } tx[CAN_MAILBOXES], fifo[2][CAN_FIFO_DEPTH];
    uint64_t requested_ps[CAN_MAILBOXES];
    uint32_t fmr, fm1r, fs1r, ffa1r, fa1r, filter[CAN_BANKS][2];
    unsigned tec, rec;
    bool bus_off;
    int sending;              /* mailbox whose frame is on the bus, -1 none */
    uint64_t silent_until_ps; /* an error-passive node waits after its own frames */
    struct can_happening {
        uint64_t at_ps;
        uint8_t kind; /* enum board_can_outcome, or one of can.c */
        struct board_can_frame frame;
    } happening[CAN_HAPPENINGS];
    unsigned first, waiting;
    bool attached;
};

struct dma_stream {
    uint32_t cr, ndtr, par, m0ar, m1ar, fcr;
    uint32_t flags;       /* as they lie in LISR and HISR, from bit 0 */
    uint32_t items, done; /* in this round */
};

struct adc {
    uint32_t sr, cr1, cr2, smpr[2], sqr[3], htr, ltr, jsqr, dr;
    uint32_t rank; /* next conversion of the sequence */
    bool busy;
};

struct iwdg {
    uint32_t pr, rlr, pr_active, rlr_active;
    uint32_t pvu, rvu;
    bool running, unlocked, updating;
    uint64_t updating_until_ps, deadline_ps;
    uint64_t frozen_ps; /* since when a debugger holds it; 0: it counts */
};

struct exti {
    uint32_t imr, emr, rtsr, ftsr, pr;
};

/* A stretch of code that runs without a branch in between, as the CPU engine translated it. */
struct block {
    uint16_t cycles, instructions, size;
    uint8_t flags;
    uint8_t it_left; /* instructions of an IT block that follow after the end */
};
enum { BLOCK_KNOWN = 1, BLOCK_FP = 2, BLOCK_WAITS = 4 };

enum trap { TRAP_NONE = -1 };

/* Blocks of code as the interpreter has decoded them. */
struct code_block;
struct code_cache {
    struct code_block **at; /* one for each half-word of flash */
    struct code_chunk *chunks;
    uint32_t
        pages[FLASH_SIZE / CODE_PAGE / 32]; /* one bit for each page of flash that has gone into a block */
    bool stale;                             /* to be forgotten before the next block is looked for */
    struct code_block *running, *next;      /* next: NULL where the interpreter stops */
    enum thumb_stop {
        THUMB_LEAVES,   /* comes to code that is the engine's */
        THUMB_AT_BLOCK, /* something is due before the next block */
        THUMB_ESCAPES,  /* inside a block, before an instruction that is the engine's */
        THUMB_WAITS,    /* WFI */
        THUMB_NO_FP     /* at a block that uses the FPU while it is off */
    } stop;
};

struct region_of {
    struct board *board;
    uint32_t base;
};

struct board {
    struct core core;
    uc_engine *uc;
    struct board_options options;
    uint8_t *flash_array, *sram, *ccm, *system;
    uint8_t *flash_before; /* content before the operation under way */
    struct region_of region[BUS_REGIONS];
    uint8_t bus_page[BUS_PAGES];
    struct block *flash_blocks; /* one per half-word of flash */
    struct code_cache code;

    /* time */
    uint64_t now;      /* cycle at the beginning of the block that runs */
    uint64_t moment;   /* cycle that peripherals see: an event's own, or the access's */
    uint64_t break_at; /* first cycle at which the block hook must leave the engine */
    uint64_t target;   /* cycle up to which to run */
    uint64_t target_ps;
    volatile enum board_phase phase; /* read by another thread */
    uint64_t stall_until;            /* the CPU waits for flash */
    struct clock clock;
    struct event events[EVENTS];
    uint64_t events_set; /* one bit for each that is not idle */
    uint64_t next_event;
    bool in_event;

    /* CPU */
    struct block current; /* block under way; cycles 0 when none is */
    uint32_t block_pc;
    uint32_t sram_code_pages[SRAM_SIZE / CODE_PAGE / 32]; /* one bit for each page that code has run from */
    uint32_t accesses;                                    /* register accesses within the block */
    uint32_t it_left;                                     /* the next block begins inside an IT block */
    bool at_block, needs_check, reset_wanted, sleeping, locked_up, halted, clock_dead, powered, no_fp;
    bool engine_only;   /* nothing is interpreted */
    bool sram_has_code; /* one of these pages there is */
    bool resumes;       /* the engine goes on inside a block that has begun */
    bool tlb_stale;     /* the engine's translation cache has to be emptied between two blocks */
    bool it_stale;      /* the engine's ITSTATE may be out of date */
    enum board_reset reset_cause;
    int trap;
    bool fault_seen;
    uint32_t fault_address;
    int fault_type;
    struct nvic nvic;
    struct scb scb;
    struct systick systick;
    struct dwt dwt;

    /* peripherals */
    struct rcc rcc;
    uint32_t pwr_cr;
    uint32_t option_bytes; /* FLASH_OPTCR as it is loaded at a reset, without its lock */
    double supply_v;
    bool held;         /* the supply is too low: in reset */
    bool supply_low;   /* PWR_CSR.PVDO */
    bool powered_down; /* since the last start the supply was below the power-down threshold... */
    bool sram_lost;    /* ...and below what SRAM needs */
    struct flash flash;
    struct flash_waits flash_waits;
    struct gpio gpio[PORTS];
    uint8_t pin_in[PORTS][16];        /* enum board_level, by what is wired to the pins */
    bool usart_routed[2][USARTS + 1]; /* receivers, transmitters that a pin belongs to */
    bool can_routed[2];
    struct board_pin break_pin[TIMERS + 1]; /* routed to a timer's break input; port 0: none */
    struct can can;
    struct timer timer[TIMERS + 1]; /* TIM1 is [1] */
    struct usart usart[USARTS + 1];
    bool usart_noisy; /* usart_noise of the wires may answer other than 0 */
    struct dma_stream dma[DMAS][DMA_STREAMS];
    struct adc adc[ADCS + 1];
    uint32_t adc_ccr;
    struct iwdg iwdg;
    uint32_t lsi_hz;
    uint32_t hsi_hz; /* the internal high-speed oscillator's true frequency */
    uint32_t idcode;
    struct clock_capture {
        uint64_t source_mhz; /* edges are counted anew when one of these three changes */
        uint32_t edges_each;
        bool on;
        uint64_t since_ps, taken;
    } clock_capture;
    struct exti exti;
    uint32_t syscfg_memrmp, syscfg_pmc, syscfg_exticr[4], dbgmcu[3];
    uint32_t rng_cr;
    uint64_t rng_state;
    bool crystal_alive;
    bool pll_dead;
    bool flash_slow;
    bool adc_dead;
    uint32_t
        stuck[4]; /* request lines that are high whatever their peripherals say, over exception numbers */
    int64_t flash_cut_after;
    uint64_t tear_state;
    uint64_t cut_at_instruction; /* NEVER: not armed */

    /* wires */
    struct watched {
        struct board_pin pin;
        double duty;
        int timer, channel; /* whose output is routed to it; timer 0: none */
    } watched[WATCHED_PINS];
    size_t watched_count;
    struct wired_encoder {
        struct board_pin a, b;
        bool wired, noisy;
        int64_t position;   /* up to which its edges are taken in */
        uint8_t levels;     /* of its lines, A and B from bit 0 */
        uint64_t change_ps; /* before which these cannot change */
    } encoder[ENCODERS];
    uint32_t encoder_timers; /* one bit for each timer that counts an encoder */
    bool encoders_followed;

    /* accounting */
    uint64_t trace[2], trace_count, power_cycles;
    struct board_cost cost[BOARD_EXCEPTIONS];
    struct running {
        unsigned exception;
        uint64_t instructions, cycles;
    } running[BOARD_EXCEPTIONS + 1];
    size_t depth;
    uint64_t busy_cycles;                          /* that the CPU has spent with code and exceptions */
    uint64_t settled_instructions, settled_cycles; /* of these, what `running` has been charged with */
    struct board_stats stats;
    struct warning {
        char text[80];
        uint64_t hits;
        uint32_t key;
    } warnings[WARNINGS];
    size_t warning_count;
};

/* time.c */
void time_set_hz(struct board *b, uint32_t hz);
uint64_t time_to_ps(const struct board *b, uint64_t cycle);
uint64_t time_to_cycle(const struct board *b, uint64_t ps);
void event_at_cycle(struct board *b, unsigned id, uint64_t cycle);
void event_at_ps(struct board *b, unsigned id, uint64_t ps);
void event_cancel(struct board *b, unsigned id);
void events_run(struct board *b, uint64_t until);

/* cpu_registers.c */
uint32_t cpu_get(struct board *b, int reg);
void cpu_set(struct board *b, int reg, uint32_t value);

/* cpu.c */
bool cpu_open(struct board *b);
void cpu_reset(struct board *b);
void cpu_run(struct board *b);
void cpu_update_break(struct board *b);
bool cpu_begin_block(struct board *b, uint32_t pc);
void cpu_engine_read_state(struct board *b);
bool cpu_look_up(struct board *b);
void cpu_settle(struct board *b);
uint8_t *cpu_memory(const struct board *b, uint32_t address, size_t length, bool write);

/* exception.c */
bool exception_take_pending(struct board *b, uint32_t return_pc);
void exception_return(struct board *b, uint32_t exc_return);
void exception_fault(struct board *b, unsigned exception, uint32_t cfsr, uint32_t return_pc);
void exception_svc(struct board *b, uint32_t return_pc);

/* cycle_model.c */
void block_measure(const uint8_t *code, uint32_t size, uint32_t it_left, struct block *out);
void blocks_forget(struct board *b, uint32_t first, uint32_t length);
uint32_t instruction_cycles(uint16_t op, uint16_t second);

/* flash_cache.c */
void flash_cache_settle(struct board *b, uint32_t first, uint32_t length);
void flash_cache_erased(struct board *b, uint32_t first, uint32_t length);
void flash_cache_control(struct board *b);
void flash_cache_unlocked(struct board *b);

/* flash_waits.c */
uint32_t flash_waits_of_block(struct board *b, uint32_t pc, uint32_t size);
uint32_t flash_waits_of_chained_vector(const struct board *b);
void flash_waits_control(struct board *b, uint32_t acr);
void flash_waits_reset(struct board *b);

/* nvic.c, scb.c, systick.c */
void nvic_pend(struct board *b, unsigned exception, bool pending);
void nvic_set_stuck(struct board *b, unsigned irq, bool stuck);
void nvic_set_line(struct board *b, unsigned irq, bool high);
void nvic_set_active(struct board *b, unsigned exception, bool active);
bool nvic_bit(const uint32_t map[4], unsigned exception);
void nvic_refresh(struct board *b);
int nvic_group(const struct board *b, unsigned exception);
int nvic_execution_priority(struct board *b);
bool nvic_access(struct board *b, uint32_t offset, bool write, uint32_t *value, unsigned size);
bool scb_access(struct board *b, uint32_t offset, bool write, uint32_t *value, unsigned size);
bool systick_access(struct board *b, uint32_t offset, bool write, uint32_t *value);
void systick_event(struct board *b);
void systick_reset(struct board *b);
void systick_freeze(struct board *b, bool frozen);

/* bus.c */
uint64_t bus_read(uc_engine *uc, uint64_t offset, unsigned size, void *region);
void bus_write(uc_engine *uc, uint64_t offset, unsigned size, uint64_t value, void *region);
bool bus_map(struct board *b);
bool bus_access(struct board *b, uint32_t address, bool write, uint32_t *value, unsigned size);
void bus_master_access(struct board *b, uint32_t address, bool write, uint32_t *value, unsigned size);
void bus_reset_peripherals(struct board *b, unsigned rcc_bus, uint32_t bits);
void warn_once(struct board *b, uint32_t key, const char *format, ...) __attribute__((format(printf, 3, 4)));

/* one file each; false: no such register */
bool rcc_access(struct board *b, uint32_t offset, bool write, uint32_t *value);
void rcc_event(struct board *b, unsigned id);
void rcc_reset(struct board *b, uint32_t cause_flags);
void rcc_crystal_changed(struct board *b);
void rcc_clock_changed(struct board *b);
uint32_t rcc_timer_divisor(const struct board *b, int timer);
uint32_t rcc_usart_divisor(const struct board *b, int usart);
bool flash_access(struct board *b, uint32_t offset, bool write, uint32_t *value);
void flash_reset(struct board *b);
bool flash_store(struct board *b, uint32_t address, uint32_t size, uint64_t value);
void flash_forget_code(struct board *b);
void flash_event(struct board *b);
bool gpio_access(struct board *b, int port, uint32_t offset, bool write, uint32_t *value);
void gpio_reset(struct board *b, int port);
void pins_update(struct board *b);
bool has_break(int timer);
bool break_level(struct board *b, int timer);
void timer_break_update(struct board *b, int timer);
bool phase_level(int64_t position, bool is_b);
bool pin_of_timer(const struct board *b, int timer, int channel, struct board_pin *out);
void clock_capture_sync(struct board *b);
uint64_t rcc_hse_rtc_mhz(const struct board *b);
bool timer_access(struct board *b, int timer, uint32_t offset, bool write, uint32_t *value);
void timer_reset(struct board *b, int timer);
void timer_sync(struct board *b, int timer);
void timer_schedule(struct board *b, int timer);
void timer_event(struct board *b, int timer);
double timer_output(struct board *b, int timer, int channel);
bool timer_only_counts(const struct board *b);
bool timer_is_encoder(const struct board *b, int timer);
void timer_route_encoder(struct board *b, int timer);
void timer_line_edge(struct board *b, int encoder, int phase, bool high, uint64_t time_ps);
void timer_disc_turned(struct board *b, int encoder, int64_t counts);
void timer_inputs_pass(struct board *b, uint64_t time_ps);
uint64_t timer_inputs_await(const struct board *b, int encoder, uint64_t change_ps);
void timer_update_line(struct board *b, int timer);
uint8_t encoder_levels(struct board *b, int encoder);
/* A line among an encoder's levels; phase 0 is A, 1 is B. */
static inline bool encoder_line_is_high(uint32_t levels, int phase)
{
    return (levels >> phase & 1u) != 0;
}
void encoder_lines_begin(struct board *b);
void encoder_lines_follow(struct board *b);
void encoder_lines_schedule(struct board *b);
void encoder_lines_event(struct board *b);
bool usart_access(struct board *b, int usart, uint32_t offset, bool write, uint32_t *value);
void usart_reset(struct board *b, int usart);
void usart_tx_event(struct board *b, int usart);
void usart_rx_event(struct board *b, int usart);
void usart_idle_event(struct board *b, int usart);
void usart_drop_inbound(struct board *b, int usart);
void usart_dma_ready(struct board *b);
struct usart_sampled usart_sample(const struct board *b, int usart, const struct inbound *byte,
                                  const struct inbound *next, double bit_ps);
bool dma_access(struct board *b, int dma, uint32_t offset, bool write, uint32_t *value);
void dma_reset(struct board *b, int dma);
bool dma_serve_usart(struct board *b, int usart, bool transmit);
bool can_access(struct board *b, uint32_t offset, bool write, uint32_t *value);
void can_reset(struct board *b);
void can_event(struct board *b);
void can_join_event(struct board *b);
bool adc_access(struct board *b, uint32_t offset, bool write, uint32_t *value);
void adc_set_dead(struct board *b, bool dead);
void adc_reset(struct board *b);
void adc_event(struct board *b, int adc);
bool iwdg_access(struct board *b, uint32_t offset, bool write, uint32_t *value);
void iwdg_reset(struct board *b);
void iwdg_event(struct board *b);
void iwdg_freeze(struct board *b, bool frozen);
bool rng_access(struct board *b, uint32_t offset, bool write, uint32_t *value);
bool exti_access(struct board *b, uint32_t offset, bool write, uint32_t *value);
void exti_reset(struct board *b);
void exti_sync(struct board *b);
bool exti_awaits(const struct board *b, const struct wired_encoder *encoder);
bool syscfg_access(struct board *b, uint32_t offset, bool write, uint32_t *value);
void exti_edge(struct board *b, uint32_t line, bool rises);
void exti_pin_edge(struct board *b, struct board_pin pin, bool rises);
void board_hold(struct board *b);
void board_release(struct board *b, bool sram_lost, bool powered_down);
void supply_follow(struct board *b);
bool pwr_access(struct board *b, uint32_t offset, bool write, uint32_t *value);
void dbgmcu_freeze_timers(struct board *b);
bool dbgmcu_access(struct board *b, uint32_t offset, bool write, uint32_t *value);

/* trace.c */
enum trace_kind {
    TRACE_PIN = 1,
    TRACE_TX,
    TRACE_RX,
    TRACE_ADC,
    TRACE_ENCODER,
    TRACE_RESET,
    TRACE_CAN_TX,
    TRACE_CAN_RX
};
void trace_add(struct board *b, enum trace_kind kind, uint32_t source, uint64_t value);

#endif
