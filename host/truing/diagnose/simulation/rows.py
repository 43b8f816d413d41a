"""Rows of the array that a simulation works in, one column per wheel: everything that changes on the way.

One array instead of a dozen keeps the calls between compiled functions short.
"""

from __future__ import annotations

# The state.
SPEED, TRAVEL, DUTY, HEAT, DRAW = range(5)
# What holds over one substep.
AT, LEVEL, RATE, HELD, DIRECTION, TARGET, MEAN, EFFORT, PUSH, LOSS, SLOPE, START = range(5, 17)
OWN, LIMITED, GAIN, CALM, SWING, END, GONE, NET, COMMAND = range(17, 26)
# Measured wheel angles at the substep's two ends and where the run began, rad.
ANGLE_START, ANGLE_END, ORIGIN = range(26, 29)
# Travel and ground travel at the row's start; when the input changes next, s; the number of its piece.
TRAVEL_BEFORE, GROUND_BEFORE, EDGE, PIECE = range(29, 33)
# Exponentials that were computed last: of the whole and half substep, the lag, the lag against the wheel.
WHOLE, HALF, LAG, AGAINST, MEMORY_END = 33, 37, 41, 45, 49
OF_RATE, OF_SPAN, INTEGRAL, KEEP = range(4)
# The bodies of a wheel that has a gap or slides (`bodies.py`).
MOTOR, WHEEL, ROBOT, PLACE, TOUCH, ROLLS, GROUND = range(49, 56)
# Clusters of bodies that move as one: motor side, wheel side, robot; the first column alone is used.
MOTOR_SIDE, WHEEL_SIDE, ROBOT_SIDE = 56, 61, 66
C_SPEED, C_LEVEL, C_RATE, C_HELD, C_END, CLUSTER_ROWS = range(6)
ROWS = 71
