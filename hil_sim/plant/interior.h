/* What the plant's own files know of a plant. */
#ifndef PLANT_INTERIOR_H
#define PLANT_INTERIOR_H

#include "battery.h"
#include "chassis.h"
#include "friction.h"
#include "motor.h"
#include "plant.h"

struct hidden;
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
    double acceleration_radps2[PLANT_WHEELS]; /* more than a wheel ever has, see fastest_change */
    struct friction_speeds rims;
    double hold_nm[PLANT_WHEELS];       /* dry friction from outside */
    double asked_duty[PLANT_WHEELS][2]; /* of the bridge inputs */
    struct hidden *hidden;              /* NULL: the robot is what plant_params says */
    struct recorder *recorder;          /* NULL: nobody writes down the truth */
};

/* One step's viscous friction as the rim feels it. */
double plant_viscous_kg(const struct plant_wheel_params *wheel);

/* Largest impulse of plant_params' dry friction in one step, and of a hand that holds the wheel. */
double plant_dry_impulse(const struct plant_wheel_params *wheel, double rim_speed, double hold_nm);

#endif
