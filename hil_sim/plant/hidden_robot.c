/* A robot with hidden effects: its own state and its own step.
 *
 * Up to three pieces in a row on each side: motor, wheel, floor contact. What the effects leave rigid is one
 * piece. Pieces that are joined by a spring or a tyre move in quarter steps, speeds first (symplectic), since
 * such joints are stiff. All speeds are at the rim, m/s; all masses as the rim feels them, kg.
 */
#include "hidden_robot.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "bristle.h"
#include "disturbance.h"
#include "driver.h"
#include "gear.h"
#include "load.h"
#include "noise.h"
#include "sensor.h"
#include "tyre.h"
#include "winding.h"

enum { FINE = 4 };

static const double step_s = PLANT_STEP_US * 1e-6;
static const double gravity_mps2 = 9.81;

/* One side of the robot. */
struct side {
    struct driver driver;
    double made; /* effort that the bridge makes; NAN: it floats */
    struct winding winding;
    double bend_rad;
    double motor_mps, motor_rad; /* at the wheel; its own only where the gear is elastic */
    double slipped_rad;
    double wheel_mps;                 /* its own only where the tyre slips */
    double disc_before_rad, disc_rad; /* what the encoder's disc shows */
    double lost_rad;                  /* expected */
    int64_t edges;                    /* that the disc has passed */
    int64_t kept, position;           /* counts of the last step, and the total after it */
};

struct hidden {
    struct plant_hidden params;
    struct side side[PLANT_WHEELS];
    double polarisation_v;
    struct load load;
    struct disturbance disturbance;
    struct friction_speeds floor; /* how fast the floor passes below the contacts */
    bool loaded;                  /* the payload is on */
    double body_kg;               /* with payload */
    struct friction_mass body;    /* without what turns with the wheels */
};

static double rotor_kg(const struct plant_wheel_params *wheel)
{
    const double ratio = wheel->motor.gear_ratio / wheel->radius_m;
    return ratio * ratio * wheel->motor.rotor_inertia_kgm2;
}

static double rim_kg(const struct plant_wheel_params *wheel)
{
    return wheel->inertia_kgm2 / (wheel->radius_m * wheel->radius_m);
}

/* As chassis.c has it, without the wheels. */
static void weigh(struct plant *plant)
{
    struct hidden *hidden = plant->hidden;
    const struct plant_chassis_params *chassis = &plant->params.chassis;
    const struct plant_hidden_payload *payload = &hidden->params.payload;
    hidden->loaded = payload->mass_kg > 0.0 && (double)plant->steps * step_s >= payload->at_s;
    hidden->body_kg = chassis->mass_kg + (hidden->loaded ? payload->mass_kg : 0.0);
    const double inertia = chassis->yaw_inertia_kgm2 + (hidden->loaded ? payload->yaw_inertia_kgm2 : 0.0);
    const double forward = hidden->body_kg / 4.0;
    const double yaw = inertia / (chassis->wheelbase_m * chassis->wheelbase_m);
    hidden->body =
        (struct friction_mass){.left = forward + yaw, .right = forward + yaw, .cross = forward - yaw};
}

bool plant_hide(struct plant *plant, const struct plant_hidden *params)
{
    static const struct plant_hidden nothing;
    if (plant_hidden_problem(params) != NULL) {
        return false;
    }
    if (plant->hidden == NULL) {
        if (memcmp(params, &nothing, sizeof nothing) == 0) {
            return true;
        }
        plant->hidden = calloc(1, sizeof *plant->hidden);
        if (plant->hidden == NULL) {
            return false;
        }
        for (int i = 0; i < PLANT_WHEELS; i++) {
            struct side *side = &plant->hidden->side[i];
            driver_init(&side->driver);
            driver_ask(&side->driver, plant->asked_duty[i][0], plant->asked_duty[i][1]);
            side->made = 2.0; /* none, so that the first step sets the bridge */
            side->motor_rad = side->disc_before_rad = side->disc_rad = plant->angle_rad[i];
            side->edges = side->position =
                sensor_count(&plant->params.wheel[i].encoder, plant->seed, i, plant->angle_rad[i]);
        }
        plant->hidden->floor = plant->rims;
    }
    plant->hidden->params = *params;
    weigh(plant);
    return true;
}

