/* The buses: which peripheral lies at which address, whether it has a clock, and what is not modelled. */
#include "machine.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum { AHB1, AHB2, AHB3, APB1, APB2, ALWAYS }; /* index into rcc.enr */

enum kind { GPIO, TIMER, USART, ADC, RCC, FLASH, PWR, IWDG, SYSCFG, EXTI, CAN, DMA };

struct peripheral {
    const char *name;
    uint32_t base;
    uint8_t kind, number, bus, bit;
};

/* Register boundaries from RM0090 table 1, clock enable bits from section 7.3. */
static const struct peripheral peripherals[] = {
    {"TIM2", 0x40000000, TIMER, 2, APB1, 0},     {"TIM3", 0x40000400, TIMER, 3, APB1, 1},
    {"TIM4", 0x40000800, TIMER, 4, APB1, 2},     {"TIM5", 0x40000C00, TIMER, 5, APB1, 3},
    {"TIM6", 0x40001000, TIMER, 6, APB1, 4},     {"TIM7", 0x40001400, TIMER, 7, APB1, 5},
    {"TIM12", 0x40001800, TIMER, 12, APB1, 6},   {"TIM13", 0x40001C00, TIMER, 13, APB1, 7},
    {"TIM14", 0x40002000, TIMER, 14, APB1, 8},   {"IWDG", 0x40003000, IWDG, 0, ALWAYS, 0},
    {"USART2", 0x40004400, USART, 2, APB1, 17},  {"USART3", 0x40004800, USART, 3, APB1, 18},
    {"CAN1", 0x40006400, CAN, 1, APB1, 25},      {"PWR", 0x40007000, PWR, 0, APB1, 28},
    {"TIM1", 0x40010000, TIMER, 1, APB2, 0},     {"TIM8", 0x40010400, TIMER, 8, APB2, 1},
    {"USART1", 0x40011000, USART, 1, APB2, 4},   {"ADC", 0x40012000, ADC, 0, APB2, 8},
    {"SYSCFG", 0x40013800, SYSCFG, 0, APB2, 14}, {"EXTI", 0x40013C00, EXTI, 0, ALWAYS, 0},
    {"TIM9", 0x40014000, TIMER, 9, APB2, 16},    {"TIM10", 0x40014400, TIMER, 10, APB2, 17},
    {"TIM11", 0x40014800, TIMER, 11, APB2, 18},  {"GPIOA", 0x40020000, GPIO, 0, AHB1, 0},
    {"GPIOB", 0x40020400, GPIO, 1, AHB1, 1},     {"GPIOC", 0x40020800, GPIO, 2, AHB1, 2},
    {"GPIOD", 0x40020C00, GPIO, 3, AHB1, 3},     {"GPIOE", 0x40021000, GPIO, 4, AHB1, 4},
    {"GPIOF", 0x40021400, GPIO, 5, AHB1, 5},     {"GPIOG", 0x40021800, GPIO, 6, AHB1, 6},
    {"GPIOH", 0x40021C00, GPIO, 7, AHB1, 7},     {"GPIOI", 0x40022000, GPIO, 8, AHB1, 8},
    {"RCC", 0x40023800, RCC, 0, ALWAYS, 0},      {"FLASH", 0x40023C00, FLASH, 0, ALWAYS, 0},
    {"DMA1", 0x40026000, DMA, 1, AHB1, 21},      {"DMA2", 0x40026400, DMA, 2, AHB1, 22},
};
enum { PERIPHERALS = sizeof peripherals / sizeof peripherals[0], ACCESS_CYCLES = 2 };

/* Regions of the address map that have registers; everything else faults. */
static const struct region {
    uint32_t base, size;
} regions[] = {{0x40000000, 0x8000},   {0x40010000, 0x5000},    {0x40020000, 0x60000}, {0x50000000, 0x61000},
               {0xE0000000, 0x100000}, {0x42000000, 0x2000000}, {0x22000000, 0x400000}};

void warn_once(struct board *b, uint32_t key, const char *format, ...)
{
    for (size_t i = 0; i < b->warning_count; i++) {
        if (b->warnings[i].key == key) {
            b->warnings[i].hits++;
            return;
        }
    }
    if (b->warning_count == WARNINGS) {
        return;
    }
    struct warning *w = &b->warnings[b->warning_count++];
    w->key = key;
    w->hits = 1;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(w->text, sizeof w->text, format, arguments);
    va_end(arguments);
}

const char *board_warning(const struct board *board, size_t index, uint64_t *hits)
{
    if (index >= board->warning_count) {
        return NULL;
    }
    *hits = board->warnings[index].hits;
    return board->warnings[index].text;
}

/* One byte for each KiB from 0x40000000 on: number of the peripheral plus one, 0 for none. */
static const struct peripheral *find(const struct board *b, uint32_t address)
{
    uint32_t page = (address - 0x40000000u) >> 10;
    return page < BUS_PAGES && b->bus_page[page] != 0 ? &peripherals[b->bus_page[page] - 1] : NULL;
}

