/* A brushed motor on its H-bridge: every stretch of the PWM period is solved exactly.
 *
 *     L di/dt = u - R i - emf
 *
 * with u = +-supply while one input is high, 0 while both are (one side of the bridge shorts the winding),
 * and minus or plus (supply + two diode drops) while both are low and current still flows; then the circuit
 * is open. Supply and back-EMF are constant within a step, so that the current is an exponential. The winding
 * (about 0.3 ms) is slower than a period and faster than everything mechanical; it is kept because it decides
 * how much current a coasting bridge carries.
 */
#include "motor.h"

#include <math.h>

static const double period_s = PLANT_STEP_US * 1e-6;

static struct motor_segment segment(const struct motor *motor, double fraction)
{
    const double duration_s = fraction * period_s;
    const double decay = exp(-duration_s / motor->time_constant_s);
    return (struct motor_segment){
        .duration_s = duration_s,
        .decay = decay,
        .spread = motor->time_constant_s * (1.0 - decay),
    };
}

void motor_init(struct motor *motor, const struct plant_motor_params *params,
                const struct plant_bridge_params *bridge)
{
    *motor = (struct motor){
        .resistance_ohm = params->resistance_ohm,
        .time_constant_s = params->inductance_h / params->resistance_ohm,
        .diodes_v = 2.0 * bridge->diode_drop_v,
    };
    motor_set_bridge(motor, 0.0, 0.0);
}

static double clamp_duty(double duty)
{
    /* Written so that NaN becomes 0: an undriven input is low. */
    if (!(duty > 0.0)) {
        return 0.0;
    }
    return duty < 1.0 ? duty : 1.0;
}

void motor_set_bridge(struct motor *motor, double in1_duty, double in2_duty)
{
    const double in1 = clamp_duty(in1_duty);
    const double in2 = clamp_duty(in2_duty);
    const double both = in1 < in2 ? in1 : in2;
    const double any = in1 < in2 ? in2 : in1;

    motor->brake = segment(motor, both);
    motor->drive = segment(motor, any - both);
    motor->coast = segment(motor, 1.0 - any);
    motor->drive_sign = in1 < in2 ? -1.0 : 1.0;
}

void motor_set_resistance(struct motor *motor, double resistance_ohm)
{
    const double inductance_h = motor->time_constant_s * motor->resistance_ohm;
    motor->resistance_ohm = resistance_ohm;
    motor->time_constant_s = inductance_h / resistance_ohm;
    motor->brake = segment(motor, motor->brake.duration_s / period_s);
    motor->drive = segment(motor, motor->drive.duration_s / period_s);
    motor->coast = segment(motor, motor->coast.duration_s / period_s);
}

/* Current through one stretch at a fixed voltage; returns its integral. */
static double flow(struct motor *motor, const struct motor_segment *part, double final_a)
{
    const double distance_a = motor->current_a - final_a;
    motor->current_a = final_a + distance_a * part->decay;
    return final_a * part->duration_s + distance_a * part->spread;
}

static struct motor_flow coast(struct motor *motor, double emf_v, double supply_v)
{
    /* The diodes set the supply against whatever current flows; a back-EMF beyond the clamp starts one. */
    const double clamp_v = supply_v + motor->diodes_v;
    const double start_a = motor->current_a;
    double against = start_a > 0.0 ? -1.0 : 1.0;
    if (start_a == 0.0) {
        if (fabs(emf_v) <= clamp_v) {
            return (struct motor_flow){0.0, 0.0};
        }
        against = emf_v > 0.0 ? 1.0 : -1.0;
    }

    const double final_a = (against * clamp_v - emf_v) / motor->resistance_ohm;
    double charge_as = 0.0;
    if (start_a * final_a < 0.0) {
        const double distance_a = start_a - final_a;
        if ((final_a + distance_a * motor->coast.decay) * start_a <= 0.0) {
            /* The current reaches zero within the stretch and stays there: the diodes block. */
            const double dies_s = motor->time_constant_s * log(distance_a / -final_a);
            charge_as = final_a * dies_s + motor->time_constant_s * start_a;
            motor->current_a = 0.0;
            return (struct motor_flow){charge_as, against * charge_as};
        }
    }
    charge_as = flow(motor, &motor->coast, final_a);
    return (struct motor_flow){charge_as, against * charge_as};
}

struct motor_flow motor_step(struct motor *motor, double emf_v, double supply_v)
{
    struct motor_flow total = {0.0, 0.0};

    if (motor->brake.duration_s > 0.0) {
        total.motor_charge_as += flow(motor, &motor->brake, -emf_v / motor->resistance_ohm);
    }
    if (motor->drive.duration_s > 0.0) {
        const double final_a = (motor->drive_sign * supply_v - emf_v) / motor->resistance_ohm;
        const double charge_as = flow(motor, &motor->drive, final_a);
        total.motor_charge_as += charge_as;
        total.supply_charge_as += motor->drive_sign * charge_as;
    }
    if (motor->coast.duration_s > 0.0) {
        const struct motor_flow idle = coast(motor, emf_v, supply_v);
        total.motor_charge_as += idle.motor_charge_as;
        total.supply_charge_as += idle.supply_charge_as;
    }
    return total;
}