void hidden_destroy(struct hidden *hidden)
{
    free(hidden);
}

void hidden_set_bridge(struct plant *plant, int wheel, double in1_duty, double in2_duty)
{
    driver_ask(&plant->hidden->side[wheel].driver, in1_duty, in2_duty);
}

void hidden_turn_wheel(struct plant *plant, int wheel, double angle_rad)
{
    struct side *side = &plant->hidden->side[wheel];
    side->motor_rad += angle_rad;
    side->disc_before_rad += angle_rad;
    side->disc_rad += angle_rad;
}

static void drive_bridge(struct plant *plant, int i)
{
    struct side *side = &plant->hidden->side[i];
    const double rim = i == 0 ? plant->rims.left : plant->rims.right;
    const double effort =
        driver_step(&side->driver, &plant->hidden->params.driver, i, plant->seed, plant->steps, rim);
    if (isnan(effort)) {
        if (!isnan(side->made)) {
            motor_set_bridge(&plant->motor[i], 0.0, 0.0);
        }
    } else if (!(fabs(effort - side->made) < 1e-6)) {
        const double low = 1.0 - fabs(effort);
        motor_set_bridge(&plant->motor[i], effort >= 0.0 ? 1.0 : low, effort >= 0.0 ? low : 1.0);
    } else {
        return;
    }
    side->made = effort;
}

/* Electrical step of one motor; returns the mean force at the rim, N. */
static double motor_force_n(struct plant *plant, int i, double motor_mps, double supply_v, double *drawn_as)
{
    const struct plant_hidden *params = &plant->hidden->params;
    struct winding *winding = &plant->hidden->side[i].winding;
    struct motor *motor = &plant->motor[i];
    const double emf = plant->emf_per_speed[i] * (1.0 - params->thermal.emf_per_k * winding->case_k);
    struct motor_flow flow = motor_step(motor, emf * motor_mps, supply_v);
    const double most_a = params->driver.current_limit_a;
    if (most_a > 0.0 && fabs(flow.motor_charge_as) > most_a * step_s) {
        /* The driver chops what is too much: the current stays, and takes less from the supply. */
        const double share = most_a * step_s / fabs(flow.motor_charge_as);
        flow.motor_charge_as *= share;
        flow.supply_charge_as *= share;
        motor->current_a = copysign(fmin(fabs(motor->current_a), most_a), motor->current_a);
    }
    const double current_a = flow.motor_charge_as / step_s;
    winding_step(winding, &params->thermal, current_a, motor->resistance_ohm);
    if (winding_update(winding, &params->thermal)) {
        const double warm = 1.0 + params->thermal.resistance_per_k * winding->winding_k;
        motor_set_resistance(motor, plant->params.wheel[i].motor.resistance_ohm * warm);
    }
    *drawn_as += flow.supply_charge_as;
    return emf * current_a;
}

/* What the mechanics of one (fine) step works on. */
struct motion {
    double span_s;
    double motor_n[PLANT_WHEELS]; /* at the motor: electrical, ripple, disturbance */
    double floor_n[PLANT_WHEELS]; /* at the wheel: what the floor does to it */
    double body_n;                /* on the body */
    struct friction_limits limits;
};

static double speed_of(const struct friction_speeds *speeds, int i)
{
    return i == 0 ? speeds->left : speeds->right;
}

/* Dry friction of plant_params on a piece that it alone holds: a soft threshold on its momentum. */
static double held_back(double momentum, double impulse)
{
    return momentum > impulse ? momentum - impulse : momentum < -impulse ? momentum + impulse : 0.0;
}

