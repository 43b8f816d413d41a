/* I2t: a motor's heating by the current that effort, supply and speed imply; no board here measures it.
 *
 *     i = (effort * supply - emf * speed) / resistance    slow decay: the mean voltage is effort * supply
 *     d(heat)/dt = (i^2 - heat) / time constant           heat: the square of a constant current as bad
 */
#ifndef MOTOR_HEAT_H
#define MOTOR_HEAT_H

#include <stdbool.h>

struct motor_thermal {
    bool known; /* resistance and current are; otherwise there is no limit */
    float resistance_ohm;
    float emf_vs_per_m; /* 0: unknown, and each current is that of a standing wheel */
    float limit_a2;
    float share; /* of the way to i^2 that a tick goes */
};

struct motor_heat {
    float heat_a2;
    bool hot; /* beyond the limit, until it has cooled to four fifths of it */
};

/* Not known, unless both `resistance_ohm` and `continuous_a` are above zero. */
struct motor_thermal motor_thermal(float resistance_ohm, float emf_vs_per_m, float continuous_a,
                                   float time_constant_s);

/* One tick. Where the heat is no number, it is taken for the limit's. */
void motor_heat_step(struct motor_heat *motor, const struct motor_thermal *thermal, float effort,
                     float supply_v, float speed_mps);

#endif
