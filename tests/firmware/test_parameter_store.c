/* Parameters survive power-off, other images, power cuts at any write, bad cells and worn memory. */
#include "fixture.h"

#include <stdio.h>

#include "parameter_store.h"
#include "random.h"

enum { COUNT_AT = 12, RECORDS_AT = 32, RECORD_SIZE = 8 };
/* Retire, erase, two words for each parameter, magic to CRC, commit. */
enum { SAVE_OPERATIONS = 1 + 1 + 2 * (int)PROTO_PARAMETER_COUNT + 6 + 1 };
enum { BASE = PROTO_PARAMETER_WHEELBASE_M, LIMIT = PROTO_PARAMETER_EFFORT_LIMIT };

void setUp(void)
{
    fixture_power_up();
}

void tearDown(void)
{
}

static void power_cycle(void)
{
    hal_host_power_cycle(&fixture.board);
    memset(&fixture.decoder, 0, sizeof fixture.decoder);
    controller_init(&fixture.controller);
    fixture_arm();
}

static float in_force(uint16_t index)
{
    return fixture.controller.robot.parameters.values[index];
}

static void ask_save(void)
{
    fixture_ask(PROTO_ID_PARAM_SAVE, NULL, 0);
}

static struct proto_param_save_reply save(void)
{
    struct proto_param_save_reply reply = {0};
    ask_save();
    fixture_expect_accepted();
    TEST_ASSERT_TRUE(
        proto_param_save_reply_decode(&reply, fixture.reply.payload, fixture.reply.payload_length));
    return reply;
}

static void set_and_save(float wheelbase_m)
{
    fixture_set_parameter(BASE, wheelbase_m);
    fixture_expect_accepted();
    TEST_ASSERT_EQUAL_UINT8(1, save().written);
}

static struct proto_param_store_reply store(void)
{
    struct proto_param_store_reply reply = {0};
    fixture_ask(PROTO_ID_PARAM_STORE, NULL, 0);
    TEST_ASSERT_TRUE(
        proto_param_store_reply_decode(&reply, fixture.reply.payload, fixture.reply.payload_length));
    return reply;
}

static struct proto_param_list_reply listed(uint16_t index)
{
    struct proto_param_list_reply reply = {0};
    const uint8_t payload[2] = {(uint8_t)index, 0};
    fixture_ask(PROTO_ID_PARAM_LIST, payload, sizeof payload);
    TEST_ASSERT_TRUE(
        proto_param_list_reply_decode(&reply, fixture.reply.payload, fixture.reply.payload_length));
    return reply;
}

static bool damage_is_reported(void)
{
    fixture_run(1);
    return (fixture_status().faults_active & PROTO_FAULT_PARAMETER_STORE_DAMAGED) != 0;
}

static void a_store_never_written_gives_the_defaults_and_no_fault(void)
{
    for (int zeros = 0; zeros < 2; zeros++) { /* what an erased cell reads as differs from part to part */
        memset(fixture.board.store, zeros ? 0x00 : 0xFF, sizeof fixture.board.store);
        power_cycle();
        TEST_ASSERT_EQUAL_FLOAT(0.283f, in_force(BASE));
        TEST_ASSERT_FALSE(damage_is_reported());
        TEST_ASSERT_EQUAL_UINT32(0, store().sequence);
        TEST_ASSERT_EQUAL_UINT8(PROTO_SLOT_STATE_BLANK, store().slot_states[0]);
        TEST_ASSERT_EQUAL_UINT8(0, listed(BASE).stored);
        TEST_ASSERT_EQUAL_FLOAT(0.283f, listed(BASE).stored_value);
    }
}

static void what_was_saved_comes_back_and_what_was_only_set_does_not(void)
{
    set_and_save(0.29f);
    fixture_set_parameter(LIMIT, 0.5f);
    power_cycle();
    TEST_ASSERT_EQUAL_FLOAT(0.29f, in_force(BASE));
    TEST_ASSERT_EQUAL_FLOAT(1.0f, in_force(LIMIT));
    TEST_ASSERT_EQUAL_FLOAT(0.145f, fixture.controller.robot.tuning.half_wheelbase_m);
    TEST_ASSERT_EQUAL_UINT16(PROTO_PARAMETER_COUNT, store().stored);
    TEST_ASSERT_FALSE(damage_is_reported());
}