static void move_pieces(struct plant *plant, const struct motion *motion)
{
    struct hidden *hidden = plant->hidden;
    const struct plant_hidden *params = &hidden->params;
    const bool elastic = gear_is_elastic(&params->gear);
    const bool slips = params->tyre.grip > 0.0;
    const double span_s = motion->span_s;
    const double dry[PLANT_WHEELS] = {motion->limits.left, motion->limits.right};
    const struct friction_speeds rims = plant->rims;
    const struct friction_speeds floor = slips ? hidden->floor : rims;
    double pull_n[PLANT_WHEELS];     /* on the floor contacts */
    double turning_kg[PLANT_WHEELS]; /* goes with the floor contacts */
    double viscous_kg[PLANT_WHEELS];
    double wheel_mps[PLANT_WHEELS];

    for (int i = 0; i < PLANT_WHEELS; i++) {
        const struct plant_wheel_params *wheel = &plant->params.wheel[i];
        struct side *side = &hidden->side[i];
        const double radius_m = wheel->radius_m;
        const double flywheel =
            speed_of(&rims, i) > 0.0 ? params->gear.forward_flywheel_kgm2[i] / (radius_m * radius_m) : 0.0;
        const double motor_kg = rotor_kg(wheel);
        double wheel_kg = rim_kg(wheel) + flywheel;
        double wheel_n = motion->motor_n[i];
        double viscous = plant_viscous_kg(wheel) * span_s / step_s;

        if (elastic) {
            const double twist = side->motor_rad - plant->angle_rad[i];
            const double rate = (side->motor_mps - speed_of(&rims, i)) / radius_m;
            const double motor_kgm2 = motor_kg * radius_m * radius_m;
            const double passed_n =
                gear_torque_nm(&params->gear, i, motor_kgm2, twist, rate, &side->slipped_rad) / radius_m;
            side->motor_mps =
                (motor_kg * side->motor_mps + span_s * (wheel_n - passed_n)) / (motor_kg + viscous);
            side->motor_rad += span_s * side->motor_mps / radius_m;
            wheel_n = passed_n;
            viscous = 0.0;
        } else {
            wheel_kg += motor_kg;
        }
        wheel_n += motion->floor_n[i];
        if (params->bristle.coulomb_nm[i] > 0.0 || params->bristle.breakaway_nm[i] > 0.0) {
            const double speed = speed_of(&rims, i) / radius_m;
            wheel_n -= bristle_torque_nm(&params->bristle, i, speed, span_s, &side->bend_rad) / radius_m;
        }
        if (slips) {
            const double load_n = 0.5 * hidden->body_kg * gravity_mps2 * params->tyre.load_on_wheels;
            const double grip_n =
                tyre_force_n(&params->tyre, load_n, speed_of(&rims, i), speed_of(&floor, i));
            const double momentum = wheel_kg * speed_of(&rims, i) + span_s * (wheel_n - grip_n);
            wheel_mps[i] = held_back(momentum, dry[i]) / (wheel_kg + viscous);
            pull_n[i] = grip_n;
            turning_kg[i] = viscous_kg[i] = 0.0;
        } else {
            pull_n[i] = wheel_n;
            turning_kg[i] = wheel_kg;
            viscous_kg[i] = viscous;
        }
        pull_n[i] += 0.5 * motion->body_n;
    }

    struct friction_mass mass = {.left = hidden->body.left + turning_kg[0],
                                 .right = hidden->body.right + turning_kg[1],
                                 .cross = hidden->body.cross};
    const double left = mass.left * floor.left + mass.cross * floor.right + span_s * pull_n[0];
    const double right = mass.cross * floor.left + mass.right * floor.right + span_s * pull_n[1];
    const struct friction_limits limits = {
        .left = slips ? 0.0 : dry[0], .right = slips ? 0.0 : dry[1], .twist = motion->limits.twist};
    mass.left += viscous_kg[0];
    mass.right += viscous_kg[1];
    hidden->floor = friction_solve(&mass, left, right, &limits);
    plant->rims = slips ? (struct friction_speeds){wheel_mps[0], wheel_mps[1]} : hidden->floor;

    const double rolled[PLANT_WHEELS] = {0.5 * span_s * (rims.left + plant->rims.left),
                                         0.5 * span_s * (rims.right + plant->rims.right)};
    for (int i = 0; i < PLANT_WHEELS; i++) {
        plant->angle_rad[i] += rolled[i] / plant->params.wheel[i].radius_m;
    }
    double left_m = slips ? 0.5 * span_s * (floor.left + hidden->floor.left) : rolled[0];
    double right_m = slips ? 0.5 * span_s * (floor.right + hidden->floor.right) : rolled[1];
    const double distance_m = 0.5 * (left_m + right_m);
    const double turn_m =
        0.5 * distance_m * params->creep.drift_rad_per_m * plant->params.chassis.wheelbase_m;
    const double further_m = distance_m * params->creep.distance_scale;
    left_m += further_m - turn_m;
    right_m += further_m + turn_m;
    chassis_roll(&plant->chassis, left_m, right_m);
}

