"""The practice robots' integrator: winding, gear, bristles, tyre, battery and sensors at 0.2 ms steps.

All of it is in one file, since numba looks at the file of the function alone that it has cached.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numba
import numpy as np
from numpy.typing import NDArray

from support.practice_robots.physics import Physics

Array: TypeAlias = NDArray[np.float64]

STEP_S = 2e-4
STEPS_PER_MS = 5
ANGLE, TRAVEL, COUNTS, FILTERED, X, Y, HEADING, YAW_RATE, SUPPLY, WARM = 0, 2, 4, 6, 8, 9, 10, 11, 12, 13
"""Columns of a row: of both wheels the encoder's angle, the ground's travel, counts, filtered speed; pose."""

# Of `State.pose`: m, m, rad, rad/s; of `State.battery`: V, A s, A smoothed, A in this step.
AT_X, AT_Y, AT_HEADING, AT_YAW_RATE = range(4)
VOLTS, CHARGE, DRAWN, DRAWN_NOW = range(4)
# Of `State.events`: ms until the supply is back, ms until a push is over, and its direction.
TRIPPED_MS, PUSHED_MS, PUSH_SIGN = range(3)

PUSH_MS = 120
SCREW_SLIPS_MS = 300.0
TWO_PI = 2.0 * np.pi

_compiled: Callable[..., Any] = numba.njit(cache=True, nogil=True, error_model="numpy")
# Reference counts (`_nrt`) and passing 90 numbers on at each step would cost 50 times the arithmetic.
_PLAIN: dict[str, Any] = {"error_model": "numpy", "_nrt": False, "no_cpython_wrapper": True}
_part: Callable[..., Any] = numba.njit(**_PLAIN, no_cfunc_wrapper=True)
_inner: Callable[..., Any] = numba.njit(**_PLAIN, no_cfunc_wrapper=True, inline="always")


class Derived(NamedTuple):
    """What follows from a robot's numbers. Arrays are (2,): left, right."""

    two_mass: bool
    slipping: bool
    bristle: bool
    heated: bool
    stall: Array  # N m
    stall_current: Array  # A
    first_inertia: Array  # kg m2: ahead of the gear's gap, behind it, behind the tyre
    middle_inertia: Array
    last_inertia: Array
    bristle_stiffness: Array
    bristle_damping: Array
    scrub_stiffness: float
    scrub_damping: float
    normal: float  # N per wheel


class State(NamedTuple):
    """All that changes. Arrays are (2,): left, right; `pose`, `battery` and `events` have names above."""

    angle1: Array  # rad, at the gear's input side, with the encoder
    angle2: Array  # rad, wheel
    speed1: Array  # rad/s
    speed2: Array
    ground: Array  # rim speed that the ground sees, rad/s of a rolling wheel
    torque1: Array  # N m, on the gear's output side
    torque2: Array  # N m, from outside
    outer: Array  # N m, slow loads, held for the millisecond
    inertia_factor: Array
    current: Array  # A
    command: Array  # effort that reaches the bridge; nan: it floats
    lagged: Array
    held: Array
    deflection: Array  # rad, of the bearings' bristles
    scrub_deflection: Array  # (1,), rad
    screw_slips: Array  # ms that the set-screw slips on
    warm: Array  # relative rise of the winding's resistance, and of its case
    case: Array
    resistance: Array  # ohm
    travel: Array  # m
    measured: Array  # encoder's angle after its own faults, rad
    lost: Array  # rad
    phase: Array  # of the counts at the start
    whole: Array  # counts
    lost_whole: Array
    filtered: Array  # m/s
    pose: Array
    battery: Array
    events: Array


