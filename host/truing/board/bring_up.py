"""The steps of a board's bring-up: what is measured in each, by whom, and what is right.

`docs/BRINGUP.md` says how; a test keeps the page and this list together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from truing.board.device import Device
from truing.board.wiring_check import CheckResult
from truing.progress import Progress
from truing_protocol import CanBusState, CanStateRequest, StatusRequest

Value: TypeAlias = float | str
Readings: TypeAlias = dict[str, dict[str, Value]]

BOARD = "the board"
SKIPPED = "skip"
"""What stands in a field that does not concern this board."""

_LINK_REQUESTS = 500
_CLOCK_S = 5.0
_REST_S = 2.0


@dataclass(frozen=True, slots=True)
class Measurement:
    """One value of the form.

    `low` and `high` are the limits of a number (None: any), `words` what a word may be. `by` is who or what
    measures it: the board itself, or a person with the instrument that is named.
    """

    name: str
    unit: str
    by: str
    low: float | None = None
    high: float | None = None
    words: tuple[str, ...] = ()
    optional: bool = False

    @property
    def wanted(self) -> str:
        """What is right, in words."""
        if self.words:
            return " or ".join(self.words)
        if self.low is None and self.high is None:
            return "any"
        if self.low is None:
            return f"at most {self.high:g} {self.unit}".rstrip()
        if self.high is None:
            return f"at least {self.low:g} {self.unit}".rstrip()
        return f"{self.low:g} to {self.high:g} {self.unit}".rstrip()

    def problem(self, value: Value) -> str | None:
        """Why this value cannot stand here or is not right; None where it is."""
        if value == SKIPPED and self.optional:
            return None
        if self.words:
            return None if value in self.words else f"{value} where {self.wanted} is right"
        if isinstance(value, str):
            return f'"{value}" is no number'
        right = (self.low is None or value >= self.low) and (self.high is None or value <= self.high)
        return None if right else f"{value:g} where {self.wanted} is right"


@dataclass(frozen=True, slots=True)
class Step:
    """One step: its name in the form, its title on the page, and its measurements."""

    name: str
    title: str
    measurements: tuple[Measurement, ...]


def _yes(name: str, by: str, *, optional: bool = False) -> Measurement:
    return Measurement(name, "", by, words=("yes",), optional=optional)


STEPS: tuple[Step, ...] = (
    Step(
        "power",
        "Logic alone",
        (
            Measurement("supply_3v3", "V", "meter at the 3.3 V pin", 3.20, 3.40),
            Measurement("supply_ripple", "mV", "scope, peak to peak", None, 100.0),
            Measurement("bridge_inputs_in_reset", "V", "meter, PA8 to PA11, reset held", None, 0.3),
        ),
    ),
    Step(
        "program",
        "Flash the image",
        (
            _yes("flashed_and_verified", "truing flash"),
            Measurement("led", "Hz", "count of 10 s", 0.95, 1.05),
        ),
    ),
    Step(
        "start",
        "What the board says of its start",
        (
            Measurement("clock_source", "", BOARD, words=("crystal_pll",)),
            Measurement("faults", "", BOARD, words=("none",)),
        ),
    ),
    Step(
        "serial_line",
        "The serial line",
        (
            Measurement("ten_bits", "us", "scope, PB10", 10.80, 11.10),
            Measurement("requests_repeated", "", BOARD, None, 0.0),
            Measurement("frames_damaged", "", BOARD, None, 0.0),
            Measurement("round_trip", "ms", BOARD, None, 20.0),
        ),
    ),
    Step(
        "clock",
        "The clock",
        (Measurement("drift", "ppm", BOARD, -150.0, 150.0),),
    ),
    Step(
        "battery",
        "The battery divider",
        (
            Measurement("battery_by_meter", "V", "meter at the bridges' supply", 5.0, 36.0),
            Measurement("battery_by_board", "V", BOARD, 5.0, 36.0),
        ),
    ),
    Step(
        "bridges",
        "The bridges at rest",
        (
            Measurement("bridge_inputs_idle", "V", "scope, PA8 to PA11", 3.0, 3.4),
            Measurement("counts_at_rest", "", BOARD, None, 1.0),
        ),
    ),
    Step(
        "encoders",
        "The encoders' signals",
        (
            Measurement("encoder_low", "V", "scope, PB4 to PB7", None, 0.8),
            Measurement("encoder_high", "V", "scope, PB4 to PB7", 2.4, 3.6),
            Measurement("encoder_edge", "us", "scope, 10 to 90 %, the slower edge", None, 10.0),
        ),
    ),
    Step(
        "wiring",
        "Motors, encoders, counts",
        (
            Measurement("findings", "", BOARD, words=("none",)),
            Measurement("counts_left", "", BOARD),
            Measurement("counts_right", "", BOARD),
            Measurement("effort_left", "", BOARD, None, 0.24),
            Measurement("effort_right", "", BOARD, None, 0.24),
        ),
    ),
    Step(
        "pwm",
        "The PWM",
        (
            Measurement("frequency", "kHz", "scope, PA9", 19.99, 20.01),
            Measurement("high_share", "%", "scope, PA9 at effort 0.25", 74.5, 75.5),
            Measurement("other_input", "V", "scope, PA8, constant", 3.0, 3.4),
        ),
    ),
    Step(
        "stop",
        "The stop",
        (Measurement("stop_to_brake", "ms", "scope, PB11 to PA9", None, 2.0),),
    ),
    Step(
        "emergency_stop",
        "The emergency stop",
        (
            Measurement("contact_to_brake", "ms", "scope, PB12 to PA9", None, 1.0, optional=True),
            _yes("latched_and_named", "truing faults", optional=True),
            Measurement("contact_to_enable", "ms", "scope, PB12 to PC6", None, 1.0, optional=True),
        ),
    ),
    Step(
        "lost_host",
        "A host that is lost",
        (Measurement("unplugged_to_brake", "s", "scope or watch", None, 0.7),),
    ),
    Step(
        "hung_program",
        "A core that stands still",
        (_yes("halted_core_brakes", "scope, PA8 to PA11", optional=True),),
    ),
    Step(
        "supply_sag",
        "A sag of the logic's supply",
        (
            Measurement("brakes_at", "V", "meter, 3.3 V lowered", 2.85, 2.99, optional=True),
            Measurement("resets_at", "V", "meter, 3.3 V lowered", 2.75, 2.88, optional=True),
        ),
    ),
    Step(
        "can",
        "The CAN bus",
        (
            Measurement("termination", "ohm", "meter, power off", 57.0, 63.0, optional=True),
            Measurement("bit", "us", "scope, 1 Mbit/s", 0.995, 1.005, optional=True),
            Measurement("bus_state", "", BOARD, words=("active", "joining", "passive"), optional=True),
        ),
    ),
    Step(
        "floor",
        "On the floor",
        (
            Measurement("distance_by_tape", "m", "tape", 0.1, 20.0),
            Measurement("distance_by_odometry", "m", "truing step", 0.1, 20.0),
        ),
    ),
)

AGREEMENTS: tuple[tuple[str, str, str, float], ...] = (
    ("battery", "battery_by_board", "battery_by_meter", 0.025),
    ("floor", "distance_by_odometry", "distance_by_tape", 0.03),
)
"""Step, a measurement, another of that step, and by what share of this one the two may differ."""


def read_board(device: Device, progress: Progress | None = None) -> Readings:
    """What the board knows by itself; nothing moves. Takes some ten seconds."""
    status = device.status()
    names = sorted({fault.name for fault in (*status.active, *status.latched)})
    readings: Readings = {
        "start": {"clock_source": device.info.clock_source, "faults": " ".join(names) or "none"},
        "serial_line": _read_link(device),
        "can": {"bus_state": _bus_state(device)},
    }
    if status.battery_v is not None:
        readings["battery"] = {"battery_by_board": round(status.battery_v, 3)}
    before = device.status().counts
    device.client.stream.sleep(_REST_S)
    after = device.status().counts
    readings["bridges"] = {
        "counts_at_rest": float(max(abs(b - a) for a, b in zip(before, after, strict=True)))
    }
    relation, _ = device.clock(_CLOCK_S, progress)
    readings["clock"] = {"drift": round(relation.drift_ppm, 2)}
    return readings


def read_wiring(result: CheckResult) -> Readings:
    """What the check of the wiring has shown."""
    wiring: dict[str, Value] = {"findings": " ".join(finding.name for finding in result.findings) or "none"}
    for side, wheel, motor in zip(("left", "right"), result.wheels, result.motors, strict=True):
        wiring[f"counts_{side}"] = float(abs(wheel.counts))
        wiring[f"effort_{side}"] = round(motor.effort, 3)
    return {"wiring": wiring}


def problems(values: Mapping[str, Mapping[str, Value]]) -> dict[str, str]:
    """What is not as it should be, by `step.measurement`; a value that is not there is no problem."""
    found: dict[str, str] = {}
    for step in STEPS:
        for one in step.measurements:
            value = values.get(step.name, {}).get(one.name)
            problem = None if value is None else one.problem(value)
            if problem is not None:
                found[f"{step.name}.{one.name}"] = problem
    for step_name, name, other, share in AGREEMENTS:
        pair = [values.get(step_name, {}).get(key) for key in (name, other)]
        if all(isinstance(value, float) for value in pair):
            seen, true = (float(value) for value in pair if value is not None)
            if abs(seen - true) > share * abs(true):
                found.setdefault(
                    f"{step_name}.{name}", f"{seen:g} beside {true:g} of {other}: more than {share:.1%} apart"
                )
    return found


def empty(values: Mapping[str, Mapping[str, Value]], steps: Sequence[Step] = STEPS) -> list[str]:
    """What has not been measured yet, by `step.measurement`, in the order of the steps."""
    return [
        f"{step.name}.{one.name}"
        for step in steps
        for one in step.measurements
        if values.get(step.name, {}).get(one.name) is None
    ]


def _read_link(device: Device) -> dict[str, Value]:
    stream, counts = device.client.stream, device.client.counts
    dropped, repeated = device.status().frames_dropped + device.client.frames_dropped, counts.retries
    took = []
    for _ in range(_LINK_REQUESTS):
        began = stream.now_s()
        device.client.request(StatusRequest())
        took.append(stream.now_s() - began)
    return {
        "requests_repeated": float(counts.retries - repeated),
        "frames_damaged": float(device.status().frames_dropped + device.client.frames_dropped - dropped),
        "round_trip": round(1e3 * sorted(took)[_LINK_REQUESTS // 2], 3),
    }


def _bus_state(device: Device) -> str:
    return CanBusState(device.client.request(CanStateRequest()).bus_state).name.lower()
