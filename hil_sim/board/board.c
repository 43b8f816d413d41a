/* The whole board: creation, power, reset, and running it to a time. */
#include <stdlib.h>
#include <string.h>

#include "thumb.h"

/* RCC_CSR flags of each cause; every reset also pulls NRST (RM0090 7.1.2). */
static const uint32_t cause_flags[] = {[BOARD_RESET_POWER] = 0x0E000000u,
                                       [BOARD_RESET_BROWNOUT] = 0x06000000u,
                                       [BOARD_RESET_PIN] = 0x04000000u,
                                       [BOARD_RESET_SOFTWARE] = 0x14000000u,
                                       [BOARD_RESET_WATCHDOG] = 0x24000000u};

static const double nominal_v = 3.3;
/* RM0090 section 3.9.10, without the lock: no protection, brown-out reset off. */
enum { FACTORY_OPTIONS = 0x0FFFAAEC };

static void fill_noise(uint8_t *memory, size_t length, uint64_t seed)
{
    uint64_t state = seed * 0x9E3779B97F4A7C15ULL + 1;
    for (size_t i = 0; i + 8 <= length; i += 8) {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        memcpy(memory + i, &state, 8);
    }
}

/* Unique id and flash size sit in the system memory (RM0090 section 39). */
static void fill_system(struct board *b)
{
    const uint16_t flash_kib = FLASH_SIZE / 1024;
    memset(b->system, 0xFF, SYSTEM_SIZE);
    memcpy(b->system + 0x7A10, b->options.unique_id, sizeof b->options.unique_id);
    memcpy(b->system + 0x7A22, &flash_kib, sizeof flash_kib);
}

struct board *board_create(const struct board_options *options)
{
    struct board *b = calloc(1, sizeof *b);
    if (b == NULL) {
        return NULL;
    }
    b->options = *options;
    b->flash_array = aligned_alloc(4096, FLASH_SIZE);
    b->flash_before = malloc(FLASH_SIZE);
    b->sram = aligned_alloc(4096, SRAM_SIZE);
    b->ccm = aligned_alloc(4096, CCM_SIZE);
    b->system = aligned_alloc(4096, SYSTEM_SIZE);
    b->flash_blocks = calloc(FLASH_SIZE / 2, sizeof *b->flash_blocks);
    b->code.at = calloc(FLASH_SIZE / 2, sizeof(struct code_block *));
    b->crystal_alive = true;
    b->supply_v = nominal_v;
    b->option_bytes = FACTORY_OPTIONS;
    b->flash_cut_after = -1;
    b->cut_at_instruction = NEVER;
    b->next_event = NEVER;
    for (unsigned i = 0; i < EVENTS; i++) {
        b->events[i].at = NEVER;
    }
    b->hsi_hz = HSI_HZ;
    b->idcode = IDCODE;
    time_set_hz(b, b->hsi_hz);
    bool memory = b->flash_array != NULL && b->flash_before != NULL && b->sram != NULL && b->ccm != NULL &&
                  b->system != NULL && b->flash_blocks != NULL && b->code.at != NULL;
    if (!memory || !cpu_open(b)) {
        board_destroy(b);
        return NULL;
    }
    memset(b->flash_array, 0xFF, FLASH_SIZE);
    fill_system(b);
    b->lsi_hz = LSI_HZ;
    b->tear_state = options->seed * 0x9E3779B97F4A7C15ULL | 1u;
    b->rng_state = options->seed * 0xD1342543DE82EF95ULL + 0x9E3779B97F4A7C15ULL;
    return b;
}

void board_destroy(struct board *board)
{
    if (board == NULL) {
        return;
    }
    if (board->uc != NULL) {
        uc_close(board->uc);
    }
    for (int i = 1; i <= USARTS; i++) {
        free(board->usart[i].inbound);
    }
    free(board->flash_array);
    free(board->flash_before);
    free(board->sram);
    free(board->ccm);
    free(board->system);
    free(board->flash_blocks);
    if (board->code.at != NULL) {
        thumb_forget(board);
    }
    free(board->code.at);
    free(board);
}

