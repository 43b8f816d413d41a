/* The robot that stands in for reality: its terminals, its numbers and its truth. */
#ifndef PLANT_H
#define PLANT_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* One integration step, and one PWM period of a 20 kHz bridge. The tests build a second, finer plant
   to show that the step is small enough. */
#ifndef PLANT_STEP_US
#define PLANT_STEP_US 50
#endif

enum { PLANT_WHEELS = 2 }; /* 0 left, 1 right */

/* A brushed permanent-magnet motor behind a gearbox; quantities at the motor's own shaft. */
struct plant_motor_params {
    double resistance_ohm;     /* winding, brushes, leads and the bridge's two closed switches */
    double inductance_h;       /* winding */
    double emf_v_per_radps;    /* back-EMF constant; equals the torque constant in N m/A */
    double rotor_inertia_kgm2; /* rotor and first pinion */
    double gear_ratio;         /* motor turns per wheel turn */
};

/* Dry and viscous friction of motor, gearbox and rolling tyre, as torque at the wheel. */
struct plant_friction_params {
    double coulomb_nm;          /* dry friction while turning fast */
    double breakaway_nm;        /* dry friction at standstill; at least coulomb_nm */
    double stribeck_radps;      /* wheel speed at which half of the difference is gone */
    double viscous_nms_per_rad; /* grows with speed */
};

struct plant_encoder_params {
    double counts_per_rev;   /* quadrature counts (x4) per wheel turn, a whole number */
    double edge_error_count; /* largest misplacement of an edge on the disc, counts, 0..0.45 */
};

struct plant_wheel_params {
    double radius_m;
    double inertia_kgm2; /* wheel and output shaft about the axle */
    struct plant_motor_params motor;
    struct plant_friction_params friction;
    struct plant_encoder_params encoder;
};

struct plant_chassis_params {
    double mass_kg;               /* everything, wheels included */
    double yaw_inertia_kgm2;      /* everything, about the vertical through the middle of the axle */
    double wheelbase_m;           /* distance between the wheels' contact points */
    double scrub_nm;              /* yaw moment of tyres and caster that are twisted on the spot */
    double scrub_curvature_per_m; /* path curvature above which the rolling contacts slide as on the spot */
};

struct plant_battery_params {
    double full_v;  /* open circuit, state of charge 1 */
    double empty_v; /* open circuit, state of charge 0 */
    double capacity_ah;
    double initial_charge; /* state of charge at creation, 0..1 */
    double resistance_ohm; /* cells, fuse and leads up to the bridges */
    double electronics_a;  /* current of everything but the motors */
    double sense_noise_v;  /* largest error of the sensed voltage, seeded, uniform */
};

struct plant_bridge_params {
    double diode_drop_v; /* each of the two free-wheeling diodes that conduct when both inputs are low */
};

struct plant_params {
    struct plant_wheel_params wheel[PLANT_WHEELS];
    struct plant_chassis_params chassis;
    struct plant_battery_params battery;
    struct plant_bridge_params bridge;
};

/* The truth, which no sensor of the robot sees. */
struct plant_state {
    uint64_t steps; /* taken since creation */
    double time_s;
    double wheel_angle_rad[PLANT_WHEELS];
    double wheel_speed_radps[PLANT_WHEELS];
    double motor_current_a[PLANT_WHEELS]; /* at the end of the last step */
    double x_m, y_m, theta_rad;           /* middle of the axle; theta not wrapped, left turn positive */
    double speed_mps, yaw_rate_radps;
    double battery_open_v;    /* open circuit at the present charge */
    double battery_v;         /* at the terminals */
    double battery_current_a; /* mean over the last step, discharge positive */
    double battery_charge;    /* 0..1 */
    double kinetic_energy_j;  /* of everything that moves */
    double magnetic_energy_j; /* of the windings */
};

struct plant;

/* The robot of Bakirci 2023 (MSRP), calibrated by calibrate.py. */
void plant_params_msrp(struct plant_params *out);

/* NULL when the parameters make a robot; else one line that names the first one at fault and why, which
   holds until this thread asks again. */
const char *plant_params_problem(const struct plant_params *params);

/* NULL when plant_params_problem finds one, or memory is out. */
struct plant *plant_create(const struct plant_params *params, uint64_t seed);
void plant_destroy(struct plant *plant);

/* Fraction of the PWM period for which each input of the wheel's bridge is high, from the period's
   beginning: both high brakes, both low leaves the motor to the diodes. Clamped to 0..1; holds from the next
   step. */
void plant_set_bridge(struct plant *plant, int wheel, double in1_duty, double in2_duty);

/* Steps of PLANT_STEP_US each; how a span is split into calls changes nothing. */
void plant_advance(struct plant *plant, uint64_t steps);

/* Quadrature counts (x4) since creation: the sensor, not the truth. */
int64_t plant_encoder_position(const struct plant *plant, int wheel);

/* Holds a wheel by dry friction of this torque at its axle, as a hand or a kerb does; 0 lets go. */
void plant_hold_wheel(struct plant *plant, int wheel, double torque_nm);

/* Turns a lifted wheel by hand; the robot stays where it is. */
void plant_turn_wheel(struct plant *plant, int wheel, double angle_rad);

/* Lifts the robot and puts it down elsewhere; its wheels and all else stay as they are. */
void plant_place(struct plant *plant, double x_m, double y_m, double theta_rad);

/* The same sensor as the wheel passed this share (0..1) of the last step, taken to be of even speed. */
int64_t plant_encoder_within(const struct plant *plant, int wheel, double share);

/* How long from there, in steps, that count surely lasts: up to the next edge within the last step, or else
   to the end of a step before which no edge can come, however the bridges are driven. */
double plant_encoder_quiet_steps(const struct plant *plant, int wheel, double share);

/* Terminal voltage with the sense line's noise. */
double plant_battery_v(const struct plant *plant);

void plant_state(const struct plant *plant, struct plant_state *out);

#ifdef __cplusplus
}
#endif

#endif
