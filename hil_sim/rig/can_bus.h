/* A CAN bus that boards share, with one more node for the host. */
#ifndef CAN_BUS_H
#define CAN_BUS_H

#include "rig.h"

#pragma GCC visibility push(default)

struct can_bus;

struct can_bus_frame {
    uint64_t time_us; /* its end */
    uint32_t id;
    uint8_t extended, remote, length;
    uint8_t data[8];
};

/* NULL when memory runs out. The bit rate is that of the host's node. */
struct can_bus *can_bus_create(double bit_rate);
void can_bus_destroy(struct can_bus *bus);
void can_bus_bit_rate(struct can_bus *bus, double bit_rate);
/* How the host's node divides a bit: quanta up to its sample point and after it, jump width. At first 14, 2
 * and 1, as adapters are set. */
void can_bus_bit_timing(struct can_bus *bus, uint32_t before, uint32_t after, uint32_t jump);
/* How long a level takes from any node to any other, transceivers included; 150 ns at first. */
void can_bus_delay(struct can_bus *bus, double delay_ns);

/* Plugs a board in; all boards of a bus have one time. False: its time is not the bus's, or no place is left.
 */
bool can_bus_attach(struct can_bus *bus, struct rig *rig);
void can_bus_detach(struct can_bus *bus, struct rig *rig);

/* Runs the boards in lock step. */
void can_bus_run_us(struct can_bus *bus, uint64_t span_us);

/* The host's node. A frame takes part in arbitration from now on; false: 1024 wait already. */
bool can_bus_write(struct can_bus *bus, const struct can_bus_frame *frame);
bool can_bus_read(struct can_bus *bus, struct can_bus_frame *out);
/* Unplugged, the host neither acknowledges nor receives. */
void can_bus_connect_host(struct can_bus *bus, bool connected);

/* Faults: both wires touch, so that no bit is transmitted; the next frames are damaged on the wire. */
void can_bus_short(struct can_bus *bus, bool shorted);
void can_bus_damage(struct can_bus *bus, uint64_t frames);

struct can_bus_totals {
    uint64_t frames, bits, damaged, unacknowledged;
};
void can_bus_totals(const struct can_bus *bus, struct can_bus_totals *out);

#pragma GCC visibility pop

#endif