static void many_saves_take_turns_and_the_last_one_counts(void)
{
    for (uint32_t i = 1; i <= 9; i++) {
        set_and_save(0.2f + 0.01f * (float)i);
        TEST_ASSERT_EQUAL_UINT32(i, store().sequence);
        TEST_ASSERT_EQUAL_UINT8(1 - i % 2, store().newest);
        power_cycle();
        TEST_ASSERT_EQUAL_FLOAT(0.2f + 0.01f * (float)i, in_force(BASE));
        TEST_ASSERT_EQUAL_UINT32(i, store().sequence);
    }
    TEST_ASSERT_EQUAL_UINT8(PROTO_SLOT_STATE_GOOD, store().slot_states[0]);
    TEST_ASSERT_EQUAL_UINT8(PROTO_SLOT_STATE_GOOD, store().slot_states[1]);
}

static void saving_the_same_values_again_wears_no_cell(void)
{
    set_and_save(0.29f);
    const uint32_t operations = fixture.board.store_operations;
    const struct proto_param_save_reply again = save();
    TEST_ASSERT_EQUAL_UINT8(0, again.written);
    TEST_ASSERT_EQUAL_UINT32(1, again.sequence);
    TEST_ASSERT_EQUAL_UINT16(0, again.stall_ms);
    TEST_ASSERT_EQUAL_UINT32(operations, fixture.board.store_operations);
}

static void load_goes_back_to_the_stored_values_and_defaults_leave_the_store_alone(void)
{
    set_and_save(0.29f);
    fixture_set_parameter(BASE, 0.3f);
    TEST_ASSERT_EQUAL_FLOAT(0.3f, listed(BASE).value);
    TEST_ASSERT_EQUAL_UINT8(1, listed(BASE).stored);
    TEST_ASSERT_EQUAL_FLOAT(0.29f, listed(BASE).stored_value);
    fixture_ask(PROTO_ID_PARAM_LOAD, NULL, 0);
    fixture_expect_accepted();
    TEST_ASSERT_EQUAL_FLOAT(0.29f, in_force(BASE));
    TEST_ASSERT_EQUAL_FLOAT(0.145f, fixture.controller.robot.tuning.half_wheelbase_m);
    fixture_ask(PROTO_ID_PARAM_DEFAULTS, NULL, 0);
    fixture_expect_accepted();
    TEST_ASSERT_EQUAL_FLOAT(0.283f, in_force(BASE));
    TEST_ASSERT_EQUAL_FLOAT(0.29f, listed(BASE).stored_value);
    power_cycle();
    TEST_ASSERT_EQUAL_FLOAT(0.29f, in_force(BASE));
}

static void expect_all_refused(enum proto_refusal_reason reason, uint32_t detail)
{
    const uint8_t ids[] = {PROTO_ID_PARAM_SAVE, PROTO_ID_PARAM_LOAD, PROTO_ID_PARAM_DEFAULTS};
    const uint32_t operations = fixture.board.store_operations;
    for (size_t i = 0; i < sizeof ids; i++) {
        fixture_ask(ids[i], NULL, 0);
        fixture_expect_refused(reason, detail);
    }
    TEST_ASSERT_EQUAL_UINT32(operations, fixture.board.store_operations);
}

static void nothing_is_saved_or_loaded_while_the_robot_moves(void)
{
    const struct proto_segment drive = {PROTO_SEGMENT_KIND_EFFORT, 100, 0.3f, 0.3f};
    fixture_set_parameter(BASE, 0.29f);
    fixture_set_effort(0.1f, 0.1f);
    fixture_run(10);
    expect_all_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_LIVE);
    TEST_ASSERT_EQUAL_INT16(1000, fixture.board.effort_e4[0]);
    fixture_stop();
    fixture_run(2000);
    (void)fixture_start(fixture_upload(&drive, 1, 0));
    expect_all_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_SEQUENCE);
    fixture_run(2000);
    TEST_ASSERT_EQUAL_UINT8(1, save().written);
}

static void a_save_right_after_a_stop_waits_for_the_last_record_of_the_log(void)
{
    fixture_set_effort(0.1f, 0.1f);
    fixture_run(10);
    fixture_stop();
    ask_save();
    fixture_expect_refused(PROTO_REFUSAL_REASON_LOG_BUSY, 0);
    fixture_run(1);
    ask_save();
    fixture_expect_accepted();
}

