/* Connects board and plant in lock step: before either is read, the plant is advanced to that time. */
#include "rig.h"

#include "line_noise.h"
#include "pin_map.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PS_PER_US 1000000ULL
#define STEP_PS   (PLANT_STEP_US * PS_PER_US)
#define LINK_BAUD 921600.0

/* Even a wheel at rest is polled this often, in plant steps: a tenth of a second. */
#define MAX_QUIET_STEPS 2000.0

struct sent_byte {
    uint64_t time_ps;
    uint8_t byte;
};

struct rig {
    struct board *board;
    struct plant *plant;
    const struct pin_map *map;
    uint64_t plant_steps;
    double duty[RIG_WHEELS][2];
    double led, enable;
    bool enable_wired; /* the drivers have an enable input, with a resistor to ground */
    struct encoder {
        enum rig_encoder_fault fault;
        int64_t offset; /* keeps the counts continuous when a fault comes or goes */
        struct line_noise noise;
    } encoder[RIG_WHEELS];
    bool encoders_swapped;
    bool swapped, motor_connected[RIG_WHEELS], sense_connected;
    double bench_v, link_baud;
    uint64_t link_noise_period_ps, link_noise_ps;
    struct sent_byte *sent;
    size_t sent_capacity, sent_head, sent_count;
};

static void advance_plant(struct rig *r, uint64_t time_ps)
{
    uint64_t steps = time_ps / STEP_PS;
    if (r->plant != NULL && steps > r->plant_steps) {
        const enum board_phase before = board_enter(r->board, BOARD_PLANT);
        plant_advance(r->plant, steps - r->plant_steps);
        board_enter(r->board, before);
    }
    r->plant_steps = steps > r->plant_steps ? steps : r->plant_steps;
}

static void drive_bridges(struct rig *r)
{
    for (int wheel = 0; r->plant != NULL && wheel < RIG_WHEELS; wheel++) {
        const double *duty = r->duty[r->swapped ? 1 - wheel : wheel];
        bool connected = r->motor_connected[wheel] && (!r->enable_wired || r->enable > 0);
        double in_in[2];
        driver_to_bridge(r->map->driver, duty, in_in);
        plant_set_bridge(r->plant, wheel, connected ? in_in[0] : 0, connected ? in_in[1] : 0);
    }
}

static bool same_pin(struct board_pin one, struct board_pin other)
{
    return one.port == other.port && one.number == other.number;
}

static void pin_driven(void *context, struct board_pin pin, double duty, uint64_t time_ps)
{
    struct rig *r = context;
    if (same_pin(pin, r->map->led)) {
        r->led = duty;
        return;
    }
    if (same_pin(pin, r->map->enable)) {
        r->enable = duty;
        advance_plant(r, time_ps);
        drive_bridges(r);
        return;
    }
    for (int i = 0; i < 2 * RIG_WHEELS; i++) {
        if (same_pin(pin, r->map->bridge[i / 2][i % 2])) {
            r->duty[i / 2][i % 2] = duty;
            advance_plant(r, time_ps);
            drive_bridges(r);
        }
    }
}

/* Counts that the two phases make with one of them at rest: the other toggles to and fro between two states.
 */
static int64_t as_wired(enum rig_encoder_fault fault, int64_t position)
{
    int64_t state = (int64_t)((uint64_t)position & 3u);
    switch (fault) {
    case RIG_ENCODER_REVERSED:
        return -position;
    case RIG_ENCODER_PHASE_A: /* B is high in states 2 and 3; A low makes that state 3, one before 0 */
        return state >= 2 ? -1 : 0;
    case RIG_ENCODER_PHASE_B: /* A is high in states 1 and 2; B low makes that state 1 */
        return state == 1 || state == 2 ? 1 : 0;
    case RIG_ENCODER_UNPLUGGED:
    case RIG_ENCODER_FROZEN:
        return 0;
    default:
        return position;
    }
}

/* The wheel whose encoder is plugged into this input. */
static int wheel_of(const struct rig *r, int encoder)
{
    return r->encoders_swapped ? 1 - encoder : encoder;
}

/* Encoders are read one plant step late: only then is the time of an edge within a step known, whatever the
 * bridges do next. Returns the fraction of the last step that has passed at this time. */
static double share_of_step(struct rig *r, uint64_t time_ps)
{
    advance_plant(r, time_ps);
    double share = ((double)time_ps - (double)(r->plant_steps * STEP_PS)) / (double)STEP_PS;
    return share < 0 ? 0 : share > 1 ? 1 : share;
}

