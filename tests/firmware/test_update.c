/* Updates over the link on the in-memory board: whatever is cut off, a start finds an image that answers. */
#include "fixture.h"
#include "image_slot.h"
#include "update.h"

enum { SIZE = 1800, CHUNKS = (SIZE + UPDATE_CHUNK - 1) / UPDATE_CHUNK };

static const char name[] = "truing-test 1.0";

static uint8_t image[SIZE];
static uint8_t digests[CHUNKS + 1][SHA256_SIZE]; /* of each chunk with what it gives; the last is zeros */

void setUp(void)
{
}
void tearDown(void)
{
}

/* An image for a slot, as make_images.py makes it; `version` distinguishes its content. */
static void make_image(uint8_t *out, uint32_t slot, const char *called, uint8_t version)
{
    struct image_header header = {
        .magic = IMAGE_MAGIC, .format = IMAGE_FORMAT, .slot = slot, .size = SIZE, .name = ""};
    memset(out, 0xFF, IMAGE_HEADER_SIZE);
    for (uint32_t i = IMAGE_HEADER_SIZE; i < SIZE; i++) {
        out[i] = (uint8_t)(i * 7u + version);
    }
    strncpy(header.name, called, sizeof header.name - 1);
    header.content_crc = crc32_update(0, out + IMAGE_HEADER_SIZE, SIZE - IMAGE_HEADER_SIZE);
    header.header_crc = crc32_update(0, (const uint8_t *)&header, sizeof header - sizeof header.header_crc);
    memcpy(out, &header, sizeof header);
}

static uint32_t chunk_length(uint32_t index)
{
    return index + 1u < CHUNKS ? UPDATE_CHUNK : SIZE - index * UPDATE_CHUNK;
}

static void make_chain(void)
{
    memset(digests[CHUNKS], 0, SHA256_SIZE);
    for (uint32_t i = CHUNKS; i-- > 0;) {
        struct sha256 sha;
        sha256_begin(&sha);
        sha256_update(&sha, image + i * UPDATE_CHUNK, chunk_length(i));
        sha256_update(&sha, digests[i + 1], SHA256_SIZE);
        sha256_end(&sha, digests[i]);
    }
}

/* Any host that greets the board. */
static void greet(void)
{
    const struct proto_hello_request hello = {PROTO_VERSION, PROTO_SCHEMA_HASH};
    uint8_t payload[PROTO_HELLO_REQUEST_SIZE];
    fixture_ask(PROTO_ID_HELLO, payload, proto_hello_request_encode(&hello, payload, sizeof payload));
    fixture_run(1);
}

/* An image as it stays in a slot once it has been confirmed. */
static void put_confirmed(uint32_t slot, uint32_t sequence)
{
    const struct image_marks marks = {.sequence = sequence,
                                      .commit = IMAGE_COMMIT,
                                      .trial = {IMAGE_ERASED, IMAGE_ERASED, IMAGE_ERASED},
                                      .confirmed = IMAGE_CONFIRMED,
                                      .rejected = IMAGE_ERASED};
    make_image(fixture.board.image[slot], slot, name, (uint8_t)sequence);
    memcpy(fixture.board.image[slot] + IMAGE_MARKS_AT, &marks, sizeof marks);
}

static void start_in(uint32_t slot)
{
    fixture.board.image_running = slot;
    controller_init(&fixture.controller);
    make_image(image, 1 - slot, name, 9);
    make_chain();
    fixture_run(10);
}

/* A board as a probe leaves it: the image in slot 0 runs, and the update is for slot 1. */
static void start_with_one_image(void)
{
    fixture_power_up_unarmed();
    put_confirmed(0, 1);
    start_in(0);
}

/* The same after an update: the image in slot 1 runs, and the update is for slot 0, which holds the older
 * one. */
static void start_with_two_images(void)
{
    fixture_power_up_unarmed();
    put_confirmed(0, 1);
    put_confirmed(1, 2);
    start_in(1);
}

static void begin(void)
{
    struct proto_update_begin_request in = {.size = SIZE};
    uint8_t payload[PROTO_UPDATE_BEGIN_REQUEST_SIZE];
    memcpy(in.head, digests[0], sizeof in.head);
    fixture_ask(PROTO_ID_UPDATE_BEGIN, payload,
                proto_update_begin_request_encode(&in, payload, sizeof payload));
}