static void a_robot_stopped_by_a_fault_may_save(void)
{
    fixture_set_effort(0.1f, 0.1f);
    fixture_run(600); /* the host is silent */
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_STOPPED, fixture_status().state);
    set_and_save(0.29f);
    TEST_ASSERT_EQUAL_UINT8(PROTO_STATE_STOPPED, fixture_status().state);
}

static void a_save_brakes_feeds_the_watchdog_and_costs_no_device_time(void)
{
    fixture_run(500);
    const uint32_t before_ms = fixture_status().uptime_ms;
    const uint32_t feeds = fixture.board.watchdog_feeds;
    fixture.board.erase_ticks = 480;
    TEST_ASSERT_EQUAL_UINT16(480, save().stall_ms);
    TEST_ASSERT_TRUE(fixture.board.watchdog_feeds >= feeds + 2);
    TEST_ASSERT_EQUAL_INT16(0, fixture.board.effort_e4[0]);
    /* Pushed by hand meanwhile: all its counts arrive in one tick and give no speed. */
    fixture.motors_turn = false;
    fixture.board.sample.counts[0] += 600;
    fixture.board.sample.counts[1] += 600;
    for (int i = 0; i < 50; i++) {
        fixture_run(1);
        TEST_ASSERT_EQUAL_HEX32(0, fixture_status().faults_active);
        TEST_ASSERT_EQUAL_INT16(0, fixture_status().speed_mmps[0]);
    }
    TEST_ASSERT_EQUAL_INT32(600, fixture_status().counts[0]);
    TEST_ASSERT_INT32_WITHIN(2, 100, fixture_status().x_mm);
    TEST_ASSERT_EQUAL_UINT32(before_ms + 480 + 50, fixture_status().uptime_ms);
}

/* ---- other images ---- */

static const struct proto_parameter_info a = {"a",  "",         PROTO_PARAMETER_KIND_REAL, 0.0f, 10.0f,
                                              1.0f, 0xAAAA0001u};
static const struct proto_parameter_info b = {"b",  "",         PROTO_PARAMETER_KIND_REAL, 0.0f, 10.0f,
                                              2.0f, 0xBBBB0002u};
static const struct proto_parameter_info c = {"c",  "",         PROTO_PARAMETER_KIND_INTEGER, 0.0f, 9.0f,
                                              3.0f, 0xCCCC0003u};

static void save_as(const struct proto_parameter_info *infos, float *values, uint16_t count)
{
    struct parameter_store memory;
    uint32_t missed;
    const struct parameter_table table = {.infos = infos, .values = values, .count = count};
    parameter_store_open(&memory);
    TEST_ASSERT_EQUAL(PARAMETER_STORE_SAVED, parameter_store_save(&memory, &table, &missed));
}

static struct parameter_store_counts load_as(const struct proto_parameter_info *infos, float *values,
                                             uint16_t count)
{
    struct parameter_store memory;
    const struct parameter_table table = {.infos = infos, .values = values, .count = count};
    parameter_store_open(&memory);
    TEST_ASSERT_FALSE(parameter_store_is_damaged(&memory));
    parameter_store_load(&memory, &table);
    return parameter_store_count(&memory, &table);
}

static void an_image_with_one_more_parameter_keeps_the_old_values(void)
{
    const struct proto_parameter_info old[] = {a, b}, young[] = {a, c, b};
    float values[3] = {5.0f, 6.0f, 0.0f};
    save_as(old, values, 2);
    const struct parameter_store_counts counts = load_as(young, values, 3);
    TEST_ASSERT_EQUAL_FLOAT(5.0f, values[0]);
    TEST_ASSERT_EQUAL_FLOAT(3.0f, values[1]);
    TEST_ASSERT_EQUAL_FLOAT(6.0f, values[2]);
    TEST_ASSERT_EQUAL_UINT16(2, counts.stored);
    TEST_ASSERT_EQUAL_UINT16(0, counts.unknown);
    save_as(young, values, 3); /* a set without c does not hold these values, even though c has its default */
}

