/* For all requests, sensor values and delays, no motor runs without an accepted request, and a refused
 * request moves nothing.
 *
 * The input is a list of steps, each an opcode and its operands:
 *
 *   0 id length payload...   request, in a valid frame
 *   1 n                      n ticks (and n * 16 in the upper half)
 *   2 counts counts          the encoders move
 *   3 millivolts             the battery, 0xFFFF: unread
 *   4                        the last request again
 *   5 id                     request with the CRC of the sequence held
 *   6                        the tick overran
 *   7                        power cycle */
#include <string.h>

#include "rig.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { STEPS = 64, TICKS = 12000 };

struct request {
    uint8_t id;
    uint8_t length;
    uint8_t payload[UINT8_MAX];
};

static void ask(struct request *request, struct rig_input *input)
{
    const uint8_t *payload;
    request->id = rig_u8(input);
    request->length = (uint8_t)rig_bytes(input, rig_u8(input), &payload);
    memcpy(request->payload, payload, request->length);
    rig_ask(request->id, request->payload, request->length);
}

static void ask_with_crc(struct request *request, struct rig_input *input)
{
    const uint32_t crc = rig.controller.robot.sequence.crc;
    request->id = rig_u8(input);
    request->length = 4;
    for (uint32_t i = 0; i < 4; i++) {
        request->payload[i] = (uint8_t)(crc >> (8 * i));
    }
    rig_ask(request->id, request->payload, request->length);
}

static uint32_t wait(uint8_t ticks)
{
    const uint32_t count = ticks < 128 ? ticks : (ticks - 127u) * 16u;
    for (uint32_t i = 0; i < count; i++) {
        rig_tick();
    }
    return count;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct rig_input input = {.at = data, .left = size};
    struct request request = {.id = PROTO_ID_STATUS};
    uint32_t ticks = 0;
    bool asked = false;
    rig_power_up();
    rig_tick();
    for (int step = 0; step < STEPS && input.left > 0 && ticks < TICKS; step++) {
        struct hal_sample *const sample = &rig.board.sample;
        switch (rig_u8(&input) & 7u) {
        case 0:
            ask(&request, &input);
            asked = true;
            break;
        case 1:
            ticks += wait(rig_u8(&input));
            break;
        case 2:
            for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
                sample->counts[wheel] =
                    (int32_t)((uint32_t)sample->counts[wheel] + (uint32_t)(int16_t)rig_u16(&input));
            }
            break;
        case 3:
            sample->battery_mv = rig_u16(&input);
            sample->battery_valid = sample->battery_mv != UINT16_MAX;
            break;
        case 4:
            if (asked) {
                rig_ask_again(request.id, request.payload, request.length);
            }
            break;
        case 5:
            ask_with_crc(&request, &input);
            asked = true;
            break;
        case 6:
            controller_note_overrun(&rig.controller);
            break;
        default:
            rig_power_cycle();
            asked = false;
            break;
        }
    }
    rig_ask(PROTO_ID_STOP, NULL, 0);
    rig_tick();
    return 0;
}