static void send_chunk(uint32_t index)
{
    struct proto_update_data_request in = {
        .index = (uint16_t)index, .data = image + index * UPDATE_CHUNK, .data_length = chunk_length(index)};
    uint8_t payload[PROTO_UPDATE_DATA_REQUEST_SIZE + UPDATE_CHUNK];
    memcpy(in.next, digests[index + 1], sizeof in.next);
    fixture_ask(PROTO_ID_UPDATE_DATA, payload,
                proto_update_data_request_encode(&in, payload, sizeof payload));
}

static void finish(void)
{
    fixture_ask(PROTO_ID_UPDATE_FINISH, NULL, 0);
}

static void transfer(void)
{
    begin();
    for (uint32_t i = 0; i < CHUNKS; i++) {
        send_chunk(i);
    }
    finish();
}

/* What the loader does at the next start, and the controller that it starts; nothing is on its line yet. */
static uint32_t restart(void)
{
    const uint32_t running = fixture.board.image_running;
    hal_host_power_cycle(&fixture.board);
    memset(&fixture.controller, 0, sizeof fixture.controller);
    memset(&fixture.decoder, 0, sizeof fixture.decoder);
    const uint32_t slot = image_slot_choose(name);
    fixture.board.image_running = slot == IMAGE_NONE ? running : slot;
    controller_init(&fixture.controller);
    fixture_run(2);
    return slot;
}

static uint8_t state_of(uint32_t slot)
{
    struct image_slot found;
    image_slot_read(slot, &found);
    return found.state;
}

static void test_an_update_is_started_on_trial_and_stays_once_a_host_has_greeted_it(void)
{
    start_with_one_image();
    transfer();
    fixture_expect_accepted();
    TEST_ASSERT_EQUAL(PROTO_IMAGE_STATE_TRIAL, state_of(1));
    TEST_ASSERT_EQUAL(1, restart());
    greet();
    TEST_ASSERT_EQUAL(PROTO_IMAGE_STATE_CONFIRMED, state_of(1));
    for (int i = 0; i < 5; i++) {
        TEST_ASSERT_EQUAL(1, restart());
    }
}

static void test_an_image_that_never_answers_is_given_up_after_three_starts(void)
{
    start_with_one_image();
    transfer();
    for (int i = 0; i < IMAGE_TRIALS; i++) {
        TEST_ASSERT_EQUAL(1, restart());
    }
    TEST_ASSERT_EQUAL(0, restart());
    TEST_ASSERT_EQUAL(PROTO_IMAGE_STATE_REJECTED, state_of(1));
    TEST_ASSERT_EQUAL(0, restart());
}

static void test_an_image_that_is_not_greeted_starts_anew_by_itself(void)
{
    start_with_one_image();
    transfer();
    restart();
    fixture_run(UPDATE_TRIAL_MS - 100);
    TEST_ASSERT_EQUAL(0, fixture.board.restarts);
    fixture_run(200);
    TEST_ASSERT_GREATER_THAN(0, fixture.board.restarts);
}

static void test_an_image_on_trial_takes_no_update(void)
{
    start_with_one_image();
    transfer();
    restart();
    begin();
    fixture_expect_refused(PROTO_REFUSAL_REASON_UPDATE_ON_TRIAL, 0);
}

/* With the power cut in the operation of that number; false: the update had no such one. */
static bool cut_update(void (*start)(void), uint32_t operation)
{
    start();
    fixture.board.store_noise = operation + 1;
    fixture.board.store_operations = 0;
    fixture.board.store_cut_at = operation;
    transfer();
    return fixture.board.store_dead;
}

static void cut_at_every_write(void (*start)(void), uint32_t before)
{
    uint32_t operation = 0;
    uint32_t updated = 0;
    while (cut_update(start, operation)) {
        const uint32_t slot = restart();
        TEST_ASSERT_NOT_EQUAL(IMAGE_NONE, slot);
        greet();
        if (slot == before) {
            TEST_ASSERT_EQUAL(PROTO_IMAGE_STATE_CONFIRMED, state_of(before));
            transfer();
            fixture_expect_accepted();
            TEST_ASSERT_EQUAL(1 - before, restart());
        } else {
            updated++;
        }
        operation++;
    }
    TEST_ASSERT_GREATER_THAN((SIZE - IMAGE_HEADER_SIZE) / 4, operation);
    TEST_ASSERT_LESS_OR_EQUAL(1, updated); /* only a commit that was cut off at its very end */
}

static void test_a_power_cut_at_any_flash_write_leaves_a_board_that_starts_and_can_be_updated(void)
{
    cut_at_every_write(start_with_one_image, 0);
    cut_at_every_write(start_with_two_images, 1);
}

