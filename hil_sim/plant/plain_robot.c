/* The robot that plant_params describes, without unmodelled effects: battery, bridges and motors, friction
 * and ground, pose. */
#include "plain_robot.h"

static const double step_s = PLANT_STEP_US * 1e-6;

double rim_viscous_kg(const struct plant_wheel_params *wheel)
{
    return step_s * wheel->friction.viscous_nms_per_rad / (wheel->radius_m * wheel->radius_m);
}

double rim_dry_impulse(const struct plant_wheel_params *wheel, double rim_speed, double hold_nm)
{
    const double torque = friction_limit_nm(&wheel->friction, rim_speed / wheel->radius_m) + hold_nm;
    return step_s * torque / wheel->radius_m;
}

void plain_step(struct plant *plant)
{
    const struct plant_wheel_params *wheel = plant->params.wheel;
    const struct friction_speeds before = plant->rims;
    const double supply_v = battery_terminal_v(&plant->battery);

    const struct motor_flow left =
        motor_step(&plant->motor[0], plant->emf_per_speed[0] * before.left, supply_v);
    const struct motor_flow right =
        motor_step(&plant->motor[1], plant->emf_per_speed[1] * before.right, supply_v);
    battery_step(&plant->battery, left.supply_charge_as + right.supply_charge_as);

    const struct friction_mass *mass = &plant->chassis.mass;
    const double momentum_left = mass->left * before.left + mass->cross * before.right +
                                 plant->emf_per_speed[0] * left.motor_charge_as;
    const double momentum_right = mass->cross * before.left + mass->right * before.right +
                                  plant->emf_per_speed[1] * right.motor_charge_as;
    const struct friction_limits limits = {
        .left = rim_dry_impulse(&wheel[0], before.left, plant->hold_nm[0]),
        .right = rim_dry_impulse(&wheel[1], before.right, plant->hold_nm[1]),
        .twist = step_s * chassis_scrub_n(&plant->chassis, &before),
    };
    plant->rims = friction_solve(&plant->mass, momentum_left, momentum_right, &limits);

    const double left_m = 0.5 * step_s * (before.left + plant->rims.left);
    const double right_m = 0.5 * step_s * (before.right + plant->rims.right);
    plant->angle_before_rad[0] = plant->angle_rad[0];
    plant->angle_before_rad[1] = plant->angle_rad[1];
    plant->angle_rad[0] += left_m / wheel[0].radius_m;
    plant->angle_rad[1] += right_m / wheel[1].radius_m;
    chassis_roll(&plant->chassis, left_m, right_m);
    plant->steps++;
}