bool board_flash(struct board *board, uint32_t address, const uint8_t *data, size_t length)
{
    uint32_t offset = address - FLASH_BASE;
    if (offset >= FLASH_SIZE || length > FLASH_SIZE - offset) {
        return false;
    }
    memcpy(board->flash_array + offset, data, length);
    blocks_forget(board, offset & ~1u, (uint32_t)(length + 1) & ~1u);
    uc_ctl_flush_tb(board->uc);
    return true;
}

static void reset_peripherals(struct board *b, enum board_reset cause)
{
    uint32_t demcr = b->scb.demcr;
    b->nvic = (struct nvic){.enabled = {0xFFFFu}, .active_group = 256, .best_priority = 256};
    b->scb = (struct scb){.ccr = 0x200, .fpccr = 0xC0000000u};
    b->scb.demcr = cause == BOARD_RESET_POWER ? 0 : demcr; /* only power-on clears the debug unit */
    rcc_reset(b, cause_flags[cause]);
    iwdg_reset(b);
    systick_reset(b);
    flash_reset(b);
    for (int i = 1; i <= TIMERS; i++) {
        timer_reset(b, i);
    }
    for (int i = 0; i < PORTS; i++) {
        gpio_reset(b, i);
    }
    for (int i = 1; i <= USARTS; i++) {
        usart_reset(b, i);
    }
    for (int i = 1; i <= DMAS; i++) {
        dma_reset(b, i);
    }
    adc_reset(b);
    can_reset(b);
    exti_reset(b);
    b->pwr_cr = 0x4000u;
    b->supply_low = false;
    b->rng_cr = 0;
    if (cause == BOARD_RESET_POWER) {
        b->halted = false;
        memset(b->dbgmcu, 0, sizeof b->dbgmcu);
    }
    b->syscfg_memrmp = b->syscfg_pmc = 0;
    memset(b->syscfg_exticr, 0, sizeof b->syscfg_exticr);
    dbgmcu_freeze_timers(b);
    nvic_refresh(b);
}

void board_reset(struct board *board, enum board_reset cause)
{
    board->reset_wanted = false;
    if (!board->powered) {
        return;
    }
    if (board->moment < board->now) {
        board->moment = board->now;
    }
    board->now = board->moment;
    board->stats.resets++;
    trace_add(board, TRACE_RESET, (uint32_t)cause, board->stats.resets);
    board->clock_dead = false;
    reset_peripherals(board, cause);
    if (cause == BOARD_RESET_POWER) {
        board->rcc.csr = cause_flags[cause];
    }
    cpu_reset(board);
    pins_update(board);
    cpu_update_break(board);
}

static void lose_memory(struct board *b)
{
    const uint64_t seed = b->options.seed + 1000003u * b->power_cycles++;
    fill_noise(b->sram, SRAM_SIZE, seed);
    fill_noise(b->ccm, CCM_SIZE, seed + 7919u);
    uc_ctl_flush_tb(b->uc);
}

void board_power(struct board *board, bool on)
{
    board->supply_v = on ? nominal_v : 0.0;
    board->held = false;
    if (on && !board->powered) {
        board_release(board, true, true);
    } else if (!on && board->powered) {
        board_hold(board);
    }
    board->sram_lost = board->powered_down = false;
}

/* Reset by the supply, and held there. */
void board_hold(struct board *b)
{
    reset_peripherals(b, BOARD_RESET_BROWNOUT);
    b->powered = false;
    b->needs_check = true; /* leave the engine at the next block */
    pins_update(b);
    cpu_update_break(b);
}

void board_release(struct board *b, bool sram_lost, bool powered_down)
{
    b->powered = true;
    if (sram_lost) {
        lose_memory(b);
    }
    board_reset(b, powered_down ? BOARD_RESET_POWER : BOARD_RESET_BROWNOUT);
}