static void an_image_with_reordered_parameters_keeps_the_old_values(void)
{
    const struct proto_parameter_info old[] = {a, b, c}, young[] = {c, a, b};
    float values[3] = {5.0f, 6.0f, 7.0f};
    save_as(old, values, 3);
    (void)load_as(young, values, 3);
    TEST_ASSERT_EQUAL_FLOAT(7.0f, values[0]);
    TEST_ASSERT_EQUAL_FLOAT(5.0f, values[1]);
    TEST_ASSERT_EQUAL_FLOAT(6.0f, values[2]);
}

static void an_image_with_fewer_parameters_carries_the_others_along(void)
{
    const struct proto_parameter_info all[] = {a, b, c}, few[] = {b};
    float values[3] = {5.0f, 6.0f, 7.0f};
    save_as(all, values, 3);
    TEST_ASSERT_EQUAL_UINT16(2, load_as(few, values, 1).unknown);
    TEST_ASSERT_EQUAL_FLOAT(6.0f, values[0]);
    for (int i = 0; i < 3; i++) {
        values[0] += 0.5f;
        save_as(few, values, 1);
    }
    TEST_ASSERT_EQUAL_UINT16(3, load_as(all, values, 3).stored);
    TEST_ASSERT_EQUAL_FLOAT(5.0f, values[0]);
    TEST_ASSERT_EQUAL_FLOAT(7.5f, values[1]);
    TEST_ASSERT_EQUAL_FLOAT(7.0f, values[2]);
}

static void a_stored_value_that_the_image_forbids_becomes_the_default(void)
{
    struct proto_parameter_info narrow = a;
    const struct proto_parameter_info all[] = {a, b};
    float values[2] = {5.0f, 6.0f};
    narrow.maximum = 4.0f;
    const struct proto_parameter_info young[] = {narrow, b};
    save_as(all, values, 2);
    const struct parameter_store_counts counts = load_as(young, values, 2);
    TEST_ASSERT_EQUAL_FLOAT(1.0f, values[0]);
    TEST_ASSERT_EQUAL_FLOAT(6.0f, values[1]);
    TEST_ASSERT_EQUAL_UINT16(1, counts.unfit);
    TEST_ASSERT_EQUAL_UINT16(1, counts.stored);
}

/* ---- power cuts ---- */

/* Every parameter away from its default, so that no mix of two sets looks like either. */
static void set_all(uint32_t generation)
{
    for (uint16_t i = 0; i < PROTO_PARAMETER_COUNT; i++) {
        const struct proto_parameter_info *const info = &proto_parameters[i];
        float value =
            info->minimum + (info->maximum - info->minimum) * (0.1f + 0.05f * (float)(generation % 16u));
        if (info->kind != PROTO_PARAMETER_KIND_REAL) {
            value = info->kind == PROTO_PARAMETER_KIND_FLAG ? (float)(generation & 1u)
                                                            : (float)(int)(value + 1.0f);
        }
        fixture_set_parameter(i, value);
        fixture_expect_accepted();
    }
}

static struct parameters values_now(void)
{
    return fixture.controller.robot.parameters;
}

static bool same(const struct parameters *left, const struct parameters *right)
{
    return memcmp(left, right, sizeof *left) == 0;
}

static void every_write_of_any_save_may_be_the_last_and_the_set_is_the_old_or_the_new(void)
{
    enum { SAVES = 3, TEARS = 40 };
    static uint8_t before[HAL_STORE_SLOTS][HAL_STORE_SLOT_SIZE];
    uint32_t cuts = 0;
    uint32_t old_sets = 0;
    uint32_t new_sets = 0;
    for (uint32_t saves = 0; saves < SAVES; saves++) {
        memcpy(before, fixture.board.store, sizeof before);
        const struct parameters old = values_now();
        set_all(saves + 1);
        const struct parameters wanted = values_now();
        const uint32_t first = fixture.board.store_operations;
        (void)save();
        const uint32_t operations = fixture.board.store_operations - first;
        TEST_ASSERT_EQUAL_UINT32(SAVE_OPERATIONS, operations);
        for (uint32_t cut = 0; cut < operations; cut++) {
            for (uint32_t tear = 0; tear < TEARS; tear++) {
                memcpy(fixture.board.store, before, sizeof before);
                power_cycle();
                const struct parameters at_start = values_now();
                TEST_ASSERT_TRUE(same(&old, &at_start));
                set_all(saves + 1);
                fixture.board.store_operations = 0;
                fixture.board.store_cut_at = cut;
                ask_save();
                power_cycle();
                const struct parameters found = values_now();
                const bool is_new = same(&wanted, &found);
                TEST_ASSERT_TRUE_MESSAGE(is_new || same(&old, &found), "neither the old set nor the new one");
                cuts++;
                old_sets += !is_new;
                new_sets += is_new;
                /* With a good older set a power cut is not damage, and the next save succeeds. */
                TEST_ASSERT_TRUE(saves == 0 || !damage_is_reported());
                set_all(saves + 7);
                const struct parameters next = values_now();
                (void)save();
                power_cycle();
                const struct parameters again = values_now();
                TEST_ASSERT_TRUE(same(&next, &again));
                TEST_ASSERT_FALSE(damage_is_reported());
            }
        }
        memcpy(fixture.board.store, before, sizeof before);
        power_cycle();
        set_all(saves + 1);
        (void)save();
    }
    printf("%u cuts in %u saves: %u gave the old set, %u the new one\n", cuts, (unsigned)SAVES, old_sets,
           new_sets);
    TEST_ASSERT_TRUE(old_sets > 0 && new_sets > 0);
}