@_compiled
def simulate(
    p: Physics,
    effort: Array,
    disturbance: Array,
    start: NDArray[np.bool_],
    row: NDArray[np.bool_],
    quantised: bool,
    random: np.random.Generator,
) -> Array:
    """Drive the robot through a set of runs laid end to end; one output row per marked millisecond's end.

    Parameters
    ----------
    effort, disturbance
        (n, 2) per ms: commanded effort, and disturbing torque in effort units.
    start
        (n,) true at the first ms of a run, where the robot stands still at the origin.
    row
        (n,) true where a log row ends.
    quantised
        Counts are whole and lost at random; otherwise the same in the mean.

    Returns
    -------
    (rows, 15): encoder angle (rad) 2, ground travel (m) 2, counts 2, filtered rim speed (m/s) 2,
    x, y (m), heading (rad), yaw rate (rad/s), supply (V), relative rise of the windings' resistance 2.
    """
    out = np.zeros((int(row.sum()), 15))
    _drive(p, _derived(p), _at_rest(p, random), effort, disturbance, start, row, quantised, random, out)
    return out


@_part
def _drive(
    p: Physics,
    d: Derived,
    s: State,
    effort: Array,
    disturbance: Array,
    start: NDArray[np.bool_],
    row: NDArray[np.bool_],
    quantised: bool,
    random: np.random.Generator,
    out: Array,
) -> None:
    n = effort.shape[0]
    fetched = 0
    begin = 0
    for ms in range(n):
        if start[ms]:
            begin = ms
            _start_run(d, s)
        _trip(p, s, abs(effort[ms, 0]) + abs(effort[ms, 1]), random)
        for w in range(2):
            source = ms - p.delay_ms
            _driver(p, s, w, ms, effort[source, w] if source >= begin else 0.0)
            _slow_load(p, s, w, ms, disturbance[ms, w] * d.stall[w])
        on_patch = p.patch > 0.0 and np.floor((s.pose[AT_X] - p.patch_x) / p.patch_width) % 2 == 0
        if p.push_every_ms < n:
            _push(p, s, random)
        for _ in range(STEPS_PER_MS):
            _step(p, d, s, on_patch)
        _advance_pose(p, s)
        for w in range(2):
            if d.heated:
                _heat(p, d, s, w)
            _read_encoder(p, s, w, quantised, random)
        if row[ms]:
            _write_row(s, out, fetched)
            fetched += 1


@_compiled
def _derived(p: Physics) -> Derived:
    first, middle, last = np.empty(2), np.empty(2), np.empty(2)
    bristle_stiffness, bristle_damping = np.zeros(2), np.zeros(2)
    two_mass = p.gear_stiffness > 0.0
    slipping = p.grip > 0.0
    for w in range(2):
        rotor = p.inertia[w] * p.rotor_share[w]
        wheel = p.inertia[w] * p.wheel_share[w]
        first[w] = rotor
        middle[w] = wheel if two_mass else rotor + wheel
        last[w] = p.inertia[w] - rotor - wheel
        if not slipping:
            middle[w] = p.inertia[w] - rotor if two_mass else p.inertia[w]
        bristle_stiffness[w] = p.running[w] / p.bristle_rad
        bristle_damping[w] = 0.6 * np.sqrt(bristle_stiffness[w] * p.inertia[w])
    scrub_stiffness = p.scrub / (2.0 * p.bristle_rad)
    return Derived(
        two_mass,
        slipping,
        p.running[0] + p.running[1] + p.breakaway[0] + p.breakaway[1] > 0.0,
        p.heat_rate > 0.0,
        p.torque_constant * p.voltage / p.resistance,
        p.voltage / p.resistance,
        first,
        middle,
        last,
        bristle_stiffness,
        bristle_damping,
        scrub_stiffness,
        0.6 * np.sqrt(scrub_stiffness * p.inertia[0]),
        (p.inertia[0] * (1 - p.rotor_share[0] - p.wheel_share[0])) / p.radius**2 * 9.81,
    )


