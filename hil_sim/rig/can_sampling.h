/* Whether a CAN node reads a frame of another: sample points and resynchronisation on the wire's edges. */
#ifndef CAN_SAMPLING_H
#define CAN_SAMPLING_H

#include "../board/board.h"

/* One node sends `frame`, the other receives it `delay_ps` later, and so long takes its acknowledgment back.
 */
struct can_pair {
    struct board_can_timing sender, receiver;
    double delay_ps;
};

enum can_reading {
    CAN_READ,         /* and the sender sees the acknowledgment at its sample point */
    CAN_ACK_TOO_LATE, /* read, but the acknowledgment comes after it, or is over before */
    CAN_MISREAD       /* a bit is sampled wrong: the receiver destroys the frame with an error flag */
};
enum can_reading can_read(const struct can_pair *pair, const struct board_can_frame *frame);

#endif
