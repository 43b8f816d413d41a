/* A learned correction beside two wheels: lookups of one variable each, behind the wheels' own lag. */
#ifndef TRUING_CORRECTION_H
#define TRUING_CORRECTION_H

enum correction_place { FORCE, DRY_FRICTION, GAIN_SHARE, INERTIA_SHARE, SIGNAL_SHARE };

/* As in truing/model/correction.py. */
enum correction_variable {
    OWN_SPEED,
    SPEED_DIFFERENCE,
    NET_EFFORT,
    OTHER_NET_EFFORT,
    OWN_EFFORT,
    OTHER_EFFORT,
    LOAD,
    RUN_TIME,
    SET_TIME,
    TRAVEL,
    TRAVEL_REPEATING,
    ANGLE_REPEATING,
    PLACE_X,
    PLACE_Y,
    PLACE_X_REPEATING,
    PLACE_Y_REPEATING,
    AHEAD,
    HEADING,
    RECENT_EFFORT,
    HEAT,
    RINGING,
    RINGING_RATE,
    MEAN_RINGING,
    MEAN_RINGING_RATE,
};

/* Piecewise linear over a rising grid (zero twice: a jump), constant beyond it. */
struct correction_term {
    enum correction_place place;
    enum correction_variable variable;
    double constant; /* period (m), time constant (s) or frequency (Hz) */
    int count;
    const double *grid;
    const double *value[2];
};

enum { CORRECTION_MEMORIES = 8 };

struct correction {
    double added_mps[2];  /* what the correction adds to the physical model's speed */
    double speed_mps[2];  /* of the wheels, corrected */
    double shown_mps[2];  /* as a recorder with the signal's error shows it */
    double travel_m[2];
    double time_s;
    double x_m, y_m, heading_rad;
    double memory[CORRECTION_MEMORIES][2];
    double rate[CORRECTION_MEMORIES][2];
};

/* Number of terms; 0: there is no correction. */
int correction_terms(void);

/* Longest substep, s. */
double correction_longest_step_s(void);

/* One substep of h s under held efforts; the physical model's speeds are those at its end. */
void correction_step(struct correction *correction, double h, const double effort[2], const double base_mps[2],
                     double wheelbase_m);

#endif
