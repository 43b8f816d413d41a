/* Effects beyond plant_params, which a simpler model of the robot leaves out.
 *
 * All zero is the robot of plant_params, bit for bit. Each part names the number that switches it on. Torques
 * and angles are at the wheel; pairs are left, right. */
#ifndef PLANT_UNMODELLED_EFFECTS_H
#define PLANT_UNMODELLED_EFFECTS_H

#include "plant_params.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Between the effort that the bridge inputs ask for and the voltage that the motor gets. */
struct plant_driver_effects {
    double delay_s;                    /* a pure delay, up to 0.4 s */
    double lag_s;                      /* a filter of first order */
    double deadband;                   /* efforts below it give nothing, larger ones are reduced by it */
    double current_limit_a;            /* 0: none */
    double speed_limit_mps;            /* of a governor at the rim; 0: none */
    double reverse_gain[PLANT_WHEELS]; /* voltage in reverse over voltage forward; 0 means 1 */
    double floats_at_zero;             /* 1: no effort leaves the motor to the diodes instead of braking it */
    double square_law;                 /* 0..1: share of u |u| in what becomes of effort u */
    double dropout_every_s;            /* mean time between effort dropouts; 0: none */
    double dropout_s;                  /* their length */
    double dropout_wheels[PLANT_WHEELS]; /* 1: this wheel has them */
};

/* The battery's slow part: a resistance bridged by a capacitance, on top of plant_battery_params. */
struct plant_supply_effects {
    double polarisation_ohm;
    double polarisation_s;
};

/* Copper that warms: a winding within a case, W/K and J/K. */
struct plant_thermal_effects {
    double resistance_per_k; /* 0: no heating; copper has 0.0039 */
    double winding_j_per_k;
    double winding_w_per_k; /* to the case */
    double case_j_per_k;
    double case_w_per_k; /* to the air */
    double emf_per_k;    /* fraction of the back-EMF constant lost per kelvin of the case */
};

/* Dry friction of bristles that bend before they slide, N m; coulomb_nm 0 and breakaway_nm 0: none. */
struct plant_bristle_effects {
    double coulomb_nm[PLANT_WHEELS];
    double breakaway_nm[PLANT_WHEELS];
    double stribeck_radps; /* wheel speed at which half of the difference is gone */
    double bend_rad;       /* deflection at which a bristle carries coulomb_nm */
};

/* The drive train between the motor, where the encoder sits, and the wheel. */
struct plant_gear_effects {
    double lash_rad[PLANT_WHEELS]; /* whole gap */
    double stiffness_nm_per_rad;   /* beyond the gap; 0: motor and wheel are one piece */
    double damping;                /* share of critical damping of the motor against the spring */
    double slip_nm[PLANT_WHEELS];  /* torque at which the hub turns on its shaft; 0: never */
    double forward_flywheel_kgm2[PLANT_WHEELS]; /* turned through a one-way clutch, forward only */
};

/* Tyres of finite grip; grip 0: they roll without slip. */
struct plant_tyre_effects {
    double grip;           /* largest force over wheel load */
    double slip_at_peak;   /* relative slip at which it is reached */
    double load_on_wheels; /* share of the weight; the rest is on casters */
};

/* External forces. */
struct plant_load_effects {
    double quadratic_nms2[PLANT_WHEELS]; /* torque over wheel speed squared */
    double ripple_nm[PLANT_WHEELS];      /* torque periodic in the motor's angle */
    double ripple_per_turn;              /* periods per wheel turn */
    double ripple_phase_rad[PLANT_WHEELS];
    double slope_rad;
    double uphill_rad;     /* heading of the way up, from that at creation */
    double patch_n;        /* rolling resistance per wheel in the middle of a rough patch */
    double patch_pitch_m;  /* distance between patches, in x and y */
    double spring_n_per_m; /* a tether to where the robot was at creation */
    double swing_kg;       /* a load suspended from the robot */
    double swing_hz;
    double swing_damping;
};

struct plant_encoder_effects {
    double eccentricity_rad[PLANT_WHEELS];
    double eccentricity_phase_rad[PLANT_WHEELS];
    double dropout[PLANT_WHEELS]; /* share of counts lost at dropout_at_radps, in proportion to speed */
    double dropout_at_radps;
};

/* Motion of the body over the floor that the wheels do not measure. */
struct plant_creep_effects {
    double drift_rad_per_m; /* turn per distance */
    double distance_scale;  /* distance beyond what the wheels rolled, as a share */
};

/* A payload put onto the robot. */
struct plant_payload_effects {
    double mass_kg; /* 0: none */
    double yaw_inertia_kgm2;
    double at_s; /* plant time */
};

/* Torque disturbance: coloured noise, seeded. */
struct plant_disturbance_effects {
    double torque_nm[PLANT_WHEELS]; /* its RMS; 0: none */
    double correlation_s;
    double resting_mps; /* rim speed at which half of it acts, as it vanishes at rest; 0: acts fully at rest,
                           too */
};

/* What acts for some time only. A run begins when both wheels are let go (plant_hold_wheel); when something
 * acts in it is drawn from the seed. */
struct plant_intermittent_effects {
    double carpet_nm[PLANT_WHEELS]; /* dry friction of a wheel on the carpet; 0: none */
    double carpet_from_s;           /* of a run: the carpet begins from then on, */
    double carpet_room_s;           /* within so long, */
    double carpet_for_s;            /* and lasts so long */
    double carpet_from_m;           /* x at which it begins instead, */
    double carpet_for_m;            /* where it is so wide; 0: by time */
    double push_n[PLANT_WHEELS];    /* force on each side of the body, forward or back; 0: none */
    double push_share;              /* of the runs that have one */
    double push_from_s;
    double push_room_s;
    double push_for_s;
    double bind_nm[PLANT_WHEELS]; /* dry friction of a bearing while it binds; 0: never */
    double bind_every_s;
    double bind_for_s;
    double knock_n[PLANT_WHEELS]; /* force on each side of the body, forward or back; 0: none */
    double knock_every_s;         /* one at a random time in each such stretch of a run */
    double knock_for_s;
};

struct plant_unmodelled_effects {
    struct plant_driver_effects driver;
    struct plant_supply_effects supply;
    struct plant_thermal_effects thermal;
    struct plant_bristle_effects bristle;
    struct plant_gear_effects gear;
    struct plant_tyre_effects tyre;
    struct plant_load_effects load;
    struct plant_encoder_effects encoder;
    struct plant_creep_effects creep;
    struct plant_payload_effects payload;
    struct plant_disturbance_effects disturbance;
    struct plant_intermittent_effects intermittent;
};

/* NULL when these numbers are valid; else one line that names the invalid one, which stays valid until this
 * thread calls again. */
const char *plant_unmodelled_effects_problem(const struct plant_unmodelled_effects *effects);

#ifdef __cplusplus
}
#endif

#endif
