/* Loads and stores: of memory here, of registers over the bus; where neither is, the engine has to raise the
 * fault. */
#include "thumb.h"

/* Memory that is only read, or NULL. */
static inline const uint8_t *readable(const struct board *b, uint32_t address, uint32_t size)
{
    if (address - SRAM_BASE <= SRAM_SIZE - size) {
        return b->sram + (address - SRAM_BASE);
    }
    if (address - CCM_BASE <= CCM_SIZE - size) {
        return b->ccm + (address - CCM_BASE);
    }
    if (address - FLASH_BASE <= FLASH_SIZE - size) {
        return b->flash_array + (address - FLASH_BASE);
    }
    return NULL;
}

static bool is_code_page(const struct board *b, uint32_t offset)
{
    const uint32_t page = offset / CODE_PAGE;
    return (b->sram_code_pages[page / 32] >> page % 32 & 1u) != 0;
}

/* Code in SRAM is the engine's: what writes into its pages goes there too. */
static inline uint8_t *writable(const struct board *b, uint32_t address, uint32_t size)
{
    const uint32_t offset = address - SRAM_BASE;
    if (offset <= SRAM_SIZE - size) {
        const bool code = b->sram_has_code && (is_code_page(b, offset) || is_code_page(b, offset + size - 1));
        return code ? NULL : b->sram + offset;
    }
    if (address - CCM_BASE <= CCM_SIZE - size) {
        return b->ccm + (address - CCM_BASE);
    }
    return NULL;
}

/* A load: from memory, or from a register of its own width, which is a function of its own so that the other
 * needs no stack. */
#define LOAD(name, type, extend)                                                                             \
    static __attribute__((noinline)) void name##_register(struct board *b, struct op *op)                    \
    {                                                                                                        \
        uint32_t word = 0;                                                                                   \
        if (!bus_access(b, R(op->b) + op->imm, false, &word, sizeof(type))) {                                \
            thumb_escape(b, op);                                                                             \
            return;                                                                                          \
        }                                                                                                    \
        R(op->a) = (uint32_t)(extend)(type)word;                                                             \
        NEXT;                                                                                                \
    }                                                                                                        \
    void op_##name(struct board *b, struct op *op)                                                           \
    {                                                                                                        \
        const uint8_t *memory = readable(b, R(op->b) + op->imm, sizeof(type));                               \
        type value;                                                                                          \
        if (memory == NULL) {                                                                                \
            name##_register(b, op);                                                                          \
            return;                                                                                          \
        }                                                                                                    \
        memcpy(&value, memory, sizeof value);                                                                \
        R(op->a) = (uint32_t)(extend)value;                                                                  \
        NEXT;                                                                                                \
    }
LOAD(ldr, uint32_t, uint32_t)
LOAD(ldrh, uint16_t, uint32_t)
LOAD(ldrb, uint8_t, uint32_t)
LOAD(ldrsh, int16_t, int32_t)
LOAD(ldrsb, int8_t, int32_t)

#define STORE(name, type)                                                                                    \
    static __attribute__((noinline)) void name##_register(struct board *b, struct op *op)                    \
    {                                                                                                        \
        uint32_t word = (type)R(op->a);                                                                      \
        if (!bus_access(b, R(op->b) + op->imm, true, &word, sizeof(type))) {                                 \
            thumb_escape(b, op);                                                                             \
            return;                                                                                          \
        }                                                                                                    \
        NEXT;                                                                                                \
    }                                                                                                        \
    void op_##name(struct board *b, struct op *op)                                                           \
    {                                                                                                        \
        const type value = (type)R(op->a);                                                                   \
        uint8_t *memory = writable(b, R(op->b) + op->imm, sizeof value);                                     \
        if (memory == NULL) {                                                                                \
            name##_register(b, op);                                                                          \
            return;                                                                                          \
        }                                                                                                    \
        memcpy(memory, &value, sizeof value);                                                                \
        NEXT;                                                                                                \
    }
STORE(str, uint32_t)
STORE(strh, uint16_t)
STORE(strb, uint8_t)

static inline uint32_t word_at(const uint8_t *memory)
{
    uint32_t word;
    memcpy(&word, memory, sizeof word);
    return word;
}

static inline void put_word(uint8_t *memory, uint32_t word)
{
    memcpy(memory, &word, sizeof word);
}

