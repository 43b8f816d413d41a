/* A brushed motor on its H-bridge: current in, current out, charge taken from the supply. */
#ifndef PLANT_MOTOR_H
#define PLANT_MOTOR_H

#include "plant_params.h"

/* A stretch of the PWM period with one bridge state. */
struct motor_segment {
    double duration_s;
    double decay;  /* decay of a current's distance from its final value over the stretch */
    double spread; /* the integral of that distance over the stretch, per ampere at its start, s */
};

struct motor {
    double resistance_ohm;
    double time_constant_s; /* winding, L/R */
    double diodes_v;        /* both free-wheeling diodes in series */
    double current_a;
    struct motor_segment brake, drive, coast;
    double drive_sign; /* of the supply across the motor while it drives */
};

/* Result of one step. */
struct motor_flow {
    double motor_charge_as;  /* integral of the motor's current */
    double supply_charge_as; /* integral of the current from the supply */
};

void motor_init(struct motor *motor, const struct plant_motor_params *params,
                const struct plant_bridge_params *bridge);

/* Sets the winding's resistance at its present temperature; the inductance does not change. */
void motor_set_resistance(struct motor *motor, double resistance_ohm);
void motor_set_bridge(struct motor *motor, double in1_duty, double in2_duty);
struct motor_flow motor_step(struct motor *motor, double emf_v, double supply_v);

#endif