static void a_first_save_that_was_cut_off_keeps_the_robot_from_moving_until_it_is_made_good(void)
{
    fixture_set_parameter(LIMIT, 0.3f);
    fixture.board.store_cut_at = 10;
    ask_save();
    power_cycle();
    TEST_ASSERT_EQUAL_FLOAT(1.0f, in_force(LIMIT));
    TEST_ASSERT_TRUE(damage_is_reported());
    fixture_run(200);
    fixture_set_effort(0.1f, 0.1f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_PARAMETER_STORE_DAMAGED);
    fixture_ask(PROTO_ID_CLEAR_FAULTS, NULL, 0);
    fixture_expect_refused(PROTO_REFUSAL_REASON_SELF_CHECK_FAILED, PROTO_FAULT_PARAMETER_STORE_DAMAGED);
    fixture_set_parameter(LIMIT, 0.3f);
    (void)save();
    fixture_run(200);
    fixture_set_effort(0.1f, 0.1f);
    fixture_expect_accepted();
}

/* ---- bad cells ---- */

static void one_bad_bit_is_tolerated_or_reported_but_never_believed(void)
{
    static uint8_t good[HAL_STORE_SLOTS][HAL_STORE_SLOT_SIZE];
    set_all(1);
    const struct parameters old = values_now();
    (void)save();
    set_all(2);
    const struct parameters wanted = values_now();
    (void)save();
    const uint32_t newest = store().newest;
    memcpy(good, fixture.board.store, sizeof good);
    const uint32_t used = RECORDS_AT + RECORD_SIZE * PROTO_PARAMETER_COUNT;
    uint32_t tolerated = 0;
    for (uint32_t bit = 0; bit < 8u * used; bit++) {
        memcpy(fixture.board.store, good, sizeof good);
        fixture.board.store[newest][bit / 8u] ^= (uint8_t)(1u << (bit % 8u));
        power_cycle();
        const struct parameters found = values_now();
        if (same(&wanted, &found)) {
            tolerated++;
            TEST_ASSERT_FALSE(damage_is_reported());
        } else {
            TEST_ASSERT_TRUE(same(&old, &found));
            TEST_ASSERT_TRUE(damage_is_reported());
            (void)save();
            TEST_ASSERT_FALSE(damage_is_reported());
            power_cycle();
            TEST_ASSERT_FALSE(damage_is_reported());
        }
    }
    TEST_ASSERT_EQUAL_UINT32(8 * 8, tolerated); /* the commit word, and a word that is not used */
    printf("%u bits flipped one by one, %u of them without effect\n", 8u * used, tolerated);
}

static void slots_full_of_noise_give_the_defaults_and_the_fault(void)
{
    random_seed(5);
    for (int round = 0; round < 50; round++) {
        for (size_t i = 0; i < sizeof fixture.board.store; i++) {
            fixture.board.store[i / HAL_STORE_SLOT_SIZE][i % HAL_STORE_SLOT_SIZE] = (uint8_t)random_u32();
        }
        power_cycle();
        TEST_ASSERT_EQUAL_FLOAT(0.283f, in_force(BASE));
        TEST_ASSERT_TRUE(damage_is_reported());
        set_and_save(0.29f);
        TEST_ASSERT_FALSE(damage_is_reported());
        power_cycle();
        TEST_ASSERT_EQUAL_FLOAT(0.29f, in_force(BASE));
        TEST_ASSERT_FALSE(damage_is_reported());
    }
}