static int64_t encoder_position(void *context, int encoder, uint64_t time_ps)
{
    struct rig *r = context;
    int64_t position = 0;
    if (encoder < 0 || encoder >= RIG_WHEELS) {
        return 0;
    }
    if (r->plant != NULL) {
        position = plant_encoder_within(r->plant, wheel_of(r, encoder), share_of_step(r, time_ps));
    }
    return as_wired(r->encoder[encoder].fault, position) + r->encoder[encoder].offset;
}

static uint8_t encoder_noise(void *context, int encoder, uint64_t time_ps)
{
    struct rig *r = context;
    if (encoder < 0 || encoder >= RIG_WHEELS || !line_noise_is_on(&r->encoder[encoder].noise)) {
        return 0;
    }
    return line_noise_bits(&r->encoder[encoder].noise, encoder_position(context, encoder, time_ps), time_ps);
}

/* A picosecond is added so that the edge has come for certain by then. */
static uint64_t encoder_quiet_until(void *context, int encoder, uint64_t time_ps)
{
    struct rig *r = context;
    if (encoder < 0 || encoder >= RIG_WHEELS) {
        return UINT64_MAX;
    }
    const uint64_t noise_ps = line_noise_quiet_until(&r->encoder[encoder].noise, time_ps);
    if (r->plant == NULL) {
        return noise_ps;
    }
    double steps = plant_encoder_quiet_steps(r->plant, wheel_of(r, encoder), share_of_step(r, time_ps));
    steps = steps < MAX_QUIET_STEPS ? steps : MAX_QUIET_STEPS;
    const uint64_t edge_ps = time_ps + (uint64_t)(steps * (double)STEP_PS) + 1;
    return edge_ps < noise_ps ? edge_ps : noise_ps;
}

static double pin_voltage(void *context, struct board_pin pin, uint64_t time_ps)
{
    struct rig *r = context;
    if (!same_pin(pin, r->map->battery)) {
        return 0;
    }
    advance_plant(r, time_ps);
    if (!r->sense_connected) {
        return 0; /* the lower resistor pulls the pin down */
    }
    if (r->bench_v >= 0) {
        return r->bench_v * r->map->divider;
    }
    return r->plant == NULL ? 0 : plant_battery_v(r->plant) * r->map->divider;
}

static bool grow_sent(struct rig *r)
{
    size_t capacity = r->sent_capacity == 0 ? 4096 : 2 * r->sent_capacity;
    struct sent_byte *grown = malloc(capacity * sizeof *grown);
    if (grown == NULL) {
        return false;
    }
    for (size_t i = 0; r->sent_capacity != 0 && i < r->sent_count; i++) {
        grown[i] = r->sent[(r->sent_head + i) % r->sent_capacity];
    }
    free(r->sent);
    r->sent = grown;
    r->sent_capacity = capacity;
    r->sent_head = 0;
    return true;
}

static void usart_sent(void *context, int usart, uint8_t byte, double line_baud, uint64_t time_ps)
{
    struct rig *r = context;
    if (usart != RIG_LINK_USART || r->link_baud <= 0 ||
        (r->sent_count == r->sent_capacity && !grow_sent(r))) {
        return;
    }
    if (fabs(line_baud / r->link_baud - 1) > 0.03) {
        byte = (uint8_t)(((unsigned)byte << 1 | (unsigned)byte >> 7) ^
                         0x80u); /* the host's receiver samples the wrong bits */
    }
    r->sent[(r->sent_head + r->sent_count) % r->sent_capacity] = (struct sent_byte){time_ps, byte};
    r->sent_count++;
}

static bool usart_noise(void *context, int usart, uint64_t time_ps)
{
    const struct rig *r = context;
    return usart == RIG_LINK_USART && time_ps % r->link_noise_period_ps < r->link_noise_ps;
}

struct rig *rig_create(const struct plant_params *robot, uint64_t seed, const uint8_t unique_id[12],
                       bool crystal_alive, enum rig_target target)
{
    const struct pin_map *map = pin_map_of(target);
    struct rig *r = map == NULL ? NULL : calloc(1, sizeof *r);
    if (r == NULL) {
        return NULL;
    }
    r->map = map;
    struct board_options options = {.seed = seed,
                                    .crystal_hz = map->crystal_hz,
                                    .wires = {r, pin_driven, encoder_position, encoder_noise,
                                              encoder_quiet_until, pin_voltage, usart_sent, usart_noise}};
    memcpy(options.unique_id, unique_id, sizeof options.unique_id);
    r->plant = robot != NULL ? plant_create(robot, seed) : NULL;
    r->board = board_create(&options);
    if (r->board == NULL || (robot != NULL && r->plant == NULL)) {
        rig_destroy(r);
        return NULL;
    }
    r->bench_v = -1;
    r->led = -1;
    r->enable = -1;
    r->link_baud = LINK_BAUD;
    r->sense_connected = true;
    board_set_crystal(r->board, crystal_alive);
    for (int wheel = 0; wheel < RIG_WHEELS; wheel++) {
        r->motor_connected[wheel] = true;
        board_wire_encoder(r->board, wheel, map->encoder[wheel][0], map->encoder[wheel][1]);
        board_watch_pin(r->board, map->bridge[wheel][0]);
        board_watch_pin(r->board, map->bridge[wheel][1]);
        r->duty[wheel][0] = r->duty[wheel][1] = -1;
    }
    board_watch_pin(r->board, map->led);
    board_watch_pin(r->board, map->enable);
    rig_emergency_stop(r, false);
    drive_bridges(r);
    return r;
}