static bool has_clock(const struct board *b, const struct peripheral *p)
{
    if (p->kind == ADC) {
        return (b->rcc.enr[APB2] & 7u << 8) != 0;
    }
    return p->bus == ALWAYS || (b->rcc.enr[p->bus] >> p->bit & 1u) != 0;
}

static void reset_one(struct board *b, const struct peripheral *p)
{
    switch (p->kind) {
    case GPIO:
        gpio_reset(b, p->number);
        break;
    case TIMER:
        timer_reset(b, p->number);
        break;
    case USART:
        usart_reset(b, p->number);
        break;
    case ADC:
        adc_reset(b);
        break;
    case CAN:
        can_reset(b);
        break;
    case DMA:
        dma_reset(b, p->number);
        break;
    default:
        break;
    }
}

/* The RCC's reset registers: bits of one bus that go high reset its peripherals. */
void bus_reset_peripherals(struct board *b, unsigned rcc_bus, uint32_t bits)
{
    for (size_t i = 0; i < PERIPHERALS; i++) {
        if (peripherals[i].bus == rcc_bus && (bits >> peripherals[i].bit & 1u) != 0) {
            reset_one(b, &peripherals[i]);
        }
    }
}

static bool access_peripheral(struct board *b, const struct peripheral *p, uint32_t offset, bool write,
                              uint32_t *value)
{
    switch (p->kind) {
    case GPIO:
        return gpio_access(b, p->number, offset, write, value);
    case TIMER:
        return timer_access(b, p->number, offset, write, value);
    case USART:
        return usart_access(b, p->number, offset, write, value);
    case ADC:
        return adc_access(b, offset, write, value);
    case CAN:
        return can_access(b, offset, write, value);
    case DMA:
        return dma_access(b, p->number, offset, write, value);
    case RCC:
        return rcc_access(b, offset, write, value);
    case FLASH:
        return flash_access(b, offset, write, value);
    case PWR:
        return pwr_access(b, offset, write, value);
    case IWDG:
        return iwdg_access(b, offset, write, value);
    case SYSCFG:
        return syscfg_access(b, offset, write, value);
    default:
        return exti_access(b, offset, write, value);
    }
}

static bool access_private(struct board *b, uint32_t address, bool write, uint32_t *value, unsigned size)
{
    if (address >= 0xE000E100u && address < 0xE000E600u) {
        return nvic_access(b, address - 0xE000E100u, write, value, size);
    }
    if (address >= 0xE000E010u && address < 0xE000E020u) {
        return systick_access(b, address - 0xE000E010u, write, value);
    }
    if (address >= 0xE000E000u && address < 0xE000F000u) {
        return scb_access(b, address - 0xE000E000u, write, value, size);
    }
    if (address == 0xE0001000u) { /* DWT_CTRL */
        b->dwt.ctrl = write ? (*value & 1u) | 0x40000000u : b->dwt.ctrl;
        *value = b->dwt.ctrl;
        return true;
    }
    if (address == 0xE0001004u) { /* DWT_CYCCNT */
        bool runs = (b->dwt.ctrl & 1u) != 0 && (b->scb.demcr & 1u << 24) != 0;
        if (write) {
            b->dwt.origin = b->moment - *value;
        } else {
            const uint64_t cycle = b->halted ? b->dwt.frozen_at : b->moment;
            *value = runs ? (uint32_t)(cycle - b->dwt.origin) : 0;
        }
        return true;
    }
    if (address >= 0xE0042000u && address < 0xE0042010u) {
        return dbgmcu_access(b, address - 0xE0042000u, write, value);
    }
    return false;
}

static void access_word(struct board *b, uint32_t address, bool write, uint32_t *value, unsigned size)
{
    bool known;
    const struct peripheral *p = NULL;
    if (address >= 0xE0000000u) {
        known = access_private(b, address, write, value, size);
    } else if (address >= 0x50060800u && address < 0x50060C00u) {
        known = rng_access(b, address - 0x50060800u, write, value);
    } else {
        p = find(b, address);
        if (p != NULL && !has_clock(b, p)) {
            warn_once(b, p->base | 1u, "%s accessed while its clock is off", p->name);
            return;
        }
        uint32_t offset = p != NULL ? address - p->base : 0;
        known = p != NULL && access_peripheral(b, p, offset, write, value);
    }
    if (!known) {
        const char *verb = write ? "written" : "read";
        if (p != NULL) {
            warn_once(b, address ^ (write ? 2u : 0), "%s register 0x%02X is not modelled (%s)", p->name,
                      (unsigned)(address - p->base), verb);
        } else {
            warn_once(b, address ^ (write ? 2u : 0), "register 0x%08X is not modelled (%s)",
                      (unsigned)address, verb);
        }
    }
}

/* Accesses see the time of their block's beginning plus two cycles for each access before; see README. */
static void tick(struct board *b)
{
    uint64_t moment = b->now + ACCESS_CYCLES * (uint64_t)b->accesses;
    uint64_t end = b->now + b->current.cycles;
    b->accesses++;
    b->stats.registers++;
    moment = moment < end ? moment : end;
    if (moment > b->moment) {
        b->moment = moment;
    }
    if (b->next_event <= b->moment) {
        events_run(b, b->moment);
    }
}

