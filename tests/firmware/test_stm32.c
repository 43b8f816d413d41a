/* What is plain arithmetic in the drivers of firmware/stm32 and firmware/stm32g474, which has no emulator:
 * the PLL, CAN's bit timing, the store's double words, the causes of a reset. */
#include "bxcan_timing.h"
#include "clock_tree.h"
#include "double_word.h"
#include "fdcan_timing.h"
#include "reset_flags.h"
#include "unity.h"

#define CRYSTAL_HZ BOARD_CRYSTAL_HZ

void setUp(void)
{
}

void tearDown(void)
{
}

/* RM0440, RCC_PLLCFGR: M from bit 4, less one; N from bit 8; R, from bit 25, is 2. Datasheet DS12288, PLL
 * characteristics: input 2.66 to 16 MHz, VCO 96 to 344 MHz, output 170 MHz at most. */
static uint32_t pll_hz(uint32_t settings, uint32_t source_hz)
{
    const uint32_t input = source_hz / (((settings >> 4) & 15u) + 1u);
    const uint32_t vco = input * ((settings >> 8) & 127u);
    TEST_ASSERT_UINT32_WITHIN(6670000, 9330000, input);
    TEST_ASSERT_UINT32_WITHIN(124000000, 220000000, vco);
    TEST_ASSERT_EQUAL_UINT32(0, (settings >> 25) & 3u);
    TEST_ASSERT_BITS_HIGH(1u << 24, settings);
    return vco / 2u;
}

static void the_pll_makes_what_the_clocks_are_said_to_be_and_stays_within_its_limits(void)
{
    enum { FROM_HSI = 2, FROM_HSE = 3 };
    TEST_ASSERT_EQUAL_UINT32(FROM_HSE, PLL_FROM_CRYSTAL & 3u);
    TEST_ASSERT_EQUAL_UINT32(CRYSTAL_PLL_HZ, pll_hz(PLL_FROM_CRYSTAL, CRYSTAL_HZ));
    TEST_ASSERT_EQUAL_UINT32(FROM_HSI, PLL_FROM_INTERNAL & 3u);
    TEST_ASSERT_EQUAL_UINT32(INTERNAL_PLL_HZ, pll_hz(PLL_FROM_INTERNAL, 16000000));
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(170000000, CRYSTAL_PLL_HZ);
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(170000000, INTERNAL_PLL_HZ / 1000u * 1015u); /* 1.5 % too fast */
}

static uint32_t sample_point_percent(const struct can_timing *timing)
{
    return 100u * (1u + timing->segment_1) / (1u + timing->segment_1 + timing->segment_2);
}

static void every_usual_bit_rate_is_exact_from_the_crystal_and_sampled_at_four_fifths(void)
{
    static const uint32_t rates[] = {1000000, 800000, 500000, 250000, 125000, 100000};
    for (size_t i = 0; i < sizeof rates / sizeof rates[0]; i++) {
        struct can_timing timing;
        TEST_ASSERT_TRUE(can_timing(CRYSTAL_HZ, rates[i], &fdcan_limits, &timing));
        const uint32_t quanta = 1u + timing.segment_1 + timing.segment_2;
        TEST_ASSERT_EQUAL_UINT32(CRYSTAL_HZ, rates[i] * quanta * timing.prescaler);
        TEST_ASSERT_UINT32_WITHIN(2, 80, sample_point_percent(&timing));
        TEST_ASSERT_LESS_OR_EQUAL_UINT32(timing.segment_2, timing.jump);
    }
}

/* RM0440, FDCAN_NBTP: NSJW from bit 25, NBRP 16, NTSEG1 8, NTSEG2 0, each one less than it means. */
static void the_bit_timing_register_holds_each_part_in_its_place(void)
{
    const struct can_timing timing = {.prescaler = 3, .segment_1 = 18, .segment_2 = 5, .jump = 4};
    TEST_ASSERT_EQUAL_HEX32(3u << 25 | 2u << 16 | 17u << 8 | 4u, fdcan_nbtp(&timing));
    TEST_ASSERT_EQUAL_HEX32(3u << 24 | 4u << 20 | 17u << 16 | 2u, bxcan_btr(&timing));
}

