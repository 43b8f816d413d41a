/* From commands to the effort that the bridges apply: effort mode, velocity mode, braked. */
#include "drive.h"

#include "proto.h"
#include "rounding.h"

static const float effort_to_e4 = 10000.0f;
static const float tick_s = 0.001f;

void drive_init(struct drive *drive)
{
    *drive = (struct drive){.mode = PROTO_MODE_IDLE};
}

void drive_command(struct drive *drive, uint8_t mode, float left, float right)
{
    if (mode == PROTO_MODE_VELOCITY && drive->mode != PROTO_MODE_VELOCITY) {
        drive->take_over = true;
    }
    drive->mode = mode;
    drive->command[0] = left;
    drive->command[1] = right;
}

void drive_brake(struct drive *drive)
{
    static const int16_t none[HAL_WHEELS] = {0, 0};
    drive_command(drive, PROTO_MODE_IDLE, 0.0f, 0.0f);
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        drive->applied_e4[wheel] = 0;
    }
    hal_drive(none);
}

static float wheel_effort(struct drive *drive, const struct tuning *tuning, int wheel,
                          const struct wheel_measure *speed, bool still)
{
    switch (drive->mode) {
    case PROTO_MODE_EFFORT:
        return slew((float)drive->applied_e4[wheel] / effort_to_e4, drive->command[wheel],
                    tuning->effort_slew_per_s * tick_s);
    case PROTO_MODE_VELOCITY:
        if (drive->take_over) {
            /* The previous effort is the slew limit's starting point, so that there is no step. */
            const float effort = (float)drive->applied_e4[wheel] / effort_to_e4;
            velocity_control_reset(&drive->control[wheel], speed->mps, effort);
        }
        return velocity_control_step(&drive->control[wheel], &tuning->gains[wheel], drive->command[wheel],
                                     speed, still);
    default:
        return 0.0f;
    }
}

/* Before any clamp: a clamp makes a limit, that is full effort, of what is not a number. */
static bool is_share(float value)
{
    return value >= 0.0f && value <= 1.0f;
}

void drive_step(struct drive *drive, const struct tuning *tuning,
                const struct wheel_measure speed[HAL_WHEELS], const bool still[HAL_WHEELS])
{
    int16_t pins_e4[HAL_WHEELS];
    float wanted[HAL_WHEELS];
    bool finite = is_share(tuning->effort_limit) && is_finite(tuning->effort_slew_per_s);
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        wanted[wheel] = wheel_effort(drive, tuning, wheel, &speed[wheel], still[wheel]);
        finite = finite && is_finite(wanted[wheel]);
    }
    drive->not_finite = !finite;
    for (int wheel = 0; wheel < HAL_WHEELS; wheel++) {
        const float effort =
            finite ? clampf(wanted[wheel], -tuning->effort_limit, tuning->effort_limit) : 0.0f;
        const int16_t effort_e4 = (int16_t)round_to_i32(effort * effort_to_e4);
        drive->applied_e4[wheel] = effort_e4;
        pins_e4[wheel] = (int16_t)(tuning->motor_reversed[wheel] ? -effort_e4 : effort_e4);
    }
    drive->take_over = false;
    hal_drive(pins_e4);
}

int16_t drive_logged_command(const struct drive *drive, int wheel)
{
    const float unit = drive->mode == PROTO_MODE_VELOCITY ? 1000.0f : effort_to_e4;
    return saturate_i16(round_to_i32(clampf(drive->command[wheel] * unit, -32768.0f, 32767.0f)));
}