@_compiled
def _at_rest(p: Physics, random: np.random.Generator) -> State:
    phase = random.random(2)
    return State(
        angle1=np.zeros(2),
        angle2=np.zeros(2),
        speed1=np.zeros(2),
        speed2=np.zeros(2),
        ground=np.zeros(2),
        torque1=np.zeros(2),
        torque2=np.zeros(2),
        outer=np.zeros(2),
        inertia_factor=np.ones(2),
        current=np.zeros(2),
        command=np.zeros(2),
        lagged=np.zeros(2),
        held=np.zeros(2),
        deflection=np.zeros(2),
        scrub_deflection=np.zeros(1),
        screw_slips=np.zeros(2),
        warm=np.zeros(2),
        case=np.zeros(2),
        resistance=p.resistance.copy(),
        travel=np.zeros(2),
        measured=np.zeros(2),
        lost=np.zeros(2),
        phase=phase,
        whole=np.floor(phase),
        lost_whole=np.zeros(2),
        filtered=np.zeros(2),
        pose=np.zeros(4),
        battery=np.array([p.voltage, 0.0, 0.0, 0.0]),
        events=np.array([0.0, 0.0, 1.0]),
    )


@_part
def _start_run(d: Derived, s: State) -> None:
    """Stand still at the origin; heat, charge, angles and counts go on."""
    s.scrub_deflection[0] = 0.0
    s.battery[DRAWN] = 0.0
    s.events[TRIPPED_MS] = 0.0
    s.events[PUSHED_MS] = 0.0
    for k in range(4):
        s.pose[k] = 0.0
    for w in range(2):
        s.speed1[w] = 0.0
        s.speed2[w] = 0.0
        s.ground[w] = 0.0
        s.current[w] = 0.0
        s.lagged[w] = 0.0
        s.held[w] = 0.0
        s.deflection[w] = 0.0
        s.travel[w] = 0.0
        s.filtered[w] = 0.0
        s.screw_slips[w] = 0.0
        if d.two_mass:
            s.angle2[w] = s.angle1[w]


# ---- Once per millisecond, before the steps


@_part
def _trip(p: Physics, s: State, asked: float, random: np.random.Generator) -> None:
    """The supply may trip at high effort, and comes back."""
    if s.events[TRIPPED_MS] > 0.0:
        s.events[TRIPPED_MS] -= 1.0
    elif asked > p.brownout_effort and random.random() < p.brownout_rate * 1e-3:
        s.events[TRIPPED_MS] = p.brownout_ms


@_part
def _driver(p: Physics, s: State, w: int, ms: int, u: float) -> None:
    """The driver at 1 kHz: from commanded effort to what reaches the bridge."""
    zero = u == 0.0
    if p.hysteresis > 0.0:
        if u > s.held[w] + p.hysteresis:
            s.held[w] = u - p.hysteresis
        elif u < s.held[w] - p.hysteresis:
            s.held[w] = u + p.hysteresis
        u = s.held[w]
    if p.effort_power != 1.0:
        u = np.sign(u) * abs(u) ** p.effort_power
    if p.lag_s > 0.0:
        s.lagged[w] += (u - s.lagged[w]) * (1.0 - np.exp(-1e-3 / p.lag_s))
        u = s.lagged[w]
    if p.deadband > 0.0:
        u = np.sign(u) * max(abs(u) - p.deadband, 0.0)
    if u < 0.0:
        u *= p.reverse_supply[w]
    if p.hunting > 0.0 and not zero:
        u += p.hunting * np.sin(TWO_PI * p.hunting_hz * ms * 1e-3 + 1.3 * w)
    if ms >= p.jump_ms:
        u *= p.jump_factor
    if s.events[TRIPPED_MS] > 0.0:
        u = 0.0
    s.command[w] = u
    if zero and p.coast_brake < 1.0 and abs(s.lagged[w]) < 1e-3:
        s.command[w] = np.nan


@_part
def _slow_load(p: Physics, s: State, w: int, ms: int, load: float) -> None:
    """Disturbance, slope, tether and payload, held for the millisecond."""
    if p.slope_torque != 0.0:
        load -= p.slope_torque * np.cos(s.pose[AT_HEADING] - p.uphill)
    if p.tether > 0.0:
        x, y, heading = s.pose[AT_X], s.pose[AT_Y], s.pose[AT_HEADING]
        along = x * np.cos(heading) + y * np.sin(heading)
        away = np.sqrt(x * x + y * y)
        if away > p.tether_slack:
            load -= p.tether * (away - p.tether_slack) * (along / away) * p.radius / 2.0
    s.outer[w] = load
    s.inertia_factor[w] = 1.0
    if ms >= p.payload_ms:
        s.inertia_factor[w] = p.payload_ratio
    if s.speed2[w] < 0.0:
        s.inertia_factor[w] *= p.reverse_inertia
    if s.screw_slips[w] > 0.0:
        s.screw_slips[w] -= 1.0