/* Cuts in the marks that starts write: the trials, the rejection, and the confirmation. */
static void test_a_power_cut_in_any_start_leaves_a_board_that_starts(void)
{
    for (int starts = 0; starts <= IMAGE_TRIALS; starts++) {
        for (uint32_t noise = 1; noise <= 16; noise++) {
            start_with_one_image();
            transfer();
            for (int i = 0; i < starts; i++) {
                restart();
            }
            fixture.board.store_noise = noise;
            fixture.board.store_operations = 0;
            fixture.board.store_cut_at = 0;
            (void)image_slot_choose(name);
            TEST_ASSERT_TRUE(fixture.board.store_dead);
            fixture.board.store_dead = false;
            fixture.board.store_cut_at = UINT32_MAX;
            TEST_ASSERT_NOT_EQUAL(IMAGE_NONE, restart());
            for (int i = 0; i < IMAGE_TRIALS; i++) {
                restart();
            }
            TEST_ASSERT_EQUAL(0, restart());
        }
    }
}

static void test_a_power_cut_in_the_confirmation_costs_a_trial_at_most(void)
{
    for (uint32_t noise = 1; noise <= 16; noise++) {
        start_with_one_image();
        transfer();
        restart();
        fixture.board.store_noise = noise;
        fixture.board.store_operations = 0;
        fixture.board.store_cut_at = 0;
        greet();
        TEST_ASSERT_TRUE(fixture.board.store_dead);
        TEST_ASSERT_EQUAL(1, restart());
        greet();
        TEST_ASSERT_EQUAL(PROTO_IMAGE_STATE_CONFIRMED, state_of(1));
    }
}

static void test_a_transfer_that_was_cut_off_goes_on_where_it_ended(void)
{
    for (uint32_t sent = 0; sent <= CHUNKS; sent++) {
        start_with_one_image();
        begin();
        for (uint32_t i = 0; i < sent; i++) {
            send_chunk(i);
        }
        fixture_run(UPDATE_SILENCE_MS + 10);
        const uint32_t before = fixture.board.store_operations;
        begin();
        fixture_expect_accepted();
        struct proto_update_begin_reply begun;
        TEST_ASSERT_TRUE(
            proto_update_begin_reply_decode(&begun, fixture.reply.payload, fixture.reply.payload_length));
        TEST_ASSERT_EQUAL(sent, begun.next);
        TEST_ASSERT_EQUAL(0, begun.stall_ms);
        TEST_ASSERT_EQUAL(before, fixture.board.store_operations);
        for (uint32_t i = sent; i < CHUNKS; i++) {
            send_chunk(i);
        }
        finish();
        fixture_expect_accepted();
        TEST_ASSERT_EQUAL(1, restart());
    }
}

static void test_a_chunk_that_is_repeated_out_of_order_or_damaged_is_not_written(void)
{
    start_with_one_image();
    begin();
    send_chunk(0);
    send_chunk(1);
    const uint32_t before = fixture.board.store_operations;
    send_chunk(0);
    fixture_expect_accepted();
    send_chunk(3);
    fixture_expect_refused(PROTO_REFUSAL_REASON_UPDATE_GAP, 2);
    image[2 * UPDATE_CHUNK + 5] ^= 1u;
    send_chunk(2);
    fixture_expect_refused(PROTO_REFUSAL_REASON_UPDATE_BAD_CHUNK, 2);
    digests[3][7] ^= 1u;
    image[2 * UPDATE_CHUNK + 5] ^= 1u;
    send_chunk(2);
    fixture_expect_refused(PROTO_REFUSAL_REASON_UPDATE_BAD_CHUNK, 2);
    TEST_ASSERT_EQUAL(before, fixture.board.store_operations);
    finish();
    fixture_expect_refused(PROTO_REFUSAL_REASON_UPDATE_GAP, 2);
}

static void refuses_first_chunk(enum proto_refusal_reason reason, uint32_t detail)
{
    make_chain();
    begin();
    const uint32_t before = fixture.board.store_operations;
    send_chunk(0);
    fixture_expect_refused(reason, detail);
    TEST_ASSERT_EQUAL(before, fixture.board.store_operations);
}