static uint64_t counts_lost(const struct plant *plant, int i, int64_t before, uint64_t passed, double share)
{
    const enum noise_stream stream = i == 0 ? NOISE_COUNTS_LEFT : NOISE_COUNTS_RIGHT;
    uint64_t lost = 0;
    for (uint64_t k = 0; k < passed && share > 0.0; k++) {
        /* The step belongs to the index: an edge that is lost once is not lost for ever. */
        const uint64_t index = plant->steps * UINT64_C(1024) + ((uint64_t)before + k) % 1024;
        lost += noise_uniform(plant->seed, stream, index) < share;
    }
    return lost;
}

static void read_disc(struct plant *plant, int i)
{
    struct side *side = &plant->hidden->side[i];
    const struct plant_hidden_encoder *params = &plant->hidden->params.encoder;
    const struct plant_encoder_params *encoder = &plant->params.wheel[i].encoder;
    const double shaft = gear_is_elastic(&plant->hidden->params.gear) ? side->motor_rad : plant->angle_rad[i];
    const double size = params->eccentricity_rad[i];
    const double phase = params->eccentricity_phase_rad[i];

    side->disc_before_rad = side->disc_rad;
    side->disc_rad = size == 0.0 ? shaft : shaft + size * (sin(shaft + phase) - sin(phase));
    const double moved = side->disc_rad - side->disc_before_rad;
    double share = 0.0;
    if (params->dropout[i] > 0.0) {
        share = fmin(1.0, params->dropout[i] * fabs(moved) / (step_s * params->dropout_at_radps));
        side->lost_rad += share * moved;
    }
    const int64_t before = side->edges;
    side->edges = sensor_count(encoder, plant->seed, i, side->disc_rad);
    const int64_t passed = side->edges - before;
    const uint64_t number = (uint64_t)(passed < 0 ? -passed : passed);
    const int64_t lost = (int64_t)counts_lost(plant, i, before, number, share);
    side->kept = passed < 0 ? passed + lost : passed - lost;
    side->position += side->kept;
}

