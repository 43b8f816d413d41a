/* Counts and times at which the wheel watch decides; tuning.c lengthens the times for coarse encoders. */
#ifndef WHEEL_WATCH_LIMITS_H
#define WHEEL_WATCH_LIMITS_H

enum {
    /* Counts without information: a loose wire, or one phase alone, toggles between two positions. */
    WHEEL_WATCH_DITHER_COUNTS = 2,
    /* From rest: a wheel of the paper's robot in a pivot, where breakaway takes 15 % of effort, makes three
     * counts in 40 ms at 25 %. Six times that leaves room for stiff grease and a gear's backlash. */
    WHEEL_WATCH_START_MS = 250,
    /* Once a wheel has been seen to start from rest: beyond what it may take at worst, and the delay seen. */
    WHEEL_WATCH_START_SLACK_MS = 10,
    /* Counts that end abruptly at speed are an encoder fault: a crash at 5 g would still take 7 ms from 0.35
     * m/s. The wait serves the comparison of two windows only. */
    WHEEL_WATCH_BROKEN_OFF_MS = 40,
    /* So often one phase alone turns round meanwhile, even when ticks see few of its edges. */
    WHEEL_WATCH_TURNS = 4,
    /* A wheel that is held: a bump may hold it briefly, and a motor withstands its stall current for
     * seconds. */
    WHEEL_WATCH_STALL_MS = 400,
    /* A wheel that hardly turns under a large effort. A robot with a time constant of 5 s goes a twentieth of
     * its speed's distance in this time also when it is reversed meanwhile. */
    WHEEL_WATCH_CREEP_MS = 1000,
    WHEEL_WATCH_CREEP_STEP_MS = 125,
};

#endif
