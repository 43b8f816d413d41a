/* Receives an image of the firmware into the slot that does not run. */
#include "update.h"

#include <string.h>

#include "robot_parameters.h"
#include "robot_time.h"

_Static_assert((int)HAL_IMAGE_SLOTS == 2, "the slot that does not run is the other one");
_Static_assert(sizeof((struct proto_update_state_reply){0}.name_0) == IMAGE_NAME_SIZE + 1, "a name fits");

static uint32_t target(void)
{
    return 1u - hal_image_running();
}

void update_init(struct update *update)
{
    struct image_slot running;
    *update = (struct update){0};
    image_slot_read(hal_image_running(), &running);
    update->on_trial = running.state == (uint8_t)PROTO_IMAGE_STATE_TRIAL;
}

static void forget(struct update *update)
{
    update->chunks = 0;
    update->next = 0;
    update->receiving = false;
}

void update_report(const struct update *update, const struct robot *robot,
                   struct proto_update_state_reply *out)
{
    char *const names[HAL_IMAGE_SLOTS] = {out->name_0, out->name_1};
    *out = (struct proto_update_state_reply){
        .boot_id = robot->boot_id,
        .running = (uint8_t)hal_image_running(),
        .receiving = update->receiving,
        .next = update->next,
        .chunks = update->chunks,
        .chunk_size = UPDATE_CHUNK,
        .slot_size = hal_image_size(),
    };
    for (uint32_t slot = 0; slot < (uint32_t)HAL_IMAGE_SLOTS; slot++) {
        struct image_slot image;
        image_slot_read(slot, &image);
        out->states[slot] = image.state;
        if (image.state != (uint8_t)PROTO_IMAGE_STATE_NONE) {
            out->sequences[slot] = image.marks.sequence;
            memcpy(names[slot], image.header.name, IMAGE_NAME_SIZE);
        }
    }
}

/* Retired first, or an interrupted erase could leave a commit in front of half an image. */
static bool erase(struct robot *robot, uint32_t slot, uint32_t *stall_ms)
{
    bool good = image_slot_retire(slot);
    for (uint32_t sector = 0; good && sector < hal_image_sectors(slot); sector++) {
        uint32_t missed_ticks;
        hal_watchdog_feed();
        good = hal_image_erase(slot, sector, &missed_ticks);
        hal_watchdog_feed();
        robot_make_up(robot, missed_ticks);
        *stall_ms += missed_ticks;
    }
    return good;
}

static struct refusal may_begin(const struct update *update, struct robot *robot, uint32_t size)
{
    if (update->on_trial) {
        return refused(PROTO_REFUSAL_REASON_UPDATE_ON_TRIAL, 0);
    }
    if (size <= (uint32_t)IMAGE_HEADER_SIZE || size > hal_image_size()) {
        return refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    }
    const struct refusal verdict = robot_prepare_stall(robot);
    if (verdict.reason == REFUSAL_NONE && !(robot->view.still[0] && robot->view.still[1])) {
        return refused(PROTO_REFUSAL_REASON_WHEELS_TURN, 0);
    }
    return verdict;
}

static void disarm(struct robot *robot)
{
    const uint32_t state = hal_critical_enter();
    robot->supervisor.armed = false;
    hal_critical_exit(state);
}

struct refusal update_begin(struct update *update, struct robot *robot,
                            const struct proto_update_begin_request *in, struct proto_update_begin_reply *out)
{
    uint32_t stall_ms = 0;
    const struct refusal verdict = may_begin(update, robot, in->size);
    if (verdict.reason != REFUSAL_NONE) {
        return verdict;
    }
    disarm(robot);
    const bool goes_on = update->chunks != 0u && update->size == in->size &&
                         memcmp(update->head, in->head, sizeof update->head) == 0;
    if (!goes_on) {
        forget(update);
        if (!erase(robot, target(), &stall_ms)) {
            return refused(PROTO_REFUSAL_REASON_UPDATE_FAILED, target());
        }
        memcpy(update->head, in->head, sizeof update->head);
        memcpy(update->expected, in->head, sizeof update->expected);
        update->size = in->size;
        update->chunks = (uint16_t)((in->size + UPDATE_CHUNK - 1u) / UPDATE_CHUNK);
    }
    update->receiving = true;
    update->heard_ms = robot->now_ms;
    *out = (struct proto_update_begin_reply){.next = update->next, .stall_ms = (uint16_t)stall_ms};
    return accepted();
}

static bool has_digest(const struct proto_update_data_request *in, const uint8_t expected[SHA256_SIZE])
{
    struct sha256 sha;
    uint8_t digest[SHA256_SIZE];
    sha256_begin(&sha);
    sha256_update(&sha, in->data, in->data_length);
    sha256_update(&sha, in->next, sizeof in->next);
    sha256_end(&sha, digest);
    return memcmp(digest, expected, sizeof digest) == 0;
}

