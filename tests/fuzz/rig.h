/* Shared by the fuzz programs: a controller on the in-memory board, and the properties checked for all
 * inputs. */
#ifndef FUZZ_RIG_H
#define FUZZ_RIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "controller.h"
#include "hal_host.h"

/* Ends the program with a message, which libFuzzer reports together with the input. */
#define RIG_REQUIRE(condition) rig_require((condition), #condition, __FILE__, __LINE__)

struct rig {
    struct hal_host board;
    struct controller controller;
    uint16_t sequence; /* of the last request */
    bool may_move;     /* a request to move was accepted, and nothing has ended it since */
    bool accepted;     /* the last request */
    struct frame_decoder decoder;
    struct frame reply;
};

extern struct rig rig;

void rig_require(bool holds, const char *condition, const char *file, int line);

/* The controller after power-up, at rest, with a blank parameter store. */
void rig_power_up(void);

/* The same with what the store holds. */
void rig_power_cycle(void);

/* One tick and one turn of the main loop. Checks that no motor is driven unless a request to move was
 * accepted, and none beyond the limit. */
void rig_tick(void);

/* A valid frame to the controller, and its reply. Checks that there is one, and that a refusal moves
 * nothing. */
void rig_ask(uint8_t id, const uint8_t *payload, size_t length);

/* The same frame again, as a host sends it whose reply was lost. Checks that nothing is carried out twice. */
void rig_ask_again(uint8_t id, const uint8_t *payload, size_t length);

/* The input, consumed from the front; zeros when it is used up. */
struct rig_input {
    const uint8_t *at;
    size_t left;
};

uint8_t rig_u8(struct rig_input *input);
uint16_t rig_u16(struct rig_input *input);
uint32_t rig_u32(struct rig_input *input);

/* Up to `length` bytes; how many there were is returned, where they are in *out. */
size_t rig_bytes(struct rig_input *input, size_t length, const uint8_t **out);

#endif
