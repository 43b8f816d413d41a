/* One conversion a millisecond of the battery divider (ADC1), started and fetched by the tick. */
#include "battery.h"

#include "adc_port.h"
#include "pins.h"

#define FULL_SCALE 4096u
#define FULL_SCALE_MV                                                                                        \
    (BOARD_REFERENCE_MV * (BOARD_DIVIDER_UPPER_OHM + BOARD_DIVIDER_LOWER_OHM) / BOARD_DIVIDER_LOWER_OHM)
_Static_assert(FULL_SCALE_MV <= UINT16_MAX, "millivolts of the supply are 16 bits wide on the link");

/* A conversion takes some 20 us. One that has not ended by the fifth tick is started anew. */
enum { RETRY_MS = 5, STALE_MS = 100 };

static uint32_t last_mv;
static uint32_t age_ms;     /* of last_mv */
static uint32_t pending_ms; /* since the conversion was started */

void battery_start(void)
{
    pin_to_analogue(BOARD_BATTERY_PIN);
    adc_start();
    last_mv = 0;
    age_ms = STALE_MS;
    pending_ms = RETRY_MS;
}

void battery_update(void)
{
    if (age_ms < STALE_MS) {
        age_ms++;
    }
    pending_ms++;
    if (adc_has_finished()) {
        last_mv = adc_take() * FULL_SCALE_MV / FULL_SCALE;
        age_ms = 0;
    } else if (pending_ms < RETRY_MS) {
        return;
    }
    adc_convert();
    pending_ms = 0;
}

bool battery_read(uint16_t *millivolts)
{
    *millivolts = (uint16_t)last_mv;
    return age_ms < STALE_MS;
}