/* Bit-band alias (PM0214 2.2.5): one word stands for one bit. */
static bool bit_band(uint32_t address, uint32_t *target, uint32_t *bit)
{
    uint32_t base = address & 0xF0000000u;
    if ((address & 0x0E000000u) != 0x02000000u || base > 0x40000000u) {
        return false;
    }
    uint32_t byte = (address & 0x01FFFFFFu) >> 5;
    *target = base + (byte & ~3u);
    *bit = (address >> 2 & 7u) + 8 * (byte & 3u);
    return true;
}

static uint32_t read_any(struct board *b, uint32_t address, unsigned size)
{
    uint32_t value = 0;
    uint32_t lane = 0;
    bool own_lanes = address >= 0xE0000000u;
    if (!own_lanes) {
        lane = address & 3u;
    }
    const uint8_t *memory = address < 0x40000000u ? cpu_memory(b, address - lane, 4, false) : NULL;
    if (memory != NULL) {
        memcpy(&value, memory, sizeof value);
    } else {
        access_word(b, address - lane, false, &value, size);
    }
    value >>= 8 * lane;
    return size == 4 ? value : value & ((1u << (8 * size)) - 1u);
}

static void write_any(struct board *b, uint32_t address, uint32_t value, unsigned size)
{
    uint8_t *memory = address < 0x40000000u ? cpu_memory(b, address, size, true) : NULL;
    if (memory != NULL) {
        memcpy(memory, &value, size);
        return;
    }
    uint32_t lane = address >= 0xE0000000u ? 0 : address & 3u;
    value <<= 8 * lane;
    access_word(b, address - lane, true, &value, size);
}

/* A register, accessed by a master besides the CPU at the present moment. */
void bus_master_access(struct board *b, uint32_t address, bool write, uint32_t *value, unsigned size)
{
    const uint32_t shift = 8 * (address & 3u);
    uint32_t word = write ? *value << shift : 0;
    access_word(b, address & ~3u, write, &word, size);
    if (!write) {
        *value = word >> shift;
    }
}

static uint32_t cpu_read(struct board *b, uint32_t address, unsigned size)
{
    uint32_t target;
    uint32_t bit;
    if (bit_band(address, &target, &bit)) {
        return read_any(b, target, 4) >> bit & 1u;
    }
    return read_any(b, address, size);
}

uint32_t board_read_register(struct board *board, uint32_t address)
{
    return cpu_read(board, address, 4);
}

static void cpu_write(struct board *b, uint32_t address, unsigned size, uint32_t value)
{
    uint32_t target;
    uint32_t bit;
    if (bit_band(address, &target, &bit)) {
        uint32_t word = read_any(b, target, 4);
        write_any(b, target, (word & ~(1u << bit)) | (value & 1u) << bit, 4);
        return;
    }
    write_any(b, address, value, size);
}

uint64_t bus_read(uc_engine *uc, uint64_t offset, unsigned size, void *region)
{
    const struct region_of *r = region;
    (void)uc;
    const enum board_phase before = board_enter(r->board, BOARD_PERIPHERALS);
    tick(r->board);
    const uint32_t value = cpu_read(r->board, r->base + (uint32_t)offset, size);
    board_enter(r->board, before);
    return value;
}

void bus_write(uc_engine *uc, uint64_t offset, unsigned size, uint64_t value, void *region)
{
    const struct region_of *r = region;
    (void)uc;
    const enum board_phase before = board_enter(r->board, BOARD_PERIPHERALS);
    tick(r->board);
    cpu_write(r->board, r->base + (uint32_t)offset, size, (uint32_t)value);
    board_enter(r->board, before);
}

/* The CPU's access to a register; false where no registers are, or not at such an address. */
bool bus_access(struct board *b, uint32_t address, bool write, uint32_t *value, unsigned size)
{
    if (address % size != 0) {
        return false;
    }
    for (size_t i = 0; i < BUS_REGIONS; i++) {
        if (address - regions[i].base < regions[i].size) {
            const enum board_phase before = board_enter(b, BOARD_PERIPHERALS);
            tick(b);
            if (write) {
                cpu_write(b, address, size, *value);
            } else {
                *value = cpu_read(b, address, size);
            }
            board_enter(b, before);
            return true;
        }
    }
    return false;
}

bool bus_map(struct board *b)
{
    static_assert(sizeof regions / sizeof regions[0] == BUS_REGIONS, "one entry for each region");
    bool good = true;
    for (size_t i = 0; i < PERIPHERALS; i++) {
        b->bus_page[(peripherals[i].base - 0x40000000u) >> 10] = (uint8_t)(i + 1);
    }
    for (size_t i = 0; i < BUS_REGIONS; i++) {
        b->region[i] = (struct region_of){b, regions[i].base};
        good = good && uc_mmio_map(b->uc, regions[i].base, regions[i].size, bus_read, &b->region[i],
                                   bus_write, &b->region[i]) == UC_ERR_OK;
    }
    return good;
}