/* The first chunk says what the image is for. */
static struct refusal judge_header(const struct update *update, const uint8_t *data)
{
    struct image_header header;
    struct image_slot running;
    memcpy(&header, data, sizeof header);
    image_slot_read(hal_image_running(), &running);
    const uint8_t defect = image_header_defect(&header, target());
    if (defect != (uint8_t)IMAGE_NONE) {
        return refused(PROTO_REFUSAL_REASON_UPDATE_BAD_IMAGE, defect);
    }
    if (header.size != update->size) {
        return refused(PROTO_REFUSAL_REASON_UPDATE_BAD_IMAGE, PROTO_IMAGE_DEFECT_SIZE);
    }
    return image_is_for(&header, running.header.name) ? accepted()
                                                      : refused(PROTO_REFUSAL_REASON_UPDATE_OTHER_BOARD, 0);
}

/* Words that stay erased are left out: the header's marks are written later, one by one. */
static bool write_chunk(uint32_t offset, const uint8_t *data, size_t length)
{
    bool good = true;
    for (size_t i = 0; i < length && good; i += sizeof(uint32_t)) {
        uint32_t word = IMAGE_ERASED;
        const size_t left = length - i;
        memcpy(&word, data + i, left < sizeof word ? left : sizeof word);
        good = word == IMAGE_ERASED || hal_image_program(target(), offset + (uint32_t)i, word);
    }
    return good;
}

static bool is_marked(const uint8_t *data)
{
    for (uint32_t i = IMAGE_MARKS_AT; i < (uint32_t)IMAGE_HEADER_SIZE; i++) {
        if (data[i] != 0xFFu) {
            return true;
        }
    }
    return false;
}

static struct refusal judge_chunk(const struct update *update, const struct proto_update_data_request *in)
{
    const uint32_t left = update->size - (uint32_t)in->index * UPDATE_CHUNK;
    const uint32_t length = left < (uint32_t)UPDATE_CHUNK ? left : (uint32_t)UPDATE_CHUNK;
    if (in->data_length != length) {
        return refused(PROTO_REFUSAL_REASON_BAD_LENGTH, (uint32_t)in->data_length);
    }
    if (!has_digest(in, update->expected)) {
        return refused(PROTO_REFUSAL_REASON_UPDATE_BAD_CHUNK, in->index);
    }
    if (in->index != 0u) {
        return accepted();
    }
    return is_marked(in->data) ? refused(PROTO_REFUSAL_REASON_UPDATE_BAD_IMAGE, PROTO_IMAGE_DEFECT_HEADER)
                               : judge_header(update, in->data);
}

struct refusal update_data(struct update *update, uint32_t now_ms, const struct proto_update_data_request *in)
{
    if (!update->receiving) {
        return refused(PROTO_REFUSAL_REASON_UPDATE_NONE, 0);
    }
    if (in->index > update->next || in->index >= update->chunks) {
        return refused(PROTO_REFUSAL_REASON_UPDATE_GAP, update->next);
    }
    update->heard_ms = now_ms;
    if (in->index < update->next) { /* its reply was lost */
        return accepted();
    }
    const struct refusal verdict = judge_chunk(update, in);
    if (verdict.reason != REFUSAL_NONE) {
        return verdict;
    }
    if (!write_chunk((uint32_t)in->index * UPDATE_CHUNK, in->data, in->data_length)) {
        forget(update);
        return refused(PROTO_REFUSAL_REASON_UPDATE_FAILED, target());
    }
    memcpy(update->expected, in->next, sizeof update->expected);
    update->next++;
    return accepted();
}

struct refusal update_finish(struct update *update, uint32_t *sequence)
{
    struct image_slot image;
    struct image_slot running;
    if (!update->receiving) {
        return refused(PROTO_REFUSAL_REASON_UPDATE_NONE, 0);
    }
    if (update->next != update->chunks) {
        return refused(PROTO_REFUSAL_REASON_UPDATE_GAP, update->next);
    }
    forget(update);
    image_slot_read(target(), &image);
    image_slot_read(hal_image_running(), &running);
    if (!image_slot_is_whole(target(), &image.header)) {
        return refused(PROTO_REFUSAL_REASON_UPDATE_BAD_IMAGE, PROTO_IMAGE_DEFECT_CONTENT);
    }
    *sequence = running.marks.sequence + 1u;
    return image_slot_commit(target(), *sequence) ? accepted()
                                                  : refused(PROTO_REFUSAL_REASON_UPDATE_FAILED, target());
}

bool update_is_under_way(const struct update *update)
{
    return update->receiving || update->restarts;
}

struct refusal update_restart(struct update *update, struct robot *robot, uint32_t boot_id)
{
    if (boot_id != robot->boot_id) {
        return refused(PROTO_REFUSAL_REASON_WRONG_BOOT, robot->boot_id);
    }
    const struct refusal verdict = robot_prepare_stall(robot);
    if (verdict.reason == REFUSAL_NONE) {
        disarm(robot);
        update->restarts = true;
        update->restart_ms = robot->now_ms + UPDATE_RESTART_MS;
    }
    return verdict;
}

void update_step(struct update *update, uint32_t now_ms)
{
    if (update->receiving && now_ms - update->heard_ms >= (uint32_t)UPDATE_SILENCE_MS) {
        update->receiving = false;
    }
    if (update->on_trial && update->greeted) {
        (void)image_slot_confirm(hal_image_running());
        update->on_trial = false;
    }
    const bool alone = update->on_trial && now_ms >= (uint32_t)UPDATE_TRIAL_MS;
    if (alone || (update->restarts && now_ms >= update->restart_ms)) {
        hal_restart();
    }
}