@_part
def _push(p: Physics, s: State, random: np.random.Generator) -> None:
    """Somebody pushes the robot now and then."""
    if s.events[PUSHED_MS] > 0.0:
        s.events[PUSHED_MS] -= 1.0
        s.outer[0] += s.events[PUSH_SIGN] * p.push
        s.outer[1] += s.events[PUSH_SIGN] * p.push
    elif random.random() < 1.0 / p.push_every_ms:
        s.events[PUSHED_MS] = PUSH_MS
        s.events[PUSH_SIGN] = 1.0 if random.random() < 0.5 else -1.0


# ---- One step of 0.2 ms


@_inner
def _step(p: Physics, d: Derived, s: State, on_patch: bool) -> None:
    scrub_torque = _scrub(d, s, p.scrub) if p.scrub > 0.0 else 0.0
    s.battery[DRAWN_NOW] = 0.0
    for w in range(2):
        s.torque1[w] = _motor_torque(p, d, s, w)
        load = s.outer[w] - p.drag[w] * s.speed2[w] * abs(s.speed2[w])
        load -= scrub_torque if w == 0 else -scrub_torque
        if on_patch:
            load -= p.patch * np.tanh(s.speed2[w] / 0.1)
        s.torque2[w] = load
        if d.two_mass:
            _gear(p, d, s, w)
    if d.slipping:
        for w in range(2):
            _tyre(p, d, s, w)
    _accelerate(p, d, s)
    for w in range(2):
        s.angle2[w] += STEP_S * s.speed2[w]
        if d.two_mass:
            s.angle1[w] += STEP_S * s.speed1[w]
        else:
            s.speed1[w] = s.speed2[w]
            s.angle1[w] = s.angle2[w]
        s.travel[w] += STEP_S * s.ground[w] * p.radius * p.ground_scale[w]
    if p.source_ohm > 0.0 or p.charge_drop > 0.0:
        _discharge(p, s)


@_inner
def _scrub(d: Derived, s: State, level: float) -> float:
    """Dry friction of wheels that turn against each other, as one bristle; N m."""
    apart = s.speed2[0] - s.speed2[1]
    rate = d.scrub_stiffness / level * abs(apart)
    before = s.scrub_deflection[0]
    updated = (before + STEP_S * apart) / (1.0 + STEP_S * rate)
    s.scrub_deflection[0] = updated
    return d.scrub_stiffness * updated + d.scrub_damping * (updated - before) / STEP_S


@_inner
def _motor_torque(p: Physics, d: Derived, s: State, w: int) -> float:
    """Torque behind the motor's own losses, N m."""
    torque = p.torque_constant[w] * _current(p, d, s, w) - p.viscous[w] * s.speed1[w]
    if p.screw_torque < 1e6:
        if abs(torque) > p.screw_torque * d.stall[w] and s.screw_slips[w] <= 0.0:
            s.screw_slips[w] = SCREW_SLIPS_MS
        if s.screw_slips[w] > 0.0:
            torque *= p.screw_hold
    if p.ripple[w] != 0.0:
        turn = p.ripple_per_rev * s.angle1[w] + p.ripple_phase[w]
        torque += p.ripple[w] * (np.sin(turn) + 0.2 * np.sin(2.0 * turn + 1.0))
    if d.bristle and p.running[w] > 0.0:
        torque -= _bearing_friction(p, d, s, w)
    return torque