static void a_slot_that_claims_too_many_records_is_damaged_and_not_followed_out_of_bounds(void)
{
    set_and_save(0.29f);
    memset(&fixture.board.store[0][COUNT_AT], 0xFF, 4);
    power_cycle();
    TEST_ASSERT_EQUAL_FLOAT(0.283f, in_force(BASE));
    TEST_ASSERT_EQUAL_UINT8(PROTO_SLOT_STATE_DAMAGED, store().slot_states[0]);
}

static void memory_that_takes_nothing_more_refuses_the_save_and_keeps_the_set(void)
{
    set_and_save(0.29f);
    for (uint32_t from = 0; from < SAVE_OPERATIONS; from++) {
        fixture_set_parameter(BASE, 0.3f);
        fixture.board.store_refuse_at = fixture.board.store_operations + from;
        ask_save();
        fixture_expect_refused(PROTO_REFUSAL_REASON_STORE_FAILED, 1);
        TEST_ASSERT_EQUAL_FLOAT(0.3f, in_force(BASE)); /* still in force, only not stored */
        TEST_ASSERT_EQUAL_UINT32(1, store().sequence);
        power_cycle();
        TEST_ASSERT_EQUAL_FLOAT(0.29f, in_force(BASE));
        TEST_ASSERT_FALSE(damage_is_reported());
    }
}

static void a_repeated_save_is_answered_and_not_done_again(void)
{
    fixture_set_parameter(BASE, 0.29f);
    ask_save();
    const struct frame first = fixture.reply;
    const uint32_t operations = fixture.board.store_operations;
    fixture_say(PROTO_ID_PARAM_SAVE, fixture.sequence, NULL, 0);
    controller_poll(&fixture.controller);
    TEST_ASSERT_TRUE(fixture_hear());
    TEST_ASSERT_EQUAL_UINT8(first.id, fixture.reply.id);
    TEST_ASSERT_EQUAL_MEMORY(first.payload, fixture.reply.payload, first.payload_length);
    TEST_ASSERT_EQUAL_UINT32(operations, fixture.board.store_operations);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(a_store_never_written_gives_the_defaults_and_no_fault);
    RUN_TEST(what_was_saved_comes_back_and_what_was_only_set_does_not);
    RUN_TEST(many_saves_take_turns_and_the_last_one_counts);
    RUN_TEST(saving_the_same_values_again_wears_no_cell);
    RUN_TEST(load_goes_back_to_the_stored_values_and_defaults_leave_the_store_alone);
    RUN_TEST(nothing_is_saved_or_loaded_while_the_robot_moves);
    RUN_TEST(a_save_right_after_a_stop_waits_for_the_last_record_of_the_log);
    RUN_TEST(a_robot_stopped_by_a_fault_may_save);
    RUN_TEST(a_save_brakes_feeds_the_watchdog_and_costs_no_device_time);
    RUN_TEST(an_image_with_one_more_parameter_keeps_the_old_values);
    RUN_TEST(an_image_with_reordered_parameters_keeps_the_old_values);
    RUN_TEST(an_image_with_fewer_parameters_carries_the_others_along);
    RUN_TEST(a_stored_value_that_the_image_forbids_becomes_the_default);
    RUN_TEST(every_write_of_any_save_may_be_the_last_and_the_set_is_the_old_or_the_new);
    RUN_TEST(a_first_save_that_was_cut_off_keeps_the_robot_from_moving_until_it_is_made_good);
    RUN_TEST(one_bad_bit_is_tolerated_or_reported_but_never_believed);
    RUN_TEST(slots_full_of_noise_give_the_defaults_and_the_fault);
    RUN_TEST(a_slot_that_claims_too_many_records_is_damaged_and_not_followed_out_of_bounds);
    RUN_TEST(memory_that_takes_nothing_more_refuses_the_save_and_keeps_the_set);
    RUN_TEST(a_repeated_save_is_answered_and_not_done_again);
    return UNITY_END();
}
