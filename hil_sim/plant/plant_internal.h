/* The state of a plant, for the plant's own files. */
#ifndef PLANT_INTERNAL_H
#define PLANT_INTERNAL_H

#include <stdint.h>

#include "battery.h"
#include "chassis.h"
#include "friction.h"
#include "motor.h"
#include "plant_params.h"

struct extended_robot;
struct recorder;

struct plant {
    struct plant_params params;
    uint64_t seed;
    uint64_t steps;
    struct battery battery;
    struct motor motor[PLANT_WHEELS];
    struct chassis chassis;
    struct friction_mass mass;          /* the chassis', with one step's viscous friction */
    double emf_per_speed[PLANT_WHEELS]; /* back-EMF per rim speed, V s/m; equals force per current */
    double angle_rad[PLANT_WHEELS];
    double angle_before_rad[PLANT_WHEELS];    /* one step ago */
    double acceleration_radps2[PLANT_WHEELS]; /* upper bound, see fastest_change */
    struct friction_speeds rims;
    double hold_nm[PLANT_WHEELS];       /* dry friction of a hand or kerb */
    double asked_duty[PLANT_WHEELS][2]; /* of the bridge inputs */
    struct extended_robot *extended;    /* NULL: no unmodelled effects */
    struct recorder *recorder;          /* NULL: the true state is not recorded */
};

#endif
