/* The parameters of a robot: motors, friction, encoders, chassis, battery and bridges, in SI units. */
#ifndef PLANT_PARAMS_H
#define PLANT_PARAMS_H

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

/* The robot of Bakirci 2023 (MSRP), calibrated by calibrate.py. */
void plant_params_msrp(struct plant_params *out);

/* NULL when the parameters are valid; else one line that names the first invalid one and why, which stays
 * valid until this thread calls again. */
const char *plant_params_problem(const struct plant_params *params);

#ifdef __cplusplus
}
#endif

#endif
