/* Runs image.c on Unicorn with the least around it: SysTick, one exception, cycles counted block by block.
 * Prints CPU seconds for the virtual seconds that are asked for. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unicorn/unicorn.h>

enum {
    FLASH = 0x08000000,
    FLASH_SIZE = 1 << 20,
    SRAM = 0x20000000,
    SRAM_SIZE = 128 << 10,
    FRAME = 8,
    SYSTICK = 15
};
#define HZ          168000000u
#define NO_END      0xFFFFFFF8u
#define EXC_RETURN  0xFFFFFFF9u
#define RETURN_PAGE 0xFFFFF000u

struct machine {
    uint64_t now, next_tick, period;
    uint32_t pc;
    int ticking, in_handler, ticks;
};

static const int stacked[FRAME] = {UC_ARM_REG_R0,  UC_ARM_REG_R1, UC_ARM_REG_R2, UC_ARM_REG_R3,
                                   UC_ARM_REG_R12, UC_ARM_REG_LR, UC_ARM_REG_PC, UC_ARM_REG_XPSR};

static void on_block(uc_engine *uc, uint64_t address, uint32_t size, void *user)
{
    struct machine *m = user;
    (void)address;
    m->now += size / 2;
    if (m->ticking && m->now >= m->next_tick) {
        uc_emu_stop(uc);
    }
}

static void on_interrupt(uc_engine *uc, uint32_t number, void *user)
{
    (void)number;
    (void)user;
    uc_emu_stop(uc);
}

static uint64_t read_zero(uc_engine *uc, uint64_t offset, unsigned size, void *user)
{
    (void)uc;
    (void)offset;
    (void)size;
    (void)user;
    return 0;
}

static void write_nothing(uc_engine *uc, uint64_t offset, unsigned size, uint64_t value, void *user)
{
    (void)uc;
    (void)offset;
    (void)size;
    (void)value;
    (void)user;
}

static void write_private(uc_engine *uc, uint64_t offset, unsigned size, uint64_t value, void *user)
{
    struct machine *m = user;
    (void)uc;
    (void)size;
    if (offset == 0xE014) {
        m->period = value + 1;
    } else if (offset == 0xE010 && (value & 1u) != 0) {
        m->ticking = 1;
        m->next_tick = m->now + m->period;
    }
}

static uint32_t get(uc_engine *uc, int id)
{
    uint32_t value = 0;
    uc_reg_read(uc, id, &value);
    return value;
}

static void enter(uc_engine *uc, struct machine *m)
{
    uint32_t frame[FRAME];
    for (int i = 0; i < FRAME; i++) {
        uc_reg_read(uc, stacked[i], &frame[i]);
    }
    frame[6] = m->pc;
    uint32_t sp = get(uc, UC_ARM_REG_SP) - sizeof frame;
    const uint32_t lr = EXC_RETURN;
    uc_mem_write(uc, sp, frame, sizeof frame);
    uc_reg_write(uc, UC_ARM_REG_SP, &sp);
    uc_reg_write(uc, UC_ARM_REG_LR, &lr);
    uc_mem_read(uc, FLASH + 4 * SYSTICK, &m->pc, 4);
    m->next_tick += m->period;
    m->in_handler = 1;
    m->ticks++;
}

static void leave(uc_engine *uc, struct machine *m)
{
    uint32_t frame[FRAME];
    uint32_t sp = get(uc, UC_ARM_REG_SP);
    uc_mem_read(uc, sp, frame, sizeof frame);
    for (int i = 0; i < 6; i++) {
        uc_reg_write(uc, stacked[i], &frame[i]);
    }
    uc_reg_write(uc, UC_ARM_REG_XPSR, &frame[7]);
    sp += sizeof frame;
    uc_reg_write(uc, UC_ARM_REG_SP, &sp);
    m->pc = frame[6];
    m->in_handler = 0;
}

static int run(uc_engine *uc, struct machine *m, uint64_t end)
{
    while (m->now < end) {
        if (uc_emu_start(uc, m->pc | 1u, NO_END, 0, 0) != UC_ERR_OK) {
            return 1;
        }
        m->pc = get(uc, UC_ARM_REG_PC);
        if (m->pc >= (EXC_RETURN & ~0xFu)) {
            leave(uc, m);
            continue;
        }
        if (!m->in_handler && m->now < m->next_tick) {
            m->now = m->next_tick; /* asleep */
        }
        if (m->ticking && m->now >= m->next_tick && !m->in_handler) {
            enter(uc, m);
        }
    }
    return 0;
}

int main(int argc, char **argv)
{
    static uint8_t flash[FLASH_SIZE];
    struct machine m = {0};
    uc_engine *uc;
    uc_hook hook;
    FILE *file = argc > 2 ? fopen(argv[1], "rb") : NULL;
    if (file == NULL || fread(flash, 1, sizeof flash, file) == 0) {
        return 2;
    }
    fclose(file);
    const double seconds = atof(argv[2]);
    if (uc_open(UC_ARCH_ARM, (uc_mode)(UC_MODE_THUMB | UC_MODE_MCLASS), &uc) != UC_ERR_OK) {
        return 2;
    }
    uc_ctl_set_cpu_model(uc, UC_CPU_ARM_CORTEX_M4);
    uc_mem_map(uc, FLASH, FLASH_SIZE, UC_PROT_ALL);
    uc_mem_write(uc, FLASH, flash, sizeof flash);
    uc_mem_map(uc, SRAM, SRAM_SIZE, UC_PROT_ALL);
    uc_mem_map(uc, RETURN_PAGE, 0x1000, UC_PROT_ALL);
    uc_mmio_map(uc, 0x40000000, 0x30000, read_zero, NULL, write_nothing, NULL);
    uc_mmio_map(uc, 0xE0000000, 0x100000, read_zero, NULL, write_private, &m);
    uc_hook_add(uc, &hook, UC_HOOK_BLOCK, (void *)on_block, &m, 1, 0);
    uc_hook_add(uc, &hook, UC_HOOK_INTR, (void *)on_interrupt, &m, 1, 0);
    uint32_t vectors[2];
    memcpy(vectors, flash, sizeof vectors);
    uc_reg_write(uc, UC_ARM_REG_SP, &vectors[0]);
    m.pc = vectors[1];
    const clock_t began = clock();
    const int failed = run(uc, &m, (uint64_t)(seconds * HZ));
    const double spent = (double)(clock() - began) / CLOCKS_PER_SEC;
    uc_close(uc);
    if (failed || m.ticks < (int)(seconds * 1000.0) - 2) {
        return 1;
    }
    printf("%.6f\n", spent);
    return 0;
}
