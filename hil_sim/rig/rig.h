/* The rig: wires between the virtual board's pins and the plant's terminals, and the ways they can break. */
#ifndef RIG_H
#define RIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../board/board.h"
#include "../plant/plant.h"
#include "encoder_noise.h"
#include "target.h"

#pragma GCC visibility push(default)

enum { RIG_WHEELS = PLANT_WHEELS, RIG_LINK_USART = 3 };

enum rig_encoder_fault {
    RIG_ENCODER_GOOD,
    RIG_ENCODER_UNPLUGGED, /* both phases rest at one level */
    RIG_ENCODER_FROZEN,    /* the disc is loose: the counts stop where they are */
    RIG_ENCODER_REVERSED,  /* phases swapped in the plug */
    RIG_ENCODER_PHASE_A,   /* phase A dropped: only B toggles */
    RIG_ENCODER_PHASE_B    /* phase B dropped: only A toggles */
};

struct rig;

/* The chip as it is soldered on `target`. Robot NULL: none is connected (encoders rest, battery terminals
   dead unless battery_v says otherwise). Returns NULL when the robot's parameters are bad or the CPU engine
   cannot be opened. */
struct rig *rig_create(const struct plant_params *robot, uint64_t seed, const uint8_t unique_id[12],
                       bool crystal_alive, enum rig_target target);
void rig_destroy(struct rig *rig);

struct board *rig_board(struct rig *rig);
bool rig_flash(struct rig *rig, uint32_t address, const uint8_t *data, size_t length);

/* Runs for this many microseconds of virtual time. */
void rig_run_us(struct rig *rig, uint64_t span_us);
uint64_t rig_time_us(const struct rig *rig);

/* The link, USART3. Bytes to the board enter the line now, one after the other; bytes from it can be fetched
   once they have been shifted out. */
void rig_link_write(struct rig *rig, const uint8_t *data, size_t length);
size_t rig_link_read(struct rig *rig, uint8_t *out, size_t capacity);
enum board_phase rig_phase(const struct rig *rig); /* for a profiler, from any thread */
size_t rig_link_pending(const struct rig *rig);    /* bytes to the board still on the line */
/* Speed of the host's port; the board samples its bytes at its own speed, and what it sends is garbled when
   the two differ by more than 3 %. 0: the cable is cut. */
void rig_link_baud(struct rig *rig, double baud);
/* The line to the board is turned over for `pulse_ns` each `period_ns`; a pulse between two bytes does
   nothing. 0: never. */
void rig_link_noise(struct rig *rig, uint32_t period_ns, uint32_t pulse_ns);

/* Gives the robot these effects from the present time on (plant_set_unmodelled_effects); false: bad numbers,
   or no robot. */
bool rig_set_unmodelled_effects(struct rig *rig, const struct plant_unmodelled_effects *effects);
/* Puts the robot elsewhere (plant_place). */
void rig_place(struct rig *rig, double x_m, double y_m, double theta_rad);
/* Records the robot's true state from the present time on (plant_record). */
bool rig_record(struct rig *rig, struct plant_sample *out, size_t capacity, uint64_t every_steps);
size_t rig_recorded(struct rig *rig);

/* True state of the robot at the present time. */
void rig_truth(struct rig *rig, struct plant_state *out);
/* Fraction of time the bridge inputs of a wheel are high at present: IN1, IN2. */
void rig_bridge(const struct rig *rig, int wheel, double out[2]);
/* Level of the status LED's pin, PC12; below 0: not driven. */
double rig_led(const struct rig *rig);
/* Level of the drivers' enable pin, PC6; below 0: not driven. */
double rig_driver_enable(const struct rig *rig);
/* Drivers with an enable input, high to enable: without it their outputs float and the motors coast. */
void rig_wire_driver_enable(struct rig *rig, bool wired);

/* Faults. Each acts from the present time until it is removed. */
void rig_encoder_fault(struct rig *rig, int wheel, enum rig_encoder_fault fault);
/* False: a burst longer than its period, or pulses of no width. */
bool rig_encoder_noise(struct rig *rig, int wheel, const struct rig_encoder_noise *noise);
void rig_swap_motors(struct rig *rig, bool swapped); /* each bridge drives the other wheel's motor */
void rig_motor_connected(struct rig *rig, int wheel, bool connected);
void rig_turn_wheel(struct rig *rig, int wheel, double angle_rad); /* by hand, with the robot lifted */
void rig_swap_encoders(struct rig *rig, bool swapped); /* each encoder is plugged into the other input */
void rig_hold_wheel(struct rig *rig, int wheel, double torque_nm); /* a hand or a kerb; 0 lets go */
void rig_battery_sense_connected(struct rig *rig,
                                 bool connected);        /* the divider loses the battery, motors keep it */
void rig_cut_off_battery(struct rig *rig, bool cut_off); /* its plug is out, or its protection has opened */
void rig_bench_voltage(struct rig *rig,
                       double volts); /* the divider sees a bench supply; below 0: the battery */
void rig_emergency_stop(struct rig *rig, bool pressed); /* its contact opens, as by a broken wire */
void rig_crystal_alive(struct rig *rig, bool alive);
void rig_crystal_hz(struct rig *rig, uint32_t hz); /* another crystal than the 8 MHz */
void rig_crystal_ppm(struct rig *rig, double ppm); /* deviation from the nominal frequency */
void rig_power(struct rig *rig, bool on);          /* the board's supply; off also releases the bridges */
void rig_reset(struct rig *rig, enum board_reset cause);

#pragma GCC visibility pop

#endif
