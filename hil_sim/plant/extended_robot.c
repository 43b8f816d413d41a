/* The robot with unmodelled effects: its state beyond that of the plain robot, and its step.
 *
 * Up to three bodies in a row on each side: motor, wheel, floor contact. Bodies that no effect separates are
 * one rigid body. Bodies that are joined by a spring or a tyre move in quarter steps, speeds first
 * (symplectic Euler), since such joints are stiff. All speeds are at the rim, m/s; all masses are referred to
 * the rim, kg.
 */
#include "extended_robot.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "bristle.h"
#include "disturbance.h"
#include "driver.h"
#include "gear.h"
#include "intermittent.h"
#include "load.h"
#include "noise.h"
#include "plain_robot.h"
#include "sensor.h"
#include "tyre.h"
#include "winding.h"

enum { STIFF_SUBSTEPS = 4 };

static const double step_s = PLANT_STEP_US * 1e-6;
static const double gravity_mps2 = 9.81;

/* One side of the robot. */
struct side {
    struct driver driver;
    double made; /* effort that the bridge applies; NAN: it floats */
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

struct extended_robot {
    struct plant_unmodelled_effects params;
    struct side side[PLANT_WHEELS];
    double polarisation_v;
    struct load load;
    struct disturbance disturbance;
    struct intermittent intermittent;
    struct friction_speeds floor; /* speed of the floor below the contacts */
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
    struct extended_robot *robot = plant->extended;
    const struct plant_chassis_params *chassis = &plant->params.chassis;
    const struct plant_payload_effects *payload = &robot->params.payload;
    robot->loaded = payload->mass_kg > 0.0 && (double)plant->steps * step_s >= payload->at_s;
    robot->body_kg = chassis->mass_kg + (robot->loaded ? payload->mass_kg : 0.0);
    const double inertia = chassis->yaw_inertia_kgm2 + (robot->loaded ? payload->yaw_inertia_kgm2 : 0.0);
    const double forward = robot->body_kg / 4.0;
    const double yaw = inertia / (chassis->wheelbase_m * chassis->wheelbase_m);
    robot->body =
        (struct friction_mass){.left = forward + yaw, .right = forward + yaw, .cross = forward - yaw};
}

bool extended_set_effects(struct plant *plant, const struct plant_unmodelled_effects *params)
{
    static const struct plant_unmodelled_effects nothing;
    if (plant_unmodelled_effects_problem(params) != NULL) {
        return false;
    }
    if (plant->extended == NULL) {
        if (memcmp(params, &nothing, sizeof nothing) == 0) {
            return true;
        }
        plant->extended = calloc(1, sizeof *plant->extended);
        if (plant->extended == NULL) {
            return false;
        }
        for (int i = 0; i < PLANT_WHEELS; i++) {
            struct side *side = &plant->extended->side[i];
            driver_init(&side->driver);
            driver_ask(&side->driver, plant->asked_duty[i][0], plant->asked_duty[i][1]);
            side->made = 2.0; /* none, so that the first step sets the bridge */
            side->motor_rad = side->disc_before_rad = side->disc_rad = plant->angle_rad[i];
            side->edges = side->position =
                sensor_count(&plant->params.wheel[i].encoder, plant->seed, i, plant->angle_rad[i]);
        }
        plant->extended->floor = plant->rims;
        extended_hold(plant);
    }
    plant->extended->params = *params;
    weigh(plant);
    return true;
}

void extended_destroy(struct extended_robot *robot)
{
    free(robot);
}

void extended_set_bridge(struct plant *plant, int wheel, double in1_duty, double in2_duty)
{
    driver_ask(&plant->extended->side[wheel].driver, in1_duty, in2_duty);
}

void extended_hold(struct plant *plant)
{
    intermittent_hold(&plant->extended->intermittent, plant->hold_nm, plant->steps);
}

void extended_turn_wheel(struct plant *plant, int wheel, double angle_rad)
{
    struct side *side = &plant->extended->side[wheel];
    side->motor_rad += angle_rad;
    side->disc_before_rad += angle_rad;
    side->disc_rad += angle_rad;
}

static void drive_bridge(struct plant *plant, int i)
{
    struct side *side = &plant->extended->side[i];
    const double rim = i == 0 ? plant->rims.left : plant->rims.right;
    const double effort =
        driver_step(&side->driver, &plant->extended->params.driver, i, plant->seed, plant->steps, rim);
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
    const struct plant_unmodelled_effects *params = &plant->extended->params;
    struct winding *winding = &plant->extended->side[i].winding;
    struct motor *motor = &plant->motor[i];
    const double emf = plant->emf_per_speed[i] * (1.0 - params->thermal.emf_per_k * winding->case_k);
    struct motor_flow flow = motor_step(motor, emf * motor_mps, supply_v);
    const double limit_a = params->driver.current_limit_a;
    if (limit_a > 0.0 && fabs(flow.motor_charge_as) > limit_a * step_s) {
        /* The driver chops: the motor keeps the limit current and draws less from the supply. */
        const double share = limit_a * step_s / fabs(flow.motor_charge_as);
        flow.motor_charge_as *= share;
        flow.supply_charge_as *= share;
        motor->current_a = copysign(fmin(fabs(motor->current_a), limit_a), motor->current_a);
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

/* Inputs of the mechanics in one step or substep. */
struct motion {
    double span_s;
    double motor_n[PLANT_WHEELS]; /* at the motor: electrical, ripple, disturbance */
    double floor_n[PLANT_WHEELS]; /* at the wheel: what the floor does to it */
    double body_n;                /* on the chassis */
    double side_n[PLANT_WHEELS];  /* on one side of the chassis */
    struct friction_limits limits;
};

static double speed_of(const struct friction_speeds *speeds, int i)
{
    return i == 0 ? speeds->left : speeds->right;
}

/* Momentum left by dry friction that acts on one body alone. */
static double soft_threshold(double momentum, double impulse)
{
    return momentum > impulse ? momentum - impulse : momentum < -impulse ? momentum + impulse : 0.0;
}

/* What one side passes on to its floor contact. */
struct contact {
    double pull_n;     /* force on the contact, forward */
    double turning_kg; /* mass that moves with the contact */
    double viscous_kg; /* one step's viscous friction on that mass */
    double wheel_mps;  /* the wheel's own speed where the tyre slips */
};

/* Moves the motor of an elastic gear by its own equation; returns the force that the gear passes on, N. */
static double move_motor(struct plant *plant, const struct motion *motion, int i, double rim_mps,
                         double viscous_kg)
{
    const double radius_m = plant->params.wheel[i].radius_m;
    const double motor_kg = rotor_kg(&plant->params.wheel[i]);
    struct side *side = &plant->extended->side[i];
    const double twist = side->motor_rad - plant->angle_rad[i];
    const double rate = (side->motor_mps - rim_mps) / radius_m;
    const double motor_kgm2 = motor_kg * radius_m * radius_m;
    const double passed_n =
        gear_torque_nm(&plant->extended->params.gear, i, motor_kgm2, twist, rate, &side->slipped_rad) /
        radius_m;
    side->motor_mps = (motor_kg * side->motor_mps + motion->span_s * (motion->motor_n[i] - passed_n)) /
                      (motor_kg + viscous_kg);
    side->motor_rad += motion->span_s * side->motor_mps / radius_m;
    return passed_n;
}

/* Forces and masses of one side, from the motor to the floor contact, which passes the floor at `floor_mps`.
 */
static struct contact move_side(struct plant *plant, const struct motion *motion, int i, double floor_mps,
                                double dry_impulse)
{
    struct extended_robot *robot = plant->extended;
    const struct plant_unmodelled_effects *params = &robot->params;
    const struct plant_wheel_params *wheel = &plant->params.wheel[i];
    const double radius_m = wheel->radius_m;
    const double span_s = motion->span_s;
    const double rim_mps = speed_of(&plant->rims, i);
    const double flywheel =
        rim_mps > 0.0 ? params->gear.forward_flywheel_kgm2[i] / (radius_m * radius_m) : 0.0;
    double wheel_kg = rim_kg(wheel) + flywheel;
    double wheel_n = motion->motor_n[i];
    double viscous = rim_viscous_kg(wheel) * span_s / step_s;

    if (gear_is_elastic(&params->gear)) {
        wheel_n = move_motor(plant, motion, i, rim_mps, viscous);
        viscous = 0.0;
    } else {
        wheel_kg += rotor_kg(wheel);
    }
    wheel_n += motion->floor_n[i];
    if (params->bristle.coulomb_nm[i] > 0.0 || params->bristle.breakaway_nm[i] > 0.0) {
        wheel_n -=
            bristle_torque_nm(&params->bristle, i, rim_mps / radius_m, span_s, &robot->side[i].bend_rad) /
            radius_m;
    }
    struct contact contact = {.pull_n = wheel_n, .turning_kg = wheel_kg, .viscous_kg = viscous};
    if (params->tyre.grip > 0.0) {
        const double load_n = 0.5 * robot->body_kg * gravity_mps2 * params->tyre.load_on_wheels;
        const double grip_n = tyre_force_n(&params->tyre, load_n, rim_mps, floor_mps);
        const double momentum = wheel_kg * rim_mps + span_s * (wheel_n - grip_n);
        contact = (struct contact){
            .pull_n = grip_n,
            .wheel_mps = soft_threshold(momentum, dry_impulse) / (wheel_kg + viscous),
        };
    }
    contact.pull_n += 0.5 * motion->body_n + motion->side_n[i];
    return contact;
}

/* Speeds of the floor contacts after the step: body and wheels together, dry friction and scrub implicitly.
 */
static struct friction_speeds move_contacts(const struct extended_robot *robot, const struct motion *motion,
                                            const struct friction_speeds *floor,
                                            const struct contact contacts[PLANT_WHEELS])
{
    const bool slips = robot->params.tyre.grip > 0.0; /* dry friction already acted on the wheels */
    struct friction_mass mass = {.left = robot->body.left + contacts[0].turning_kg,
                                 .right = robot->body.right + contacts[1].turning_kg,
                                 .cross = robot->body.cross};
    const double left =
        mass.left * floor->left + mass.cross * floor->right + motion->span_s * contacts[0].pull_n;
    const double right =
        mass.cross * floor->left + mass.right * floor->right + motion->span_s * contacts[1].pull_n;
    const struct friction_limits limits = {.left = slips ? 0.0 : motion->limits.left,
                                           .right = slips ? 0.0 : motion->limits.right,
                                           .twist = motion->limits.twist};
    mass.left += contacts[0].viscous_kg;
    mass.right += contacts[1].viscous_kg;
    return friction_solve(&mass, left, right, &limits);
}

/* Moves the pose by what the contacts passed of the floor, and by the creep that no wheel measures. */
static void move_pose(struct plant *plant, double left_m, double right_m)
{
    const struct plant_creep_effects *creep = &plant->extended->params.creep;
    const double distance_m = 0.5 * (left_m + right_m);
    const double turn_m = 0.5 * distance_m * creep->drift_rad_per_m * plant->params.chassis.wheelbase_m;
    const double further_m = distance_m * creep->distance_scale;
    left_m += further_m - turn_m;
    right_m += further_m + turn_m;
    chassis_roll(&plant->chassis, left_m, right_m);
}

static void move_bodies(struct plant *plant, const struct motion *motion)
{
    struct extended_robot *robot = plant->extended;
    const bool slips = robot->params.tyre.grip > 0.0;
    const double span_s = motion->span_s;
    const struct friction_speeds rims = plant->rims;
    const struct friction_speeds floor = slips ? robot->floor : rims;
    const struct contact contacts[PLANT_WHEELS] = {
        move_side(plant, motion, 0, floor.left, motion->limits.left),
        move_side(plant, motion, 1, floor.right, motion->limits.right),
    };
    robot->floor = move_contacts(robot, motion, &floor, contacts);
    plant->rims =
        slips ? (struct friction_speeds){contacts[0].wheel_mps, contacts[1].wheel_mps} : robot->floor;

    const double rolled[PLANT_WHEELS] = {0.5 * span_s * (rims.left + plant->rims.left),
                                         0.5 * span_s * (rims.right + plant->rims.right)};
    for (int i = 0; i < PLANT_WHEELS; i++) {
        plant->angle_rad[i] += rolled[i] / plant->params.wheel[i].radius_m;
    }
    move_pose(plant, slips ? 0.5 * span_s * (floor.left + robot->floor.left) : rolled[0],
              slips ? 0.5 * span_s * (floor.right + robot->floor.right) : rolled[1]);
}

static uint64_t counts_lost(const struct plant *plant, int i, int64_t before, uint64_t passed, double share)
{
    const enum noise_stream stream = i == 0 ? NOISE_COUNTS_LEFT : NOISE_COUNTS_RIGHT;
    uint64_t lost = 0;
    for (uint64_t k = 0; k < passed && share > 0.0; k++) {
        /* The step belongs to the index: an edge lost once is not lost at every pass. */
        const uint64_t index = plant->steps * UINT64_C(1024) + ((uint64_t)before + k) % 1024;
        lost += noise_uniform(plant->seed, stream, index) < share;
    }
    return lost;
}

static void read_disc(struct plant *plant, int i)
{
    struct side *side = &plant->extended->side[i];
    const struct plant_encoder_effects *params = &plant->extended->params.encoder;
    const struct plant_encoder_params *encoder = &plant->params.wheel[i].encoder;
    const double shaft =
        gear_is_elastic(&plant->extended->params.gear) ? side->motor_rad : plant->angle_rad[i];
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

/* Bridges, motors and battery of one step; sets the forces at motors and floor that hold throughout it. */
static void step_electrical(struct plant *plant, struct motion *motion)
{
    struct extended_robot *robot = plant->extended;
    const struct plant_unmodelled_effects *params = &robot->params;
    const double open_v = battery_terminal_v(&plant->battery) - robot->polarisation_v;
    const double supply_v = open_v > 0.0 ? open_v : 0.0;
    double drawn_as = 0.0;
    for (int i = 0; i < PLANT_WHEELS; i++) {
        plant->angle_before_rad[i] = plant->angle_rad[i];
        drive_bridge(plant, i);
        const double rim = speed_of(&plant->rims, i);
        const double motor_mps = gear_is_elastic(&params->gear) ? robot->side[i].motor_mps : rim;
        motion->motor_n[i] = motor_force_n(plant, i, motor_mps, supply_v, &drawn_as);
        if (params->disturbance.torque_nm[i] > 0.0) {
            const double resting = params->disturbance.resting_mps;
            const double share = resting > 0.0 ? fabs(rim) / (fabs(rim) + resting) : 1.0;
            const double torque_nm =
                disturbance_nm(&robot->disturbance, &params->disturbance, i, plant->seed, plant->steps);
            motion->floor_n[i] = share * torque_nm / plant->params.wheel[i].radius_m;
        }
    }
    battery_step(&plant->battery, drawn_as);
    if (params->supply.polarisation_ohm > 0.0) {
        const double target_v = params->supply.polarisation_ohm * plant->battery.current_a;
        robot->polarisation_v += (target_v - robot->polarisation_v) * step_s / params->supply.polarisation_s;
    }
}

/* Forces on the sides of the body, and dry friction at the axles, that act for some time only. */
static void set_intermittent(const struct plant *plant, struct motion *motion, double dry_nm[PLANT_WHEELS])
{
    const struct extended_robot *robot = plant->extended;
    const struct plant_intermittent_effects *params = &robot->params.intermittent;
    const struct intermittent_view view = {&plant->chassis, plant->seed, plant->steps};
    for (int i = 0; i < PLANT_WHEELS; i++) {
        dry_nm[i] = intermittent_dry_nm(&robot->intermittent, params, &view, i);
        motion->side_n[i] = intermittent_side_n(&robot->intermittent, params, &view, i);
    }
}

/* Loads and dry friction at the present speeds and angles; `electrical_n` is the motors' own force. */
static void set_loads(struct plant *plant, struct motion *motion, const double electrical_n[PLANT_WHEELS])
{
    struct extended_robot *robot = plant->extended;
    const struct plant_unmodelled_effects *params = &robot->params;
    const struct plant_wheel_params *wheel = plant->params.wheel;
    const bool elastic = gear_is_elastic(&params->gear);
    const struct load_view view = {
        .wheel = wheel,
        .chassis = &plant->chassis,
        .mass_kg = robot->body_kg,
        .rim_mps = {plant->rims.left, plant->rims.right},
        .motor_rad = {elastic ? robot->side[0].motor_rad : plant->angle_rad[0],
                      elastic ? robot->side[1].motor_rad : plant->angle_rad[1]},
    };
    double load_n[PLANT_WHEELS];
    load_rims_n(&params->load, &view, load_n);
    motion->motor_n[0] = electrical_n[0] + load_n[0];
    motion->motor_n[1] = electrical_n[1] + load_n[1];
    motion->body_n = load_body_n(&robot->load, &params->load, &view, motion->span_s);
    const struct friction_speeds *floor = params->tyre.grip > 0.0 ? &robot->floor : &plant->rims;
    const double share = motion->span_s / step_s;
    double dry_nm[PLANT_WHEELS];
    set_intermittent(plant, motion, dry_nm);
    motion->limits = (struct friction_limits){
        .left = share * rim_dry_impulse(&wheel[0], plant->rims.left, plant->hold_nm[0] + dry_nm[0]),
        .right = share * rim_dry_impulse(&wheel[1], plant->rims.right, plant->hold_nm[1] + dry_nm[1]),
        .twist = motion->span_s * chassis_scrub_n(&plant->chassis, floor),
    };
}

void extended_step(struct plant *plant)
{
    struct extended_robot *robot = plant->extended;
    const struct plant_unmodelled_effects *params = &robot->params;
    const int substeps = gear_is_elastic(&params->gear) || params->tyre.grip > 0.0 ? STIFF_SUBSTEPS : 1;
    struct motion motion = {.span_s = step_s / substeps};

    if (params->payload.mass_kg > 0.0 && !robot->loaded) {
        weigh(plant);
    }
    step_electrical(plant, &motion);
    const double electrical_n[PLANT_WHEELS] = {motion.motor_n[0], motion.motor_n[1]};
    for (int k = 0; k < substeps; k++) {
        set_loads(plant, &motion, electrical_n);
        move_bodies(plant, &motion);
    }
    read_disc(plant, 0);
    read_disc(plant, 1);
    plant->steps++;
}

struct extended_disc extended_disc(const struct plant *plant, int wheel)
{
    const struct side *side = &plant->extended->side[wheel];
    const struct plant_unmodelled_effects *params = &plant->extended->params;
    /* Elastic joints can accelerate a light body by more than any useful bound. */
    const bool rigid = !gear_is_elastic(&params->gear) && params->tyre.grip == 0.0;
    const double fastest_radps = 60.0;
    const double eccentric = params->encoder.eccentricity_rad[wheel] * fastest_radps * fastest_radps;
    return (struct extended_disc){
        .before_rad = side->disc_before_rad,
        .after_rad = side->disc_rad,
        .acceleration_radps2 = rigid ? 3.0 * plant->acceleration_radps2[wheel] + eccentric : INFINITY,
    };
}

int64_t extended_count(const struct plant *plant, int wheel, double share)
{
    const struct side *side = &plant->extended->side[wheel];
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

double extended_measured_rad(const struct plant *plant, int wheel)
{
    const struct side *side = &plant->extended->side[wheel];
    return side->disc_rad - side->lost_rad;
}