static void test_an_image_for_another_board_slot_or_size_is_refused_by_its_header(void)
{
    start_with_one_image();
    make_image(image, 1, "truing-tests 1.0", 2);
    refuses_first_chunk(PROTO_REFUSAL_REASON_UPDATE_OTHER_BOARD, 0);
    make_image(image, 1, "truing-tes 1.0", 2);
    refuses_first_chunk(PROTO_REFUSAL_REASON_UPDATE_OTHER_BOARD, 0);
    make_image(image, 0, name, 2);
    refuses_first_chunk(PROTO_REFUSAL_REASON_UPDATE_BAD_IMAGE, PROTO_IMAGE_DEFECT_SLOT);
    make_image(image, 1, name, 2);
    image[20] ^= 1u;
    refuses_first_chunk(PROTO_REFUSAL_REASON_UPDATE_BAD_IMAGE, PROTO_IMAGE_DEFECT_HEADER);
    make_image(image, 1, name, 2);
    memset(image + IMAGE_MARKS_AT, 0, 4);
    refuses_first_chunk(PROTO_REFUSAL_REASON_UPDATE_BAD_IMAGE, PROTO_IMAGE_DEFECT_HEADER);
}

static void test_content_that_does_not_have_its_crc_is_never_started(void)
{
    start_with_one_image();
    image[SIZE - 1] ^= 1u;
    make_chain();
    transfer();
    fixture_expect_refused(PROTO_REFUSAL_REASON_UPDATE_BAD_IMAGE, PROTO_IMAGE_DEFECT_CONTENT);
    TEST_ASSERT_EQUAL(0, restart());
    finish();
    fixture_expect_refused(PROTO_REFUSAL_REASON_UPDATE_NONE, 0);
}

static void test_an_image_that_decays_before_its_trial_is_rejected_unseen(void)
{
    start_with_one_image();
    transfer();
    fixture.board.image[1][SIZE - 1] = 0;
    TEST_ASSERT_EQUAL(0, restart());
    TEST_ASSERT_EQUAL(PROTO_IMAGE_STATE_REJECTED, state_of(1));
}

static void test_worn_out_flash_is_reported_and_the_running_image_stays(void)
{
    for (uint32_t worn = 0; worn < 200; worn += 33) {
        start_with_one_image();
        fixture.board.store_operations = 0;
        fixture.board.store_refuse_at = worn;
        begin();
        for (uint32_t i = 0; i < CHUNKS && fixture_refusal().reason == REFUSAL_NONE; i++) {
            send_chunk(i);
        }
        fixture_expect_refused(PROTO_REFUSAL_REASON_UPDATE_FAILED, 1);
        fixture.board.store_refuse_at = UINT32_MAX;
        TEST_ASSERT_EQUAL(0, restart());
    }
}

static void arm(void)
{
    const struct proto_arm_request in = {.boot_id = 1};
    uint8_t payload[PROTO_ARM_REQUEST_SIZE];
    fixture_ask(PROTO_ID_ARM, payload, proto_arm_request_encode(&in, payload, sizeof payload));
}

static void drive(float effort)
{
    const struct proto_set_effort_request in = {effort, effort};
    uint8_t payload[PROTO_SET_EFFORT_REQUEST_SIZE];
    fixture_ask(PROTO_ID_SET_EFFORT, payload, proto_set_effort_request_encode(&in, payload, sizeof payload));
}

static void test_a_robot_that_moves_takes_no_update_and_one_that_is_updated_does_not_move(void)
{
    start_with_one_image();
    arm();
    drive(0.3f);
    fixture_expect_accepted();
    fixture_run(300);
    begin();
    fixture_expect_refused(PROTO_REFUSAL_REASON_WRONG_STATE, PROTO_STATE_LIVE);
    fixture_ask(PROTO_ID_STOP, NULL, 0);
    fixture_run(1);
    begin();
    fixture_expect_refused(PROTO_REFUSAL_REASON_WHEELS_TURN, 0);
    fixture_run(3000);
    begin();
    fixture_expect_accepted();
    drive(0.3f);
    fixture_expect_refused(PROTO_REFUSAL_REASON_NOT_ARMED, 1);
    arm();
    fixture_expect_refused(PROTO_REFUSAL_REASON_UPDATE_UNDER_WAY, 0);
    fixture_run(UPDATE_SILENCE_MS + 10);
    arm();
    fixture_expect_accepted();
    drive(0.1f);
    fixture_expect_accepted();
}