static void a_rate_that_no_divider_comes_near_is_refused(void)
{
    struct can_timing timing;
    TEST_ASSERT_FALSE(can_timing(CRYSTAL_HZ, 0, &fdcan_limits, &timing));
    TEST_ASSERT_FALSE(can_timing(CRYSTAL_HZ, 7000000, &fdcan_limits, &timing));
    TEST_ASSERT_FALSE(can_timing(CRYSTAL_HZ, 1000, &fdcan_limits, &timing));
}

/* bxCAN's first segment ends at 16 quanta: of 24 its second gets 7. */
static void a_short_first_segment_leaves_the_rest_of_the_bit_to_the_second(void)
{
    struct can_timing timing;
    TEST_ASSERT_TRUE(can_timing(CRYSTAL_HZ, 1000000, &bxcan_limits, &timing));
    TEST_ASSERT_EQUAL_UINT32(16, timing.segment_1);
    TEST_ASSERT_EQUAL_UINT32(7, timing.segment_2);
    TEST_ASSERT_EQUAL_UINT32(4, timing.jump);
}

static void each_word_of_a_slot_has_a_double_word_to_itself(void)
{
    for (uint32_t offset = 0; offset < 64; offset++) {
        const uint32_t place = double_word_place(offset);
        TEST_ASSERT_EQUAL_UINT32(offset / 4u, place / DOUBLE_WORD_SIZE);
        TEST_ASSERT_EQUAL_UINT32(offset % 4u, place % DOUBLE_WORD_SIZE);
    }
}

static void a_double_word_takes_a_word_once_and_zeros_at_any_time(void)
{
    static const uint32_t erased[2] = {UINT32_MAX, UINT32_MAX};
    static const uint32_t written[2] = {0x5AA5C33Cu, 0x5AA5C33Cu};
    static const uint32_t torn[2] = {UINT32_MAX, 0x5AA5C33Cu};
    TEST_ASSERT_TRUE(double_word_takes(erased, 0x5AA5C33Cu));
    TEST_ASSERT_TRUE(double_word_takes(erased, 0));
    TEST_ASSERT_TRUE(double_word_takes(written, 0));
    TEST_ASSERT_FALSE(double_word_takes(written, 0x1AA5C33Cu));
    TEST_ASSERT_FALSE(double_word_takes(torn, 0x5AA5C33Cu));
}

/* RM0440, RCC_CSR: bits 25 to 31 are OBL, PIN, BOR, SFT, IWDG, WWDG, LPWR; RM0090: BOR, PIN, POR and the
 * same. */
static void causes_of_a_reset_are_read_as_the_core_knows_them(void)
{
    enum { PIN = 1 << 2, POWER_ON = 1 << 3, SOFTWARE = 1 << 4, WATCHDOG = 1 << 5, LOW_POWER = 1 << 7 };
    TEST_ASSERT_EQUAL_HEX8(PIN, reset_flags(1u << 26));
    TEST_ASSERT_EQUAL_HEX8(PIN | POWER_ON, reset_flags(3u << 26));
    TEST_ASSERT_EQUAL_HEX8(PIN | WATCHDOG, reset_flags(1u << 26 | 1u << 29));
    TEST_ASSERT_EQUAL_HEX8(LOW_POWER, reset_flags(1u << 31));
    TEST_ASSERT_EQUAL_HEX8(SOFTWARE, reset_flags(1u << 25)); /* option bytes loaded: no brown-out */
    TEST_ASSERT_EQUAL_HEX8(0, reset_flags(0x00FFFFFFu));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(the_pll_makes_what_the_clocks_are_said_to_be_and_stays_within_its_limits);
    RUN_TEST(every_usual_bit_rate_is_exact_from_the_crystal_and_sampled_at_four_fifths);
    RUN_TEST(the_bit_timing_register_holds_each_part_in_its_place);
    RUN_TEST(a_rate_that_no_divider_comes_near_is_refused);
    RUN_TEST(a_short_first_segment_leaves_the_rest_of_the_bit_to_the_second);
    RUN_TEST(each_word_of_a_slot_has_a_double_word_to_itself);
    RUN_TEST(a_double_word_takes_a_word_once_and_zeros_at_any_time);
    RUN_TEST(causes_of_a_reset_are_read_as_the_core_knows_them);
    return UNITY_END();
}