@_inner
def _current(p: Physics, d: Derived, s: State, w: int) -> float:
    """The winding's current after this step, A; what it draws is added to the battery's."""
    k = p.torque_constant[w]
    if np.isnan(s.command[w]):
        target = -p.coast_brake * k * s.speed1[w] / s.resistance[w]
        drive = 0.0
    else:
        drive = s.command[w]
        if p.speed_limit < 1e6:
            limit = p.speed_limit / p.top_mps
            rim = s.speed1[w] * p.radius / p.top_mps
            drive = min(drive, max(limit + 20.0 * (limit - rim), 0.0))
            drive = max(drive, min(-limit - 20.0 * (limit + rim), 0.0))
        target = (drive * s.battery[VOLTS] - k * s.speed1[w]) / s.resistance[w]
    highest = p.current_limit * d.stall_current[w]
    target = min(max(target, -highest), highest)
    s.current[w] += STEP_S / (p.electric_s[w] + STEP_S) * (target - s.current[w])
    s.battery[DRAWN_NOW] += drive * s.current[w]
    return s.current[w]


@_inner
def _bearing_friction(p: Physics, d: Derived, s: State, w: int) -> float:
    """Dry friction with a breakaway level, as a bristle; N m."""
    level = p.running[w]
    if p.breakaway[w] > level:
        slow = s.speed1[w] / p.stribeck_radps
        level += (p.breakaway[w] - level) * np.exp(-slow * slow)
    stiffness, before = d.bristle_stiffness[w], s.deflection[w]
    updated = (before + STEP_S * s.speed1[w]) / (1.0 + STEP_S * stiffness * abs(s.speed1[w]) / level)
    s.deflection[w] = updated
    return stiffness * updated + d.bristle_damping[w] * (updated - before) / STEP_S


@_inner
def _gear(p: Physics, d: Derived, s: State, w: int) -> None:
    """Elastic teeth with a gap: the motor's side takes a step, and `torque1` becomes the teeth's torque."""
    twist = s.angle1[w] - s.angle2[w]
    half = 0.5 * p.gap[w]
    contact = 0.0
    if twist > half:
        contact = p.gear_stiffness * (twist - half)
        contact += p.gear_damping * (s.speed1[w] - s.speed2[w])
        contact = max(contact, 0.0) if half > 0.0 else contact
    elif twist < -half:
        contact = p.gear_stiffness * (twist + half)
        contact += p.gear_damping * (s.speed1[w] - s.speed2[w])
        contact = min(contact, 0.0) if half > 0.0 else contact
    s.speed1[w] += STEP_S * (s.torque1[w] - contact) / d.first_inertia[w]
    s.torque1[w] = contact


@_inner
def _tyre(p: Physics, d: Derived, s: State, w: int) -> None:
    """A tyre that slips: the wheel takes a step, and the ground's force acts on the chassis."""
    over = p.slip_slope * (s.speed2[w] - s.ground[w]) / (abs(s.ground[w]) + 0.15 / p.radius)
    force = p.grip * d.normal * p.radius * np.tanh(over)
    s.speed2[w] += STEP_S * (s.torque1[w] - force) / d.middle_inertia[w]
    s.torque2[w] += force


@_inner
def _accelerate(p: Physics, d: Derived, s: State) -> None:
    """The chassis takes a step; through its mass and yaw inertia each wheel feels the other."""
    c = p.coupling
    raw0 = _uncoupled(p, d, s, 0)
    raw1 = _uncoupled(p, d, s, 1)
    rate0 = (raw0 - c * raw1) / (1.0 - c * c)
    rate1 = (raw1 - c * raw0) / (1.0 - c * c)
    if d.slipping:
        s.ground[0] += STEP_S * rate0
        s.ground[1] += STEP_S * rate1
    else:
        s.speed2[0] += STEP_S * rate0
        s.speed2[1] += STEP_S * rate1
        s.ground[0] = s.speed2[0]
        s.ground[1] = s.speed2[1]


@_inner
def _uncoupled(p: Physics, d: Derived, s: State, w: int) -> float:
    """Acceleration of one side alone, rad/s2."""
    inertia = d.last_inertia[w] if d.slipping else d.middle_inertia[w]
    torque = s.torque2[w] if d.slipping else s.torque1[w] + s.torque2[w]
    return torque / (inertia + (s.inertia_factor[w] - 1.0) * p.inertia[w])


