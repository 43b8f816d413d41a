/* What a robot may have beyond plant_params: effects that a simpler model of it leaves out.
 *
 * All zero is the robot of plant_params, bit for bit. Each part says which number switches it on. Torques and
 * angles are at the wheel; pairs are left, right. */
#ifndef PLANT_HIDDEN_H
#define PLANT_HIDDEN_H

#include <stdbool.h>

#include "plant.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Between the effort that the bridge inputs ask for and the voltage that the motor gets. */
struct plant_hidden_driver {
    double delay_s;                    /* a pure delay, up to 0.4 s */
    double lag_s;                      /* a filter of first order */
    double deadband;                   /* effort that gives nothing, and is missing above */
    double current_limit_a;            /* 0: none */
    double speed_limit_mps;            /* of a governor at the rim; 0: none */
    double reverse_gain[PLANT_WHEELS]; /* voltage in reverse over voltage forward; 0 means 1 */
    double floats_at_zero;             /* 1: no effort leaves the motor to the diodes instead of braking it */
    double square_law;                 /* 0..1: share of u |u| in what becomes of effort u */
    double dropout_every_s;            /* mean time between spells without any effort; 0: none */
    double dropout_s;                  /* their length */
    double dropout_wheels[PLANT_WHEELS]; /* 1: this wheel has them */
};

/* The battery's slow part: a resistance bridged by a capacitance, on top of plant_battery_params. */
struct plant_hidden_supply {
    double polarisation_ohm;
    double polarisation_s;
};

/* Copper that warms: a winding within a case, W/K and J/K. */
struct plant_hidden_thermal {
    double resistance_per_k; /* 0: cold for ever; copper has 0.0039 */
    double winding_j_per_k;
    double winding_w_per_k; /* to the case */
    double case_j_per_k;
    double case_w_per_k; /* to the air */
    double emf_per_k;    /* fraction of the back-EMF constant lost per kelvin of the case */
};

/* Dry friction of bristles that bend before they slide, N m; coulomb_nm 0 and breakaway_nm 0: none. */
struct plant_hidden_bristle {
    double coulomb_nm[PLANT_WHEELS];
    double breakaway_nm[PLANT_WHEELS];
    double stribeck_radps; /* wheel speed at which half of the difference is gone */
    double bend_rad;       /* deflection at which a bristle carries coulomb_nm */
};

/* What lies between the motor, where the encoder sits, and the wheel. */
struct plant_hidden_gear {
    double lash_rad[PLANT_WHEELS]; /* whole gap */
    double stiffness_nm_per_rad;   /* beyond the gap; 0: motor and wheel are one piece */
    double damping;                /* share of critical damping of the motor against the spring */
    double slip_nm[PLANT_WHEELS];  /* torque at which the hub turns on its shaft; 0: never */
    double forward_flywheel_kgm2[PLANT_WHEELS]; /* turned through a one-way clutch, forward only */
};

/* Tyres of finite grip; grip 0: they roll without slip. */
struct plant_hidden_tyre {
    double grip;           /* largest force over wheel load */
    double slip_at_peak;   /* relative slip at which it is reached */
    double load_on_wheels; /* share of the weight; the rest is on casters */
};

/* Forces that the robot meets on its way. */
struct plant_hidden_load {
    double quadratic_nms2[PLANT_WHEELS]; /* torque over wheel speed squared */
    double ripple_nm[PLANT_WHEELS];      /* torque periodic in the motor's angle */
    double ripple_per_turn;              /* periods per wheel turn */
    double ripple_phase_rad[PLANT_WHEELS];
    double slope_rad;
    double uphill_rad;     /* heading of the way up, from that at creation */
    double patch_n;        /* rolling resistance per wheel in the middle of a rough patch */
    double patch_pitch_m;  /* distance between patches, in x and y */
    double spring_n_per_m; /* a tether to where the robot was at creation */
    double swing_kg;       /* a load hung up along the robot */
    double swing_hz;
    double swing_damping;
};

struct plant_hidden_encoder {
    double eccentricity_rad[PLANT_WHEELS];
    double eccentricity_phase_rad[PLANT_WHEELS];
    double dropout[PLANT_WHEELS]; /* share of counts lost at dropout_at_radps, in proportion to speed */
    double dropout_at_radps;
};

/* Ways of the body over the floor that no wheel knows of. */
struct plant_hidden_creep {
    double drift_rad_per_m; /* turn per distance */
    double distance_scale;  /* distance beyond what the wheels rolled, as a share */
};

/* A load put onto the robot. */
struct plant_hidden_payload {
    double mass_kg; /* 0: none */
    double yaw_inertia_kgm2;
    double at_s; /* plant time */
};

/* Torque that nobody commanded, coloured and seeded. */
struct plant_hidden_disturbance {
    double torque_nm[PLANT_WHEELS]; /* its RMS; 0: none */
    double correlation_s;
    double
        resting_mps; /* rim speed at which half of it acts: the floor does not shake who stands; 0: always */
};

struct plant_hidden {
    struct plant_hidden_driver driver;
    struct plant_hidden_supply supply;
    struct plant_hidden_thermal thermal;
    struct plant_hidden_bristle bristle;
    struct plant_hidden_gear gear;
    struct plant_hidden_tyre tyre;
    struct plant_hidden_load load;
    struct plant_hidden_encoder encoder;
    struct plant_hidden_creep creep;
    struct plant_hidden_payload payload;
    struct plant_hidden_disturbance disturbance;
};

/* NULL when these numbers make effects; else one line that names the one at fault, which holds until this
   thread asks again. */
const char *plant_hidden_problem(const struct plant_hidden *hidden);

/* Gives a robot these effects from now on; what they have done so far (heat, charge, phase) goes on. False:
   bad numbers or no memory, and nothing has changed. */
bool plant_hide(struct plant *plant, const struct plant_hidden *hidden);

#ifdef __cplusplus
}
#endif

#endif
