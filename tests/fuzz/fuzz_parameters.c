/* For all settings and all contents of the parameter store, the values in force are finite and within their
 * limits.
 *
 * Input: a flag byte (bit 0: the CRC of slot 0 is made right, 1: of slot 1, 2: the power fails in a save),
 * the length of slot 0's content in words u8, slot 0, the same for slot 1, then settings: index u16, value
 * f32, until the input ends. */
#include <math.h>
#include <string.h>

#include "crc32.h"
#include "rig.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { WORD = 4, MAGIC_BYTES = 4, HEADER_WORDS = 5, CRC_WORD = 5, COMMIT_WORD = 6, FIRST_RECORD_WORD = 8 };

static void values_are_sound(void)
{
    for (uint16_t i = 0; i < PROTO_PARAMETER_COUNT; i++) {
        const float value = rig.controller.robot.parameters.values[i];
        const struct proto_parameter_info *const info = &proto_parameters[i];
        RIG_REQUIRE(isfinite(value) && value >= info->minimum && value <= info->maximum);
        RIG_REQUIRE(info->kind == PROTO_PARAMETER_KIND_REAL || value == truncf(value));
    }
}

/* A slot as the board itself would have written it, but for what the input changes. */
static void fill_slot(uint32_t slot, struct rig_input *input, const uint8_t *sound, bool right_crc)
{
    uint8_t *const bytes = rig.board.store[slot];
    const uint8_t *content;
    const size_t length = rig_bytes(input, (size_t)rig_u8(input) * WORD, &content);
    memcpy(bytes, sound, (size_t)FIRST_RECORD_WORD * WORD);
    memcpy(bytes + MAGIC_BYTES, content, length);
    if (right_crc) {
        uint32_t records;
        memcpy(&records, bytes + 3 * WORD, sizeof records); /* the hosts of this program are little endian */
        const size_t covered = records <= 1024 ? (size_t)records * 2 * WORD : 0;
        uint32_t crc = crc32_update(0, bytes, (size_t)HEADER_WORDS * WORD);
        crc = crc32_update(crc, bytes + (size_t)FIRST_RECORD_WORD * WORD, covered);
        memcpy(bytes + (size_t)CRC_WORD * WORD, &crc, sizeof crc);
        memcpy(bytes + (size_t)COMMIT_WORD * WORD, sound + (size_t)COMMIT_WORD * WORD, WORD);
    }
}

/* The first words of a slot after a save by this very image. */
static const uint8_t *sound_slot(void)
{
    static uint8_t bytes[HAL_STORE_SLOT_SIZE];
    static bool known;
    if (!known) {
        rig_power_up();
        rig_tick();
        rig_ask(PROTO_ID_PARAM_SAVE, NULL, 0);
        RIG_REQUIRE(rig.accepted);
        memcpy(bytes, rig.board.store[0], sizeof bytes);
        known = true;
    }
    return bytes;
}

static void set(uint16_t index, float value)
{
    const struct proto_param_set_request request = {.index = index, .value = value};
    uint8_t payload[PROTO_PARAM_SET_REQUEST_SIZE];
    rig_ask(PROTO_ID_PARAM_SET, payload, proto_param_set_request_encode(&request, payload, sizeof payload));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    float kept[PROTO_PARAMETER_COUNT];
    struct rig_input input = {.at = data, .left = size};
    const uint8_t *const sound = sound_slot();
    hal_host_init(&rig.board);
    const uint8_t flags = rig_u8(&input);
    fill_slot(0, &input, sound, (flags & 1u) != 0);
    fill_slot(1, &input, sound, (flags & 2u) != 0);
    rig_power_cycle();
    values_are_sound();

    while (input.left > 0) {
        const uint16_t index = rig_u16(&input);
        const uint32_t bits = rig_u32(&input);
        float value;
        memcpy(&value, &bits, sizeof value);
        set(index, value);
        values_are_sound();
    }
    rig_tick();
    for (uint16_t i = 0; i < PROTO_PARAMETER_COUNT; i++) {
        const uint8_t payload[2] = {(uint8_t)i, (uint8_t)(i >> 8)};
        rig_ask(PROTO_ID_PARAM_LIST, payload, sizeof payload);
        RIG_REQUIRE(rig.accepted);
    }

    /* A save repairs the store, or, when the power fails in it, leaves a store that can be loaded. */
    memcpy(kept, rig.controller.robot.parameters.values, sizeof kept);
    if ((flags & 4u) != 0) {
        rig.board.store_cut_at = rig.board.store_operations + flags / 8u;
    }
    rig_ask(PROTO_ID_PARAM_SAVE, NULL, 0);
    const bool saved = rig.accepted && !rig.board.store_dead;
    rig_power_cycle();
    values_are_sound();
    RIG_REQUIRE(!saved || memcmp(kept, rig.controller.robot.parameters.values, sizeof kept) == 0);
    return 0;
}
