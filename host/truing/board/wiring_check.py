"""The first power-up's check: which encoder belongs to which wheel, and what each motor lead does.

A hand turns each wheel once, which tells all about the encoders; then each motor turns its wheel by a little
effort, and the encoders, now known, tell all about the motors. Nobody has to judge what he sees.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from truing.board.device import Device
from truing.errors import Refused, TruingError
from truing_protocol import State

SIDES = ("left", "right")
FIRST_EFFORT, EFFORT_STEP, EFFORT_LIMIT = 0.05, 0.01, 0.30
"""A motor starts with 5 % and gets a per cent more until its wheel turns."""
_STEP_S = 0.05
_BELOW_STALL = 0.95
_SETTLE_S = 0.8
# Shares of a turn: what a hand's turn must make, what a motor's must, and how well a hand meets one turn.
_HAND_SHARE, _MOTOR_SHARE, _HAND_ERROR = 0.02, 0.01, 0.05
_MIN_COUNTS = 4


class Hand(Protocol):
    """Somebody who turns a wheel."""

    def turn(self, side: int) -> None:
        """Turn that wheel (0 left, 1 right) forward by one whole turn, and return when it is done."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is not as it should be.

    `parameter` is what `--fix` sets to `value`; None where wires or a number from a datasheet are meant.
    """

    name: str
    text: str
    change: str
    parameter: str | None = None
    value: float = 0.0


@dataclass(frozen=True, slots=True)
class Wheel:
    """What a hand's turn of a wheel has shown: which channel counted, and its counts for one turn."""

    channel: int | None
    counts: int


@dataclass(frozen=True, slots=True)
class Motor:
    """What a motor output did at which effort; channel None: no encoder counted."""

    effort: float
    channel: int | None
    counts: int


@dataclass(frozen=True, slots=True)
class CheckResult:
    """All that was seen, and what follows from it."""

    wheels: tuple[Wheel, Wheel]
    motors: tuple[Motor, Motor]
    findings: tuple[Finding, ...]


def check_robot(device: Device, hand: Hand, say: Callable[[str], None] = lambda _: None) -> CheckResult:
    """Find what is wired or set wrong; the wheels must be off the ground, or have a metre of floor.

    Raises
    ------
    TruingError : the board is not ready to move, or a wheel was not turned.
    """
    status = device.status()
    if status.state != State.IDLE:
        raise TruingError(
            f"the board is {status.state.name.lower()}, not idle",
            "`truing stop` ends what it does; `truing faults --clear` clears a latched fault",
        )
    per_turn = float(device.get_parameter("counts_per_rev").value)
    wheels: list[Wheel] = []
    for side in range(2):
        before = device.status().counts
        hand.turn(side)
        moved = _moved(before, device.status().counts)
        channel = _dominant(moved, max(_MIN_COUNTS, _HAND_SHARE * per_turn))
        wheels.append(Wheel(channel, moved[channel] if channel is not None else 0))
        say(f"{SIDES[side]} wheel turned by hand: left encoder {moved[0]:+d}, right {moved[1]:+d} counts")
    limit = min(EFFORT_LIMIT, _BELOW_STALL * float(device.get_parameter("stall_effort").value))
    motors = []
    for side in range(2):
        motor = _turn_by_motor(device, side, limit, max(_MIN_COUNTS, _MOTOR_SHARE * per_turn))
        motors.append(motor)
        what = "no encoder counted"
        if motor.channel is not None:
            what = f"{SIDES[motor.channel]} encoder {motor.counts:+d} counts"
        say(f"{SIDES[side]} motor output, {motor.effort:.0%} effort: {what}")
    seen = ((wheels[0], wheels[1]), (motors[0], motors[1]))
    return CheckResult(*seen, tuple(_findings(device, *seen, per_turn)))


def fix(device: Device, result: CheckResult) -> list[str]:
    """Set the parameters that the findings name, until the board is switched off; returns their names."""
    done = []
    for finding in result.findings:
        if finding.parameter is not None:
            device.set_parameter(finding.parameter, finding.value)
            done.append(finding.parameter)
    return done


def _turn_by_motor(device: Device, side: int, limit: float, enough: float) -> Motor:
    """Raise a motor's effort until an encoder counts, or up to the limit; then brake and wait for rest."""
    device.client.stream.sleep(_SETTLE_S)
    before = device.status().counts
    effort = FIRST_EFFORT
    channel = None
    moved = (0, 0)
    try:
        while channel is None and effort <= limit + 1e-9:
            device.set_effort(*((effort, 0.0) if side == 0 else (0.0, effort)))
            device.client.stream.sleep(_STEP_S)
            moved = _moved(before, device.status().counts)
            channel = _dominant(moved, enough)
            effort += EFFORT_STEP
    except Refused as refused:
        if refused.reason != "fault_latched":
            raise
    finally:
        device.stop()
    status = device.status()
    moved = _moved(before, status.counts)
    if f"encoder_{SIDES[side]}_reversed" in {fault.name for fault in status.latched}:
        # The board stops a wheel that turns against its effort after fewer counts than a finding takes.
        channel = side
    elif channel is None:
        channel = _dominant(moved, enough)
    device.client.stream.sleep(_SETTLE_S)
    if device.status().state == State.STOPPED:
        device.clear_faults()
    return Motor(effort - EFFORT_STEP, channel, 0 if channel is None else moved[channel])


