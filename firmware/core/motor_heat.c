/* I2t: a motor's heating by the current that effort, supply and speed imply; no board here measures it. */
#include "motor_heat.h"

#include "rounding.h"

static const float tick_s = 0.001f;
static const float cooled_share = 0.8f;

struct motor_thermal motor_thermal(float resistance_ohm, float emf_vs_per_m, float continuous_a,
                                   float time_constant_s)
{
    return (struct motor_thermal){
        .known = resistance_ohm > 0.0f && continuous_a > 0.0f,
        .resistance_ohm = resistance_ohm,
        .emf_vs_per_m = emf_vs_per_m,
        .limit_a2 = continuous_a * continuous_a,
        .share = tick_s / time_constant_s,
    };
}

void motor_heat_step(struct motor_heat *motor, const struct motor_thermal *thermal, float effort,
                     float supply_v, float speed_mps)
{
    if (!thermal->known) {
        *motor = (struct motor_heat){0};
        return;
    }
    if (!is_finite(motor->heat_a2)) {
        motor->heat_a2 = thermal->limit_a2;
    }
    const float current_a = (effort * supply_v - thermal->emf_vs_per_m * speed_mps) / thermal->resistance_ohm;
    motor->heat_a2 += thermal->share * (current_a * current_a - motor->heat_a2);
    motor->hot = motor->heat_a2 > (motor->hot ? cooled_share : 1.0f) * thermal->limit_a2;
}