void rig_destroy(struct rig *rig)
{
    if (rig == NULL) {
        return;
    }
    board_destroy(rig->board);
    plant_destroy(rig->plant);
    free(rig->sent);
    free(rig);
}

struct board *rig_board(struct rig *rig)
{
    return rig->board;
}

bool rig_flash(struct rig *rig, uint32_t address, const uint8_t *data, size_t length)
{
    return board_flash(rig->board, address, data, length);
}

void rig_run_us(struct rig *rig, uint64_t span_us)
{
    board_run_until(rig->board, board_time_ps(rig->board) + span_us * PS_PER_US);
}

uint64_t rig_time_us(const struct rig *rig)
{
    return board_time_ps(rig->board) / PS_PER_US;
}

void rig_link_write(struct rig *rig, const uint8_t *data, size_t length)
{
    uint64_t now_ps = board_time_ps(rig->board);
    for (size_t i = 0; i < length && rig->link_baud > 0; i++) {
        board_usart_receive(rig->board, RIG_LINK_USART, data[i], rig->link_baud, now_ps);
    }
}

size_t rig_link_read(struct rig *rig, uint8_t *out, size_t capacity)
{
    size_t taken = 0;
    uint64_t now_ps = board_time_ps(rig->board);
    while (taken < capacity && rig->sent_count > 0 && rig->sent[rig->sent_head].time_ps <= now_ps) {
        out[taken++] = rig->sent[rig->sent_head].byte;
        rig->sent_head = (rig->sent_head + 1) % rig->sent_capacity;
        rig->sent_count--;
    }
    return taken;
}

enum board_phase rig_phase(const struct rig *rig)
{
    return board_phase(rig->board);
}

size_t rig_link_pending(const struct rig *rig)
{
    return board_usart_inbound(rig->board, RIG_LINK_USART);
}

void rig_link_baud(struct rig *rig, double baud)
{
    rig->link_baud = baud;
}

void rig_link_noise(struct rig *rig, uint32_t period_ns, uint32_t pulse_ns)
{
    rig->link_noise_period_ps = period_ns * 1000ULL;
    rig->link_noise_ps = pulse_ns * 1000ULL;
    board_usart_disturbed(rig->board, period_ns != 0 && pulse_ns != 0);
}

void rig_truth(struct rig *rig, struct plant_state *out)
{
    advance_plant(rig, board_time_ps(rig->board));
    if (rig->plant == NULL) {
        *out = (struct plant_state){.steps = rig->plant_steps};
    } else {
        plant_state(rig->plant, out);
    }
}

/* The board asks anew what the lines of an input do. */
static void disturb(struct rig *rig, int encoder)
{
    board_encoder_disturbed(rig->board, encoder, line_noise_is_on(&rig->encoder[encoder].noise));
}

bool rig_set_unmodelled_effects(struct rig *rig, const struct plant_unmodelled_effects *effects)
{
    advance_plant(rig, board_time_ps(rig->board));
    if (rig->plant == NULL || !plant_set_unmodelled_effects(rig->plant, effects)) {
        return false;
    }
    for (int encoder = 0; encoder < RIG_WHEELS; encoder++) {
        disturb(rig, encoder);
    }
    return true;
}

void rig_place(struct rig *rig, double x_m, double y_m, double theta_rad)
{
    advance_plant(rig, board_time_ps(rig->board));
    if (rig->plant != NULL) {
        plant_place(rig->plant, x_m, y_m, theta_rad);
    }
}

bool rig_record(struct rig *rig, struct plant_sample *out, size_t capacity, uint64_t every_steps)
{
    advance_plant(rig, board_time_ps(rig->board));
    return rig->plant != NULL && plant_record(rig->plant, out, capacity, every_steps);
}

size_t rig_recorded(struct rig *rig)
{
    advance_plant(rig, board_time_ps(rig->board));
    return rig->plant == NULL ? 0 : plant_recorded(rig->plant);
}

