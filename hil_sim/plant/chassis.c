/* The body between the wheels: mass referred to each rim, resistance to yaw, and the true pose.
 *
 * The tyres roll without slip, so that the rims' speeds uL and uR are the body's: v = (uL + uR) / 2 and
 * omega = (uR - uL) / W (Bakirci 2023, (7) and (8)). Kinetic energy
 *
 *     1/2 m v^2 + 1/2 I omega^2 + sum 1/2 (Jw + N^2 Jr) (u / r)^2
 *
 * in these speeds gives each rim m/4 + I/W^2 + (Jw + N^2 Jr)/r^2, and m/4 - I/W^2 between them. The
 * centre of mass is taken to be above the axle.
 */
#include "chassis.h"

#include <math.h>

/* Yaw rate below which scrub treats the robot as not turning. */
static const double resting_radps = 1e-3;

static double rotating_kg(const struct plant_wheel_params *wheel)
{
    const double ratio = wheel->motor.gear_ratio;
    const double inertia = wheel->inertia_kgm2 + ratio * ratio * wheel->motor.rotor_inertia_kgm2;
    return inertia / (wheel->radius_m * wheel->radius_m);
}

void chassis_init(struct chassis *chassis, const struct plant_params *params)
{
    const struct plant_chassis_params *body = &params->chassis;
    const double forward = body->mass_kg / 4.0;
    const double yaw = body->yaw_inertia_kgm2 / (body->wheelbase_m * body->wheelbase_m);

    *chassis = (struct chassis){
        .params = *body,
        .mass = {.left = forward + yaw + rotating_kg(&params->wheel[0]),
                 .right = forward + yaw + rotating_kg(&params->wheel[1]),
                 .cross = forward - yaw},
        .cos_theta = 1.0,
    };
}

/* A contact patch that is twisted on the spot slides everywhere and resists with its full moment, at
 * however small a rate. One that rolls is renewed all the time and carries only the twist that builds up
 * while a point passes through it, so that its moment grows with the path's curvature and saturates at
 * the same value (turn slip; Pacejka, Tire and Vehicle Dynamics, chapter 3). Between the two,
 *
 *     M = M0 omega / sqrt(omega^2 + (kappa v)^2)
 *
 * with kappa the curvature at which rolling patches reach 0.7 of the full moment. The magnitude here
 * comes from the speeds before the step, the direction from friction_solve, which cannot overshoot.
 */
double chassis_scrub_n(const struct chassis *chassis, const struct friction_speeds *rims)
{
    const struct plant_chassis_params *params = &chassis->params;
    const double omega = (rims->right - rims->left) / params->wheelbase_m;
    const double rolling = params->scrub_curvature_per_m * 0.5 * (rims->left + rims->right);
    const double turning = omega * omega + resting_radps * resting_radps;
    const double share = sqrt(turning / (turning + rolling * rolling));
    return params->scrub_nm * share / params->wheelbase_m;
}

void chassis_roll(struct chassis *chassis, double left_m, double right_m)
{
    const double distance_m = 0.5 * (left_m + right_m);
    const double turn_rad = (right_m - left_m) / chassis->params.wheelbase_m;

    if (turn_rad == 0.0) {
        chassis->x_m += distance_m * chassis->cos_theta;
        chassis->y_m += distance_m * chassis->sin_theta;
        return;
    }
    /* Midpoint rule along the arc. The heading's cosine and sine turn by half a step at a time with a
       series that is exact to the last bit for turns this small (below 1e-3 rad), and are rescaled. */
    const double half = 0.5 * turn_rad;
    const double square = half * half;
    const double c = 1.0 - square * (0.5 - square * (1.0 / 24.0));
    const double s = half * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0)));
    const double mid_cos = chassis->cos_theta * c - chassis->sin_theta * s;
    const double mid_sin = chassis->sin_theta * c + chassis->cos_theta * s;
    const double end_cos = mid_cos * c - mid_sin * s;
    const double end_sin = mid_sin * c + mid_cos * s;
    const double rescale = 1.5 - 0.5 * (end_cos * end_cos + end_sin * end_sin);

    chassis->x_m += distance_m * mid_cos;
    chassis->y_m += distance_m * mid_sin;
    chassis->theta_rad += turn_rad;
    chassis->cos_theta = end_cos * rescale;
    chassis->sin_theta = end_sin * rescale;
}