void board_set_crystal(struct board *board, bool alive)
{
    if (board->crystal_alive != alive) {
        board->crystal_alive = alive;
        if (board->powered) {
            rcc_crystal_changed(board);
        }
    }
}

void board_set_crystal_hz(struct board *board, uint32_t hz)
{
    board->options.crystal_hz = hz;
    if (board->powered) {
        rcc_clock_changed(board);
    }
}

void board_set_pll_dead(struct board *board, bool dead)
{
    board->pll_dead = dead;
}

void board_set_hsi_hz(struct board *board, uint32_t hz)
{
    board->hsi_hz = hz;
    if (board->powered) {
        rcc_clock_changed(board);
    }
}

void board_set_idcode(struct board *board, uint32_t idcode)
{
    board->idcode = idcode;
}

void board_set_flash_slow(struct board *board, bool slow)
{
    board->flash_slow = slow;
}

void board_set_adc_dead(struct board *board, bool dead)
{
    adc_set_dead(board, dead);
}

void board_set_engine_only(struct board *board, bool only)
{
    board->engine_only = only;
    board->code.stale = true;
}

void board_set_interrupt_stuck(struct board *board, unsigned irq, bool stuck)
{
    if (EXC_IRQ0 + irq < BOARD_EXCEPTIONS) {
        nvic_set_stuck(board, irq, stuck);
    }
}

void board_cut_power_at_flash_write(struct board *board, int64_t operations)
{
    board->flash_cut_after = operations;
}

void board_cut_power_at_instruction(struct board *board, int64_t instructions)
{
    board->cut_at_instruction = instructions < 0 ? NEVER : board->stats.instructions + (uint64_t)instructions;
    cpu_update_break(board);
}

void board_run_until(struct board *board, uint64_t time_ps)
{
    if (time_ps <= board->target_ps) {
        return;
    }
    board->target_ps = time_ps;
    board->target = time_to_cycle(board, time_ps);
    cpu_update_break(board);
    const enum board_phase before = board_enter(board, BOARD_CODE);
    cpu_run(board);
    encoder_lines_follow(board);
    board_enter(board, before);
}

enum board_phase board_phase(const struct board *board)
{
    return board->phase;
}

enum board_phase board_enter(struct board *board, enum board_phase phase)
{
    const enum board_phase before = board->phase;
    board->phase = phase;
    return before;
}

bool board_read_memory(const struct board *board, uint32_t address, uint8_t *out, size_t length)
{
    const uint8_t *memory = cpu_memory(board, address, length, false);
    if (memory != NULL) {
        memcpy(out, memory, length);
    }
    return memory != NULL;
}

bool board_write_memory(struct board *board, uint32_t address, const uint8_t *data, size_t length)
{
    uint8_t *memory = cpu_memory(board, address, length, true);
    if (memory != NULL) {
        memcpy(memory, data, length);
        uc_ctl_remove_cache(board->uc, address, (uint64_t)address + length);
    }
    return memory != NULL;
}

void board_set_stack_pointer(struct board *board, uint32_t value)
{
    cpu_set(board, UC_ARM_REG_SP, value & ~3u);
}

void board_cost(const struct board *board, unsigned exception, struct board_cost *out)
{
    *out = exception < BOARD_EXCEPTIONS ? board->cost[exception] : (struct board_cost){0};
    const struct running *top = &board->running[board->depth];
    if (top->exception == exception) { /* what it has not been charged with yet */
        out->instructions += board->stats.instructions - board->settled_instructions;
        out->cycles += board->busy_cycles - board->settled_cycles;
    }
    for (size_t i = 0; i <= board->depth && exception < BOARD_EXCEPTIONS; i++) {
        if (board->running[i].exception == exception) {
            out->instructions += board->running[i].instructions;
            out->cycles += board->running[i].cycles;
        }
    }
}

void board_stats(const struct board *board, struct board_stats *out)
{
    *out = board->stats;
    out->cycles = board->now;
    out->cpu_hz = board->clock.hz;
    out->locked_up = board->locked_up;
    out->powered = board->powered;
}
