/* External forces: drag, torque ripple, slope, rough patches, a tether, a swinging load. */
#ifndef PLANT_LOAD_H
#define PLANT_LOAD_H

#include "chassis.h"
#include "unmodelled_effects.h"

struct load {
    double swing_m, swing_mps; /* of the hung load against the body */
};

/* State of the robot on which the loads depend. */
struct load_view {
    const struct plant_wheel_params *wheel;
    const struct chassis *chassis;
    double mass_kg;
    double rim_mps[PLANT_WHEELS];
    double motor_rad[PLANT_WHEELS]; /* at the wheel */
};

/* Forces at the rims, N, forward positive, without those of patches and the swinging load, see
 * `load_body_n`. */
void load_rims_n(const struct plant_load_effects *params, const struct load_view *view,
                 double out[PLANT_WHEELS]);

/* Forces on the body, half of them for each side; moves the swinging load on by `span_s`. */
double load_body_n(struct load *load, const struct plant_load_effects *params, const struct load_view *view,
                   double span_s);

#endif
