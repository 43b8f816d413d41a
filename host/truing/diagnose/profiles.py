"""A library of safe drives that excite what ordinary driving does not; most return to the start."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from truing.floor import MotionModel, estimate_floor
from truing.plan import MAX_SEGMENTS, Kind, Plan, Segment

# One level held for some time: seconds, left and right effort.
Step = tuple[float, float, float]

AMPLITUDES = (1.0, 0.6, 0.35)
# Below this a wheel may not break away, and the run would show nothing.
MIN_AMPLITUDE = 0.12
REST_S = 0.8
FAST_RATE_HZ = 100
# A half cycle shorter than this is lost between two ticks of a 1 ms controller and a 20 Hz log.
MIN_HALF_PERIOD_S = 0.06
# A robot that turns faster than this slides, tips, or winds up its cable.
MAX_TURN_RATE_RADPS = 8.0


@dataclass(frozen=True, slots=True)
class Limits:
    """What the robot and its floor allow.

    Attributes
    ----------
    effort : largest effort, 0 to 1.
    floor_m : how far the robot's centre may get from where it starts, m.
    longest_s : longest run, s.
    alike : both sides get the same effort: there is one axis, and nothing turns on a floor.
    """

    effort: float = 1.0
    floor_m: float = 4.0
    longest_s: float = 60.0
    alike: bool = False


@dataclass(frozen=True, slots=True)
class Robot:
    """What the profiles need to know: full-effort speed (m/s), time constant (s), wheelbase (m)."""

    gain_mps: float
    time_constant_s: float
    wheelbase_m: float = 0.3


@dataclass(frozen=True, slots=True)
class Profile:
    """One kind of drive.

    Attributes
    ----------
    shows : what it distinguishes, one sentence.
    build : amplitude (0 to 1) and robot to steps for the wheels together; `spin` turns on the spot.
    fast : also proposed at a higher log rate.
    spins : whether it makes sense on the spot too.
    """

    name: str
    title: str
    shows: str
    build: Callable[[float, Robot], list[Step]]
    fast: bool = False
    spins: bool = True


def candidate_plans(robot: Robot, limits: Limits, log_rate_hz: float) -> Iterator[tuple[Profile, Plan]]:
    """Every profile in every size that stays within the limits, as plans that `truing run` takes."""
    for profile in PROFILES:
        for spin in (False, True) if profile.spins and not limits.alike else (False,):
            fitted = 0
            for share in AMPLITUDES:
                amplitude = share * limits.effort
                steps = profile.build(max(amplitude, MIN_AMPLITUDE), robot)
                if spin:
                    steps = [(seconds, left, -right) for seconds, left, right in steps]
                for rate in _rates(profile, log_rate_hz):
                    plan = _plan(profile, steps, amplitude, spin, rate)
                    if plan is not None and _fits(plan, robot, limits):
                        fitted += 1
                        yield profile, plan
            if not fitted and not spin:
                # A fast robot on a small floor: shorter steps at the smallest amplitude.
                short = [(0.4 * seconds, a, b) for seconds, a, b in profile.build(MIN_AMPLITUDE, robot)]
                plan = _plan(profile, short, MIN_AMPLITUDE, spin, round(log_rate_hz))
                if plan is not None and _fits(plan, robot, limits):
                    yield profile, plan


def _rates(profile: Profile, log_rate_hz: float) -> tuple[int, ...]:
    usual = min(max(round(log_rate_hz), 1), 200)
    return (usual, FAST_RATE_HZ) if profile.fast and usual < FAST_RATE_HZ / 2 else (usual,)


def _plan(profile: Profile, steps: list[Step], amplitude: float, spin: bool, rate: int) -> Plan | None:
    segments = tuple(
        Segment(Kind.EFFORT, round(seconds, 3), round(left, 4), round(right, 4))
        for seconds, left, right in [(REST_S, 0.0, 0.0), *steps, (REST_S, 0.0, 0.0)]
    )
    if len(segments) > MAX_SEGMENTS:
        return None
    where = ", on the spot" if spin else ""
    title = f"{profile.title}, up to {100.0 * amplitude:.0f} % effort{where}"
    name = f"{profile.name}{'_spin' if spin else ''}_{100.0 * amplitude:.0f}"
    return Plan(f"{name}_{rate}hz" if rate == FAST_RATE_HZ else name, title, segments, rate)


def _fits(plan: Plan, robot: Robot, limits: Limits) -> bool:
    if plan.duration_s > limits.longest_s:
        return False
    if limits.alike and any(segment.a != segment.b for segment in plan.segments):
        return False
    model = MotionModel(robot.gain_mps, robot.gain_mps, robot.time_constant_s, robot.wheelbase_m)
    need = estimate_floor(plan, model)
    apart = max(abs(segment.b - segment.a) for segment in plan.segments)
    slow = apart * robot.gain_mps / robot.wheelbase_m <= MAX_TURN_RATE_RADPS
    return slow and need.radius_m <= limits.floor_m


def _both(seconds: float, effort: float) -> Step:
    return seconds, effort, effort


def _settle(robot: Robot) -> float:
    """Time that a step takes to show where it ends, s."""
    return min(max(3.0 * robot.time_constant_s, 0.5), 2.0)


def _reversal(amplitude: float, robot: Robot) -> list[Step]:
    hold = _settle(robot)
    return [
        _both(hold, 0.5 * amplitude),
        _both(hold, amplitude),
        _both(2.0 * hold, -amplitude),
        _both(hold, 0.5 * amplitude),
        _both(hold, -0.5 * amplitude),
        _both(hold, 0.5 * amplitude),
    ]


def _chirp(amplitude: float, robot: Robot) -> list[Step]:
    """Square waves from slow to 8 Hz: a delay and a lag differ at high frequencies."""
    half, steps = min(_settle(robot), 0.8), []
    sign = 1.0
    while half > MIN_HALF_PERIOD_S:
        steps += [_both(half, sign * amplitude), _both(half, -sign * amplitude)]
        half *= 0.85
    return [*steps, *steps[::-1]] if len(steps) < MAX_SEGMENTS // 4 else steps


def _ramps(amplitude: float, robot: Robot) -> list[Step]:
    """So slow that the wheels are always settled, several times through zero."""
    del robot
    top, count, hold = max(0.3 * amplitude, 0.1), 15, 0.15
    levels = [top * k / count for k in [*range(1, count + 1), *range(count - 1, -1, -1)]]
    way = [_both(hold, level) for level in levels]
    back = [_both(hold, -level) for level in levels]
    return [*way, *back, *way, *back]


def _coast(amplitude: float, robot: Robot) -> list[Step]:
    hold = _settle(robot)
    steps = []
    for level in (amplitude, -amplitude, 0.5 * amplitude, -0.5 * amplitude):
        steps += [_both(hold, level), _both(hold, 0.0)]
    return steps


def _staircase(amplitude: float, robot: Robot) -> list[Step]:
    """Every level forward and back, up to the top."""
    hold, steps = _settle(robot), []
    for k in range(1, 7):
        level = amplitude * k / 6.0
        steps += [_both(hold, level), _both(hold, -level)]
    return steps


def _load_rest(amplitude: float, robot: Robot) -> list[Step]:
    """Load, rest, the same load again: heating recovers at rest, discharge does not."""
    hold = _settle(robot)
    pairs = max(round(12.0 / (2.0 * hold)), 1)
    work = [_both(hold, sign * amplitude) for _ in range(pairs) for sign in (1.0, -1.0)]
    return [*work, _both(14.0, 0.0), *work]


def _one_against_both(amplitude: float, robot: Robot) -> list[Step]:
    hold = _settle(robot)
    steps: list[Step] = []
    for sign in (1.0, -1.0):
        u = sign * amplitude
        steps += [(hold, u, 0.0), (hold, u, u), (hold, 0.0, u), (hold, u, 0.0), (0.5 * hold, 0.0, 0.0)]
    return steps


def _creep(amplitude: float, robot: Robot) -> list[Step]:
    """Slowly enough for a log to see every period of what repeats with the wheel's angle."""
    del robot
    steps = []
    for level in (0.25, 0.35, 0.5):
        u = min(level * amplitude, 0.25)
        steps += [_both(4.0, u), _both(4.0, -u)]
    return steps