void rig_bridge(const struct rig *rig, int wheel, double out[2])
{
    out[0] = rig->duty[wheel][0];
    out[1] = rig->duty[wheel][1];
}

double rig_led(const struct rig *rig)
{
    return rig->led;
}

double rig_driver_enable(const struct rig *rig)
{
    return rig->enable;
}

void rig_wire_driver_enable(struct rig *rig, bool wired)
{
    advance_plant(rig, board_time_ps(rig->board));
    rig->enable_wired = wired;
    drive_bridges(rig);
}

void rig_encoder_fault(struct rig *rig, int wheel, enum rig_encoder_fault fault)
{
    if (wheel < 0 || wheel >= RIG_WHEELS) {
        return;
    }
    uint64_t now_ps = board_time_ps(rig->board);
    struct encoder *e = &rig->encoder[wheel];
    int64_t before = encoder_position(rig, wheel, now_ps);
    e->fault = fault;
    e->offset = 0;
    int64_t raw = encoder_position(rig, wheel, now_ps);
    e->offset = before - raw;
    disturb(rig, wheel);
}

bool rig_encoder_noise(struct rig *rig, int wheel, const struct rig_encoder_noise *noise)
{
    const bool good = wheel >= 0 && wheel < RIG_WHEELS && noise->burst_us <= noise->period_us &&
                      (noise->period_us == 0 || noise->pulse_ns > 0);
    if (good) {
        struct line_noise *line = &rig->encoder[wheel].noise;
        line->of = *noise;
        line->seen = encoder_position(rig, wheel, board_time_ps(rig->board));
        disturb(rig, wheel);
    }
    return good;
}

void rig_swap_motors(struct rig *rig, bool swapped)
{
    advance_plant(rig, board_time_ps(rig->board));
    rig->swapped = swapped;
    drive_bridges(rig);
}

void rig_motor_connected(struct rig *rig, int wheel, bool connected)
{
    advance_plant(rig, board_time_ps(rig->board));
    rig->motor_connected[wheel] = connected;
    drive_bridges(rig);
}

void rig_turn_wheel(struct rig *rig, int wheel, double angle_rad)
{
    advance_plant(rig, board_time_ps(rig->board));
    if (rig->plant != NULL) {
        plant_turn_wheel(rig->plant, wheel, angle_rad);
        for (int encoder = 0; encoder < RIG_WHEELS; encoder++) {
            disturb(rig, encoder);
        }
    }
}

void rig_swap_encoders(struct rig *rig, bool swapped)
{
    const uint64_t now_ps = board_time_ps(rig->board);
    int64_t before[RIG_WHEELS];
    for (int wheel = 0; wheel < RIG_WHEELS; wheel++) {
        before[wheel] = encoder_position(rig, wheel, now_ps);
    }
    rig->encoders_swapped = swapped;
    for (int wheel = 0; wheel < RIG_WHEELS; wheel++) {
        rig->encoder[wheel].offset += before[wheel] - encoder_position(rig, wheel, now_ps);
        disturb(rig, wheel);
    }
}

void rig_hold_wheel(struct rig *rig, int wheel, double torque_nm)
{
    advance_plant(rig, board_time_ps(rig->board));
    if (rig->plant != NULL) {
        plant_hold_wheel(rig->plant, wheel, torque_nm);
    }
}

void rig_battery_sense_connected(struct rig *rig, bool connected)
{
    rig->sense_connected = connected;
}

void rig_cut_off_battery(struct rig *rig, bool cut_off)
{
    advance_plant(rig, board_time_ps(rig->board));
    if (rig->plant != NULL) {
        plant_cut_off_battery(rig->plant, cut_off);
    }
}

void rig_emergency_stop(struct rig *rig, bool pressed)
{
    for (size_t i = 0; i < sizeof rig->map->stop / sizeof rig->map->stop[0]; i++) {
        board_set_pin(rig->board, rig->map->stop[i], pressed ? BOARD_OPEN : BOARD_LOW);
    }
}

void rig_bench_voltage(struct rig *rig, double volts)
{
    rig->bench_v = volts;
}

void rig_crystal_alive(struct rig *rig, bool alive)
{
    board_set_crystal(rig->board, alive);
}

void rig_crystal_hz(struct rig *rig, uint32_t hz)
{
    board_set_crystal_hz(rig->board, hz);
}

void rig_crystal_ppm(struct rig *rig, double ppm)
{
    board_set_crystal_hz(rig->board, (uint32_t)lround(rig->map->crystal_hz * (1.0 + ppm * 1e-6)));
}

void rig_power(struct rig *rig, bool on)
{
    board_power(rig->board, on);
}

void rig_reset(struct rig *rig, enum board_reset cause)
{
    board_reset(rig->board, cause);
}
