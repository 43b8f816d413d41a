/* The parameter store: two slots, of which one always holds a complete set, also after a power failure.
 *
 * A slot, in words, little endian; what is not named stays erased:
 *
 *   0 magic   1 format, size of a record   2 sequence number   3 number of records   4 schema of the writer
 *   5 CRC-32 over words 0 to 4 and the records   6 commit   8... records: key, value (f32)
 *
 * Keys are CRC-32s of names (proto_parameter_info.key), so that a table with more, fewer or reordered entries
 * finds the values that it knows. A save writes the slot that is not the newest:
 *
 *   retire (commit to 0) -> erase -> records, header, CRC -> read back -> commit
 *
 * and a start takes the good slot with the higher sequence number. */
#ifndef PARAMETER_STORE_H
#define PARAMETER_STORE_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"
#include "proto.h"

enum { PARAMETER_STORE_NONE = 0xFF };

/* The parameters of an image, and where their values are. */
struct parameter_table {
    const struct proto_parameter_info *infos;
    float *values;
    uint16_t count;
};

struct parameter_store {
    uint8_t states[HAL_STORE_SLOTS]; /* enum proto_slot_state */
    uint8_t newest;                  /* slot, or PARAMETER_STORE_NONE */
    uint16_t records;                /* in the newest set */
    uint32_t sequence;               /* of the newest set; 0: there is none */
};

struct parameter_store_counts {
    uint16_t stored;  /* values that the store has for the table */
    uint16_t unknown; /* values for parameters that the table does not have */
    uint16_t unfit;   /* values that the table's limits forbid */
};

enum parameter_store_result {
    PARAMETER_STORE_SAVED = 0,
    PARAMETER_STORE_UNCHANGED, /* it held these very values */
    PARAMETER_STORE_FAILED,    /* the memory did not take them; the newest set is what it was */
};

/* Reads both slots. */
void parameter_store_open(struct parameter_store *store);

/* A saved set is lost, or the only save was interrupted: a load does not give the values that were last
 * saved. An interrupted save that leaves an older set is not damage. */
bool parameter_store_is_damaged(const struct parameter_store *store);

/* Fills the table's values: stored ones where the store has them and the table allows them, else defaults. */
void parameter_store_load(const struct parameter_store *store, const struct parameter_table *table);

/* What a load would make of the newest set. */
struct parameter_store_counts parameter_store_count(const struct parameter_store *store,
                                                    const struct parameter_table *table);

/* The stored value of one parameter; false: there is none that it allows. */
bool parameter_store_find(const struct parameter_store *store, const struct proto_parameter_info *info,
                          float *value);

/* The slot that a save writes into: never the newest set's. */
uint8_t parameter_store_next_slot(const struct parameter_store *store);

/* Writes the table's values, and carries values along that the table does not know. The CPU is stalled
 * meanwhile; `missed_ticks` are the control ticks lost. */
enum parameter_store_result parameter_store_save(struct parameter_store *store,
                                                 const struct parameter_table *table, uint32_t *missed_ticks);

#endif
