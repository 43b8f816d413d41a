/* Shared by the fuzz programs: a controller on the in-memory board, and the properties checked for all
 * inputs. */
#include "rig.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct rig rig;

void rig_require(bool holds, const char *condition, const char *file, int line)
{
    if (!holds) {
        (void)fprintf(stderr, "%s:%d: broken promise: %s\n", file, line, condition);
        abort();
    }
}

static void start(void)
{
    memset(&rig.controller, 0, sizeof rig.controller);
    memset(&rig.decoder, 0, sizeof rig.decoder);
    rig.sequence = 0;
    rig.may_move = false;
    hal_host_select(&rig.board);
    controller_init(&rig.controller);
    rig.controller.robot.supervisor.armed = true;
}

void rig_power_up(void)
{
    hal_host_init(&rig.board);
    start();
}

void rig_power_cycle(void)
{
    hal_host_power_cycle(&rig.board);
    start();
}

static bool is_moving(void)
{
    return supervisor_is_moving(&rig.controller.robot.supervisor);
}

void rig_tick(void)
{
    controller_tick(&rig.controller);
    controller_poll(&rig.controller);
    RIG_REQUIRE(rig.may_move || !is_moving());
    rig.may_move = rig.may_move && is_moving();
    const int32_t limit_e4 =
        (int32_t)(rig.controller.robot.parameters.values[PROTO_PARAMETER_EFFORT_LIMIT] * 10000.0f + 0.5f);
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        const int32_t effort_e4 = rig.board.effort_e4[wheel];
        RIG_REQUIRE(effort_e4 == 0 || rig.may_move);
        RIG_REQUIRE(effort_e4 <= limit_e4 && effort_e4 >= -limit_e4);
        RIG_REQUIRE(effort_e4 == 0 || rig.controller.robot.supervisor.latched == 0);
    }
    RIG_REQUIRE(rig.board.critical_depth == 0);
}

/* Takes what was sent: whole frames only; returns how many. */
static int hear(void)
{
    static uint8_t bytes[HAL_HOST_SEND_SIZE];
    const size_t length = hal_host_take_sent(&rig.board, bytes, sizeof bytes);
    int frames = 0;
    for (size_t i = 0; i < length; i++) {
        frames += frame_decoder_push(&rig.decoder, bytes[i], &rig.reply);
    }
    RIG_REQUIRE(rig.decoder.dropped == 0);
    return frames;
}

static void say(uint8_t id, const uint8_t *payload, size_t length)
{
    static uint8_t bytes[FRAME_MAX_CODED];
    (void)hear();
    const size_t size = frame_encode(id, rig.sequence, payload, length, bytes, sizeof bytes);
    RIG_REQUIRE(size != 0 && hal_host_receive(&rig.board, bytes, size) == size);
    controller_poll(&rig.controller);
    const int replies = hear();
    rig.accepted = false;
    if ((id & PROTO_REPLY_BIT) != 0) {
        RIG_REQUIRE(replies == 0);
        return;
    }
    RIG_REQUIRE(replies == 1 && rig.reply.sequence == rig.sequence);
    rig.accepted = rig.reply.id == (id | PROTO_REPLY_BIT);
    struct proto_refusal refusal;
    RIG_REQUIRE(rig.accepted ||
                (rig.reply.id == PROTO_ID_REFUSAL &&
                 proto_refusal_decode(&refusal, rig.reply.payload, rig.reply.payload_length) &&
                 refusal.request_id == id && strcmp(proto_refusal_reason_name(refusal.reason), "?") != 0));
}

/* What the bridges do and will do at the next tick. */
struct motion {
    int16_t effort_e4[HAL_WHEELS];
    uint8_t mode;
    uint8_t state;
    float command[HAL_WHEELS];
};

static struct motion motion_now(void)
{
    struct motion motion;
    memset(&motion, 0, sizeof motion);
    memcpy(motion.effort_e4, rig.board.effort_e4, sizeof motion.effort_e4);
    memcpy(motion.command, rig.controller.robot.drive.command, sizeof motion.command);
    motion.mode = rig.controller.robot.drive.mode;
    motion.state = rig.controller.robot.supervisor.state;
    return motion;
}

static bool is_at_work(const struct motion *motion)
{
    return motion->mode != PROTO_MODE_IDLE || motion->effort_e4[0] != 0 || motion->effort_e4[1] != 0;
}

static bool starts_motion(uint8_t id)
{
    return id == PROTO_ID_SET_EFFORT || id == PROTO_ID_SET_VELOCITY || id == PROTO_ID_SEQ_START;
}

static bool ends_motion(uint8_t id)
{
    return id == PROTO_ID_STOP || id == PROTO_ID_SEQ_ABORT;
}

void rig_ask(uint8_t id, const uint8_t *payload, size_t length)
{
    rig.sequence++;
    const struct motion before = motion_now();
    say(id, payload, length);
    const struct motion after = motion_now();
    if (rig.accepted && starts_motion(id)) {
        rig.may_move = true;
    } else if (rig.accepted && ends_motion(id)) {
        RIG_REQUIRE(!is_at_work(&after) && !is_moving());
        rig.may_move = false;
    } else {
        /* Refused, or not a motion request: the wheels continue as before. */
        RIG_REQUIRE(memcmp(&before, &after, sizeof before) == 0 || id == PROTO_ID_CLEAR_FAULTS);
        RIG_REQUIRE(is_at_work(&before) || !is_at_work(&after));
    }
}

void rig_ask_again(uint8_t id, const uint8_t *payload, size_t length)
{
    const struct motion before = motion_now();
    say(id, payload, length);
    const struct motion after = motion_now();
    if (id == PROTO_ID_STOP) {
        rig.may_move = false; /* executed each time it arrives */
    } else {
        RIG_REQUIRE(memcmp(&before, &after, sizeof before) == 0);
    }
}

uint8_t rig_u8(struct rig_input *input)
{
    if (input->left == 0) {
        return 0;
    }
    input->left--;
    return *input->at++;
}

uint16_t rig_u16(struct rig_input *input)
{
    const uint8_t low = rig_u8(input);
    return (uint16_t)(low | rig_u8(input) << 8);
}

uint32_t rig_u32(struct rig_input *input)
{
    const uint32_t low = rig_u16(input);
    return low | (uint32_t)rig_u16(input) << 16;
}

size_t rig_bytes(struct rig_input *input, size_t length, const uint8_t **out)
{
    const size_t taken = length < input->left ? length : input->left;
    *out = input->at;
    input->at += taken;
    input->left -= taken;
    return taken;
}