static void test_restart_wants_the_boot_id_and_happens_after_its_reply(void)
{
    struct proto_restart_request in = {.boot_id = 2};
    uint8_t payload[PROTO_RESTART_REQUEST_SIZE];
    start_with_one_image();
    fixture_ask(PROTO_ID_RESTART, payload, proto_restart_request_encode(&in, payload, sizeof payload));
    fixture_expect_refused(PROTO_REFUSAL_REASON_WRONG_BOOT, 1);
    in.boot_id = 1;
    fixture_ask(PROTO_ID_RESTART, payload, proto_restart_request_encode(&in, payload, sizeof payload));
    fixture_expect_accepted();
    arm();
    fixture_expect_refused(PROTO_REFUSAL_REASON_UPDATE_UNDER_WAY, 0);
    fixture_run(UPDATE_RESTART_MS - 1);
    TEST_ASSERT_EQUAL(0, fixture.board.restarts);
    fixture_run(3);
    TEST_ASSERT_GREATER_THAN(0, fixture.board.restarts);
}

static void test_the_state_names_both_images_and_how_far_the_transfer_is(void)
{
    struct proto_update_state_reply state;
    start_with_two_images();
    begin();
    send_chunk(0);
    fixture_ask(PROTO_ID_UPDATE_STATE, NULL, 0);
    TEST_ASSERT_TRUE(
        proto_update_state_reply_decode(&state, fixture.reply.payload, fixture.reply.payload_length));
    TEST_ASSERT_EQUAL(1, state.running);
    TEST_ASSERT_EQUAL(1, state.boot_id);
    TEST_ASSERT_EQUAL(1, state.receiving);
    TEST_ASSERT_EQUAL(1, state.next);
    TEST_ASSERT_EQUAL(CHUNKS, state.chunks);
    TEST_ASSERT_EQUAL(PROTO_IMAGE_STATE_NONE, state.states[0]);
    TEST_ASSERT_EQUAL(PROTO_IMAGE_STATE_CONFIRMED, state.states[1]);
    TEST_ASSERT_EQUAL(2, state.sequences[1]);
    TEST_ASSERT_EQUAL_STRING("", state.name_0);
    TEST_ASSERT_EQUAL_STRING(name, state.name_1);
}

/* FIPS 180-4's example of one block, and one of two. */
static void test_sha256_has_the_values_of_its_standard(void)
{
    static const struct {
        const char *text;
        uint8_t digest[4];
    } examples[] = {
        {"abc", {0xba, 0x78, 0x16, 0xbf}},
        {"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", {0x24, 0x8d, 0x6a, 0x61}},
        {"", {0xe3, 0xb0, 0xc4, 0x42}},
    };
    for (size_t i = 0; i < sizeof examples / sizeof examples[0]; i++) {
        struct sha256 sha;
        uint8_t digest[SHA256_SIZE];
        sha256_begin(&sha);
        sha256_update(&sha, (const uint8_t *)examples[i].text, strlen(examples[i].text));
        sha256_end(&sha, digest);
        TEST_ASSERT_EQUAL_MEMORY(examples[i].digest, digest, sizeof examples[i].digest);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_an_update_is_started_on_trial_and_stays_once_a_host_has_greeted_it);
    RUN_TEST(test_an_image_that_never_answers_is_given_up_after_three_starts);
    RUN_TEST(test_an_image_that_is_not_greeted_starts_anew_by_itself);
    RUN_TEST(test_an_image_on_trial_takes_no_update);
    RUN_TEST(test_a_power_cut_at_any_flash_write_leaves_a_board_that_starts_and_can_be_updated);
    RUN_TEST(test_a_power_cut_in_any_start_leaves_a_board_that_starts);
    RUN_TEST(test_a_power_cut_in_the_confirmation_costs_a_trial_at_most);
    RUN_TEST(test_a_transfer_that_was_cut_off_goes_on_where_it_ended);
    RUN_TEST(test_a_chunk_that_is_repeated_out_of_order_or_damaged_is_not_written);
    RUN_TEST(test_an_image_for_another_board_slot_or_size_is_refused_by_its_header);
    RUN_TEST(test_content_that_does_not_have_its_crc_is_never_started);
    RUN_TEST(test_an_image_that_decays_before_its_trial_is_rejected_unseen);
    RUN_TEST(test_worn_out_flash_is_reported_and_the_running_image_stays);
    RUN_TEST(test_a_robot_that_moves_takes_no_update_and_one_that_is_updated_does_not_move);
    RUN_TEST(test_restart_wants_the_boot_id_and_happens_after_its_reply);
    RUN_TEST(test_the_state_names_both_images_and_how_far_the_transfer_is);
    RUN_TEST(test_sha256_has_the_values_of_its_standard);
    return UNITY_END();
}
