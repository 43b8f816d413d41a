/* Everything that the robot keeps from one tick to the next: what robot.c and robot_parameters.c work on. */
#ifndef ROBOT_STATE_H
#define ROBOT_STATE_H

#include <stdbool.h>
#include <stdint.h>

#include "drive.h"
#include "hal.h"
#include "log.h"
#include "log_feed.h"
#include "log_trigger.h"
#include "motor_heat.h"
#include "odometry.h"
#include "parameter_store.h"
#include "parameters.h"
#include "recorder.h"
#include "sequence.h"
#include "supervisor.h"
#include "telemetry.h"
#include "tuning.h"
#include "wheel_speed.h"
#include "wheel_watch.h"

struct robot {
    uint32_t boot_id;
    struct parameters parameters;
    struct parameter_store store;
    struct tuning tuning;
    struct hal_sample sample;   /* of this tick */
    int32_t counts[HAL_WHEELS]; /* forward positive, since start-up, wrapping */
    struct wheel_speed wheels[HAL_WHEELS];
    struct wheel_watch watches[HAL_WHEELS];
    struct motor_heat heat[HAL_WHEELS];
    struct wheel_measure speed[HAL_WHEELS]; /* controlled variable of velocity mode */
    struct odometry odometry;
    struct drive drive;
    struct sequence sequence;
    struct recorder recorder;
    struct supervisor supervisor;
    struct supervisor_view view; /* of this tick */
    volatile uint32_t now_ms;
    /* A stop has arrived that the main loop may not have come to yet. Until it has, what arrived before the
     * stop moves nothing. Set by the tick, taken back by the main loop. */
    volatile bool stop_heard;
    bool speeds_stale;    /* ticks were missed: the counts since the last one give no speed */
    struct log_feed feed; /* from the tick to the log */
    struct log log;
    struct log_trigger trigger;
    struct telemetry telemetry;
};

#endif