def _half_turn(amplitude: float, robot: Robot) -> list[Step]:
    """The same stretch of floor in both headings."""
    hold = _settle(robot)
    turn = min(0.4, max(amplitude, 0.2))
    seconds = math.pi * robot.wheelbase_m / (2.0 * turn * robot.gain_mps) + robot.time_constant_s
    there = [_both(hold, amplitude), _both(hold, -amplitude), _both(0.5 * hold, 0.0)]
    return [*there, (seconds, turn, -turn), _both(0.5 * hold, 0.0), *there]


def _full_reversal(amplitude: float, robot: Robot) -> list[Step]:
    """The largest accelerations that the motors can be asked for."""
    hold = min(max(1.5 * robot.time_constant_s, 0.3), 1.0)
    steps = [_both(hold, amplitude)]
    for _ in range(3):
        steps += [_both(2.0 * hold, -amplitude), _both(2.0 * hold, amplitude)]
    return [*steps, _both(hold, -amplitude)]


PROFILES: tuple[Profile, ...] = (
    Profile(
        "reversals", "Steps in one direction and reversals",
        "backlash or breakaway acts at reversals only, a delay at every step", _reversal, fast=True,
    ),
    Profile(
        "chirp", "Square waves from slow to 8 Hz",
        "a pure delay keeps the shape of the response, a lag attenuates it", _chirp, fast=True,
    ),
    Profile(
        "ramps", "Slow ramps through zero",
        "the efforts at breakaway and at the stop separate breakaway from running friction", _ramps,
    ),
    Profile(
        "coast_down", "Steps and letting go",
        "dry friction stops a wheel in finite time; with a dead band or drag it decays exponentially", _coast,
    ),
    Profile(
        "staircase", "Every level to the top, both ways",
        "a limit is flat above its level, drag bends the whole curve, friction shifts it", _staircase,
    ),
    Profile(
        "load_rest_repeat", "Load, rest, the same load again",
        "heat recovers at rest, charge does not", _load_rest,
    ),
    Profile(
        "one_and_both", "One wheel, both, the other",
        "a sagging supply and a shared chassis let one wheel's work show on the other at once",
        _one_against_both,
    ),
    Profile(
        "creep", "Creeping at low levels",
        "what repeats with the wheel's angle shows period by period", _creep,
    ),
    Profile(
        "half_turn", "The same steps before and after half a turn",
        "a slope changes its sign with the heading, an asymmetry of the motors does not", _half_turn,
        spins=False,
    ),
    Profile(
        "full_reversals", "Full-effort reversals",
        "limits of current and of grip show when the motors are asked for most", _full_reversal, fast=True,
    ),
)  # fmt: skip
