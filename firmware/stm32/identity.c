/* Device id, boot id and reset cause, each as far as the chip provides it. */
#include "identity.h"

#include <string.h>

#include "fault.h"
#include "hal.h"
#include "registers.h"
#include "reset_flags.h"
#include "supply.h"

/* Boots since power-up, kept through resets; a power cycle leaves noise, which the magic number
 * distinguishes. */
struct boot_counter {
    uint32_t magic;
    uint32_t count;
    volatile uint32_t moving; /* MOVING_MAGIC while the robot drives */
};
#define BOOT_MAGIC   0xB007C0DEu
#define MOVING_MAGIC 0x30D1F00Du
__attribute__((section(".noinit"), used)) static struct boot_counter boots;

/* The generator needs 40 periods of its 48 MHz for a word (RM0090 section 24.3.1); far fewer reads than this.
 */
enum { RANDOM_READS = 1000 };

static struct hal_identity identity;

/* A random word, or false where there is no working generator: it lacks its 48 MHz without the PLL. */
static bool random_word(uint32_t *out)
{
    uint32_t status;
    if (!guarded_read(RNG_SR_ADDRESS, &status)) {
        return false;
    }
    RNG_CR = RNG_CR_RNGEN;
    bool ready = false;
    for (uint32_t i = 0; i < RANDOM_READS && !ready; i++) {
        ready = guarded_read(RNG_SR_ADDRESS, &status) &&
                (status & (RNG_SR_DRDY | RNG_SR_CECS | RNG_SR_SECS)) == RNG_SR_DRDY;
    }
    const bool found = ready && guarded_read(RNG_DR_ADDRESS, out);
    RNG_CR = 0;
    return found;
}

void identity_start(const struct clock *clock)
{
    const bool memory_kept = boots.magic == BOOT_MAGIC;
    if (!memory_kept) {
        boots.magic = BOOT_MAGIC;
        boots.count = 0;
    }
    boots.count++;

    memset(&identity, 0, sizeof identity);
    identity.memory_kept = memory_kept;
    identity.was_moving = memory_kept && boots.moving == MOVING_MAGIC;
    boots.moving = 0;
    identity.program_fault = fault_take_notice();
    identity.brown_out_reset = supply_resets_in_time();
    for (uint32_t i = 0; i < sizeof identity.board_id; i += 4u) {
        uint32_t word = 0;
        if (guarded_read(UID_ADDRESS + i, &word)) {
            memcpy(&identity.board_id[i], &word, sizeof word);
        }
    }
    if (!random_word(&identity.boot_id)) {
        identity.boot_id = boots.count;
    }
    identity.reset_cause = reset_flags(RCC->csr);
    RCC->csr |= RCC_CSR_RMVF; /* or the next reset would add its cause to this one's */
    identity.cpu_hz = clock->cpu_hz;
    identity.clock_fallback = clock->source != CLOCK_CRYSTAL_PLL;
    identity.crystal_wrong = clock->crystal_wrong;
}

void hal_note_moving(bool moving)
{
    boots.moving = moving ? MOVING_MAGIC : 0;
}

void hal_identity(struct hal_identity *out)
{
    *out = identity;
}