/* What PC becomes goes into REG_TEMP; without its Thumb bit it is a fault, and the engine's. */
void op_ldr_pc(struct board *b, struct op *op)
{
    const uint32_t address = R(op->b) + op->imm;
    const uint8_t *memory = readable(b, address, 4);
    if (memory == NULL || (memory[0] & 1u) == 0) {
        thumb_escape(b, op);
        return;
    }
    R(REG_TEMP) = word_at(memory);
    NEXT;
}

void op_ldrd(struct board *b, struct op *op)
{
    const uint32_t address = R(op->b) + op->imm;
    const uint8_t *memory = readable(b, address, 8);
    if (memory == NULL || address % 4 != 0) {
        thumb_escape(b, op);
        return;
    }
    R(op->a) = word_at(memory);
    R(op->c) = word_at(memory + 4);
    NEXT;
}

void op_strd(struct board *b, struct op *op)
{
    const uint32_t address = R(op->b) + op->imm;
    uint8_t *memory = writable(b, address, 8);
    if (memory == NULL || address % 4 != 0) {
        thumb_escape(b, op);
        return;
    }
    put_word(memory, R(op->a));
    put_word(memory + 4, R(op->c));
    NEXT;
}

/* Registers of the list that imm begins with, and after it their size in bytes, from the base a up, or below
 * it where c is set; b: the base follows. */
void op_ldm(struct board *b, struct op *op)
{
    const uint32_t size = op->imm >> 16;
    const uint32_t address = op->c != 0 ? R(op->a) - size : R(op->a);
    const uint8_t *memory = readable(b, address, size);
    const bool to_pc = (op->imm & 1u << REG_PC) != 0;
    if (memory == NULL || address % 4 != 0 || (to_pc && (memory[size - 4] & 1u) == 0)) {
        thumb_escape(b, op);
        return;
    }
    if (op->b != 0) {
        R(op->a) = op->c != 0 ? address : address + size;
    }
    for (uint32_t left = op->imm & 0x7FFFu; left != 0; left &= left - 1) {
        R(__builtin_ctz(left)) = word_at(memory);
        memory += 4;
    }
    if (to_pc) {
        R(REG_TEMP) = word_at(memory);
    }
    NEXT;
}

void op_stm(struct board *b, struct op *op)
{
    const uint32_t size = op->imm >> 16;
    const uint32_t address = op->c != 0 ? R(op->a) - size : R(op->a);
    uint8_t *memory = writable(b, address, size);
    if (memory == NULL || address % 4 != 0) {
        thumb_escape(b, op);
        return;
    }
    for (uint32_t left = op->imm & 0xFFFFu; left != 0; left &= left - 1) {
        put_word(memory, R(__builtin_ctz(left)));
        memory += 4;
    }
    if (op->b != 0) {
        R(op->a) = op->c != 0 ? address : address + size;
    }
    NEXT;
}

/* ---- FP registers */

void op_vldr(struct board *b, struct op *op)
{
    const uint32_t address = R(op->b) + op->imm;
    const uint8_t *memory = readable(b, address, 4);
    if (memory == NULL || address % 4 != 0) {
        thumb_escape(b, op);
        return;
    }
    b->core.s[op->a] = word_at(memory);
    NEXT;
}

void op_vstr(struct board *b, struct op *op)
{
    const uint32_t address = R(op->b) + op->imm;
    uint8_t *memory = writable(b, address, 4);
    if (memory == NULL || address % 4 != 0) {
        thumb_escape(b, op);
        return;
    }
    put_word(memory, b->core.s[op->a]);
    NEXT;
}

/* c words from the FP register a on; the base follows in an operation of its own. */
void op_vldm(struct board *b, struct op *op)
{
    const uint32_t address = R(op->b) + op->imm;
    const uint8_t *memory = readable(b, address, 4u * op->c);
    if (memory == NULL || address % 4 != 0) {
        thumb_escape(b, op);
        return;
    }
    memcpy(&b->core.s[op->a], memory, (size_t)4 * op->c);
    NEXT;
}

void op_vstm(struct board *b, struct op *op)
{
    const uint32_t address = R(op->b) + op->imm;
    uint8_t *memory = writable(b, address, 4u * op->c);
    if (memory == NULL || address % 4 != 0) {
        thumb_escape(b, op);
        return;
    }
    memcpy(memory, &b->core.s[op->a], (size_t)4 * op->c);
    NEXT;
}