def _moved(before: tuple[int, int], after: tuple[int, int]) -> tuple[int, int]:
    wrapped = [(b - a + 2**31) % 2**32 - 2**31 for a, b in zip(before, after, strict=True)]
    return wrapped[0], wrapped[1]


def _dominant(moved: tuple[int, int], enough: float) -> int | None:
    channel = 0 if abs(moved[0]) >= abs(moved[1]) else 1
    return channel if abs(moved[channel]) >= enough else None


def _findings(
    device: Device, wheels: tuple[Wheel, Wheel], motors: tuple[Motor, Motor], per_turn: float
) -> list[Finding]:
    found: list[Finding] = []
    encoders_swapped = (wheels[0].channel, wheels[1].channel) in ((1, 0), (1, None), (None, 0))
    if encoders_swapped:
        found.append(
            Finding(
                "encoders_swapped",
                "each wheel's turn is counted by the other wheel's encoder input",
                "exchange the encoders' plugs: left to PB4/PB5, right to PB6/PB7",
            )
        )
    for side, wheel in enumerate(wheels):
        found += _encoder_findings(device, side, wheel, per_turn, encoders_swapped)
    found += _motor_findings(device, wheels, motors)
    return found


def _encoder_findings(
    device: Device, side: int, wheel: Wheel, per_turn: float, swapped: bool
) -> list[Finding]:
    name = SIDES[side]
    if wheel.channel is None:
        text = f"the {name} wheel's turn was counted by no encoder"
        change = f"check the {name} encoder's plug, supply, ground, A and B (one phase alone counts nothing)"
        return [Finding(f"encoder_{name}_dead", text, change)]
    found = []
    if wheel.counts < 0:
        parameter = f"encoder_{name}_reversed"
        text = f"the {name} encoder counts down when its wheel rolls forward"
        change = f"exchange the {name} encoder's A and B, or set {parameter}"
        value = 1.0 - float(device.get_parameter(parameter).value)
        found.append(Finding(parameter, text, change, None if swapped else parameter, value))
    if abs(abs(wheel.counts) / per_turn - 1.0) > _HAND_ERROR:
        found.append(
            Finding(
                f"counts_per_rev_{name}",
                f"one turn of the {name} wheel made {abs(wheel.counts)} counts; "
                f"counts_per_rev is {per_turn:.0f}",
                "set counts_per_rev to 4 x lines x gear ratio of the datasheet, "
                f"about {abs(wheel.counts)}: `truing params set counts_per_rev {abs(wheel.counts)}`",
            )
        )
    return found


def _motor_findings(
    device: Device, wheels: tuple[Wheel, Wheel], motors: tuple[Motor, Motor]
) -> list[Finding]:
    by_channel = {wheel.channel: side for side, wheel in enumerate(wheels) if wheel.channel is not None}
    turned = [None if motor.channel is None else by_channel.get(motor.channel) for motor in motors]
    swapped = (turned[0], turned[1]) in ((1, 0), (1, None), (None, 0))
    found = []
    if swapped:
        found.append(
            Finding(
                "motors_swapped",
                "each motor output turns the other wheel",
                "exchange the motors' plugs: left bridge on PA8/PA9, right bridge on PA10/PA11",
            )
        )
    for side, motor in enumerate(motors):
        name, wheel = SIDES[side], turned[side]
        if wheel is None:
            # Without its encoder nobody can see a wheel turn; that the encoder is dead has been said.
            target = 1 - side if swapped else side
            if wheels[target].channel is not None:
                text = f"the {name} motor output turned no wheel up to {motor.effort:.0%} effort"
                change = (
                    "check the motors' supply, the bridge's wires and the plug; see that the wheel is free"
                )
                found.append(Finding(f"motor_{name}_dead", text, change))
            continue
        if (motor.counts < 0) != (wheels[wheel].counts < 0):
            parameter = f"motor_{name}_reversed"
            value = 1.0 - float(device.get_parameter(parameter).value)
            text = f"positive effort of the {name} motor output turns its wheel backwards"
            change = f"exchange that motor's leads, or set {parameter}"
            fixable = None if swapped else parameter
            found.append(Finding(parameter, text, change, fixable, value))
    return found


class Person:
    """Somebody at the terminal.

    Parameters
    ----------
    ask : shows a line and returns when Enter was pressed.
    """

    def __init__(self, ask: Callable[[str], None]) -> None:
        self._ask = ask

    def turn(self, side: int) -> None:
        """Ask for the turn."""
        self._ask(f"Turn the {SIDES[side]} wheel FORWARD by one whole turn, by hand; then press Enter")
        time.sleep(0.2)