@_inner
def _discharge(p: Physics, s: State) -> None:
    now = s.battery[DRAWN_NOW]
    s.battery[CHARGE] += STEP_S * now
    s.battery[DRAWN] += (now - s.battery[DRAWN]) * 0.2
    open_v = p.voltage * (1.0 - p.charge_drop * s.battery[CHARGE])
    s.battery[VOLTS] = open_v - p.source_ohm * s.battery[DRAWN]


# ---- Once per millisecond, after the steps


@_part
def _heat(p: Physics, d: Derived, s: State, w: int) -> None:
    """The winding warms, and its case."""
    ratio = s.current[w] / d.stall_current[w]
    flow = (s.warm[w] - s.case[w]) / p.winding_case_s
    s.warm[w] += 1e-3 * (p.heat_rate * ratio * ratio * (1.0 + s.warm[w]) - flow)
    s.case[w] += 1e-3 * (p.case_ratio * flow - s.case[w] / p.case_air_s)
    s.resistance[w] = p.resistance[w] * (1.0 + s.warm[w])


@_part
def _advance_pose(p: Physics, s: State) -> None:
    left = s.ground[0] * p.radius * p.ground_scale[0]
    right = s.ground[1] * p.radius * p.ground_scale[1]
    along = 0.5 * (left + right)
    yaw = (right - left) / (p.wheelbase * p.wheelbase_factor) + p.heading_drift * along
    along *= p.distance_scale
    heading = s.pose[AT_HEADING]
    s.pose[AT_X] += 1e-3 * along * np.cos(heading + 5e-4 * yaw)
    s.pose[AT_Y] += 1e-3 * along * np.sin(heading + 5e-4 * yaw)
    s.pose[AT_HEADING] += 1e-3 * yaw
    s.pose[AT_YAW_RATE] = yaw


@_part
def _read_encoder(p: Physics, s: State, w: int, quantised: bool, random: np.random.Generator) -> None:
    """Counts with eccentricity and losses, and the recorder's filtered speed."""
    per_rad = p.counts_per_rev[w] / TWO_PI
    seen = s.angle1[w]
    if p.eccentricity[w] != 0.0:
        wobble = np.sin(s.angle1[w] + p.eccentric_phase[w]) - np.sin(p.eccentric_phase[w])
        seen += p.eccentricity[w] * wobble
    change = seen - s.measured[w]
    s.measured[w] = seen
    loss = 0.0
    if p.lost_at_top[w] > 0.0:
        loss = min(p.lost_at_top[w] * abs(s.speed1[w]) * p.radius / p.top_mps, 1.0)
        s.lost[w] += loss * change
    now = np.floor(seen * per_rad + s.phase[w])
    step = now - s.whole[w]
    s.whole[w] = now
    if loss > 0.0:
        kept = _kept(step, loss, random)
        s.lost_whole[w] += step - kept
        step = kept
    if p.speed_filter_s > 0.0:
        per_ms = step / per_rad if quantised else change * (1.0 - loss)
        share = 1.0 - np.exp(-1e-3 / p.speed_filter_s)
        s.filtered[w] += share * (per_ms * p.radius * 1e3 - s.filtered[w])


@_part
def _kept(step: float, loss: float, random: np.random.Generator) -> float:
    """Counts that are not lost, each by itself at random."""
    kept = 0.0
    for _ in range(int(abs(step))):
        if random.random() >= loss:
            kept += 1.0
    return kept if step > 0 else -kept


@_part
def _write_row(s: State, out: Array, row: int) -> None:
    for w in range(2):
        out[row, ANGLE + w] = s.measured[w] - s.lost[w]
        out[row, TRAVEL + w] = s.travel[w]
        out[row, COUNTS + w] = s.whole[w] - s.lost_whole[w]
        out[row, FILTERED + w] = s.filtered[w]
        out[row, WARM + w] = s.warm[w]
    out[row, X] = s.pose[AT_X]
    out[row, Y] = s.pose[AT_Y]
    out[row, HEADING] = s.pose[AT_HEADING]
    out[row, YAW_RATE] = s.pose[AT_YAW_RATE]
    out[row, SUPPLY] = s.battery[VOLTS]