void hidden_step(struct plant *plant)
{
    struct hidden *hidden = plant->hidden;
    const struct plant_hidden *params = &hidden->params;
    const struct plant_wheel_params *wheel = plant->params.wheel;
    const bool elastic = gear_is_elastic(&params->gear);
    const int pieces = elastic || params->tyre.grip > 0.0 ? FINE : 1;
    struct motion motion = {.span_s = step_s / pieces};
    double drawn_as = 0.0;

    if (params->payload.mass_kg > 0.0 && !hidden->loaded) {
        weigh(plant);
    }
    const double open_v = battery_terminal_v(&plant->battery) - hidden->polarisation_v;
    const double supply_v = open_v > 0.0 ? open_v : 0.0;
    for (int i = 0; i < PLANT_WHEELS; i++) {
        plant->angle_before_rad[i] = plant->angle_rad[i];
        drive_bridge(plant, i);
        const double rim = speed_of(&plant->rims, i);
        const double motor_mps = elastic ? hidden->side[i].motor_mps : rim;
        motion.motor_n[i] = motor_force_n(plant, i, motor_mps, supply_v, &drawn_as);
        if (params->disturbance.torque_nm[i] > 0.0) {
            const double resting = params->disturbance.resting_mps;
            const double share = resting > 0.0 ? fabs(rim) / (fabs(rim) + resting) : 1.0;
            const double torque_nm =
                disturbance_nm(&hidden->disturbance, &params->disturbance, i, plant->seed, plant->steps);
            motion.floor_n[i] = share * torque_nm / wheel[i].radius_m;
        }
    }
    battery_step(&plant->battery, drawn_as);
    if (params->supply.polarisation_ohm > 0.0) {
        const double target_v = params->supply.polarisation_ohm * plant->battery.current_a;
        hidden->polarisation_v +=
            (target_v - hidden->polarisation_v) * step_s / params->supply.polarisation_s;
    }

    const double electrical_n[PLANT_WHEELS] = {motion.motor_n[0], motion.motor_n[1]};
    for (int k = 0; k < pieces; k++) {
        const struct load_view view = {
            .wheel = wheel,
            .chassis = &plant->chassis,
            .mass_kg = hidden->body_kg,
            .rim_mps = {plant->rims.left, plant->rims.right},
            .motor_rad = {elastic ? hidden->side[0].motor_rad : plant->angle_rad[0],
                          elastic ? hidden->side[1].motor_rad : plant->angle_rad[1]},
        };
        double met_n[PLANT_WHEELS];
        load_rims_n(&params->load, &view, met_n);
        motion.motor_n[0] = electrical_n[0] + met_n[0];
        motion.motor_n[1] = electrical_n[1] + met_n[1];
        motion.body_n = load_body_n(&hidden->load, &params->load, &view, motion.span_s);
        const struct friction_speeds *floor = params->tyre.grip > 0.0 ? &hidden->floor : &plant->rims;
        const double share = motion.span_s / step_s;
        motion.limits = (struct friction_limits){
            .left = share * plant_dry_impulse(&wheel[0], plant->rims.left, plant->hold_nm[0]),
            .right = share * plant_dry_impulse(&wheel[1], plant->rims.right, plant->hold_nm[1]),
            .twist = motion.span_s * chassis_scrub_n(&plant->chassis, floor),
        };
        move_pieces(plant, &motion);
    }
    read_disc(plant, 0);
    read_disc(plant, 1);
    plant->steps++;
}

struct hidden_disc hidden_disc(const struct plant *plant, int wheel)
{
    const struct side *side = &plant->hidden->side[wheel];
    const struct plant_hidden *params = &plant->hidden->params;
    /* Joints can accelerate a light piece by more than any bound that is worth having. */
    const bool rigid = !gear_is_elastic(&params->gear) && params->tyre.grip == 0.0;
    const double fastest_radps = 60.0;
    const double eccentric = params->encoder.eccentricity_rad[wheel] * fastest_radps * fastest_radps;
    return (struct hidden_disc){
        .before_rad = side->disc_before_rad,
        .after_rad = side->disc_rad,
        .acceleration_radps2 = rigid ? 3.0 * plant->acceleration_radps2[wheel] + eccentric : INFINITY,
    };
}

int64_t hidden_count(const struct plant *plant, int wheel, double share)
{
    const struct side *side = &plant->hidden->side[wheel];
    const struct plant_encoder_params *encoder = &plant->params.wheel[wheel].encoder;
    const int64_t start = side->position - side->kept;
    const double angle = side->disc_before_rad + share * (side->disc_rad - side->disc_before_rad);
    const int64_t passed = sensor_count(encoder, plant->seed, wheel, angle) -
                           sensor_count(encoder, plant->seed, wheel, side->disc_before_rad);
    const bool forward = side->kept >= 0;
    if (forward ? passed > side->kept : passed < side->kept) {
        return start + side->kept;
    }
    return start + passed;
}

double hidden_measured_rad(const struct plant *plant, int wheel)
{
    const struct side *side = &plant->hidden->side[wheel];
    return side->disc_rad - side->lost_rad;
}
