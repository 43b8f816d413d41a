/* The boards that the rig knows; pin_map.c has what is soldered to the chip on each. */
#ifndef TARGET_H
#define TARGET_H

enum rig_target {
    RIG_TARGET_OLIMEX_H405,
    RIG_TARGET_F405_USB,     /* right bridge on TIM8, USB pins free, 12 MHz, another divider */
    RIG_TARGET_PWM_DIR,      /* the first one with other motor drivers */
    RIG_TARGET_PHASE_ENABLE, /* likewise */
    RIG_TARGETS
};

#endif
