"""What a column of a foreign table holds, guessed from its name, its unit and its numbers."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from truing.arrays import FloatArray

from .text_table import TextTable

Kind: TypeAlias = Literal[
    "time", "effort", "battery", "ticks", "pos", "vel", "gyro", "x", "y", "heading", "split", "other"
]
BARS = "▁▂▃▄▅▆▇█"
SPARK_WIDTH = 24
# A supply of this is no volts.
LEAST_MILLIVOLTS = 1000.0

# In this order: a battery's voltage is no effort.
_SPELLED: dict[Kind, str] = {
    "battery": "battery batt bat vbat vbatt supply vin vbus",
    "gyro": "gyro gz gyroz wz yawrate",
    "ticks": "enc encoder encoders tick ticks count counts pulses cnt",
    "vel": "vel velocity speed spd rpm radps mps omega",
    "pos": "pos position dist distance travel angle q qm",
    "effort": "effort pwm duty dutycycle throttle volt volts voltage applied cmd command u input power out "
    "output motor torque drive current iq amps ampere",
    "time": "t time timestamp stamp sec secs seconds ms millis us micros date datetime clock",
}
_WORDS = {kind: frozenset(words.split()) for kind, words in _SPELLED.items()}
_OUTSIDE = frozenset(
    ["truth", "mocap", "vicon", "optitrack", "gps", "uwb", "camera", "cam", "gt", "ref", "tracker"]
)
# What a controller asks for, where the same table has what was measured.
_ASKED = frozenset(["setpoint", "target", "desired", "goal", "reference", "cmd", "command", "commanded"])
# A value of an estimator is no count, whatever else its name says: ODrive's `encoder.pos_estimate`.
_ESTIMATED = frozenset(["pos", "vel", "position", "velocity", "speed"])
_POSE: dict[str, Kind] = {
    "x": "x", "y": "y", "theta": "heading", "yaw": "heading", "heading": "heading", "orientation": "heading",
}  # fmt: skip
_SIDES = {
    word: side
    for side, known in {
        "left": "l left lft lh links gauche izquierda",
        "right": "r right rgt rh rechts droite",
    }.items()
    for word in known.split()
}
_UNIT_IN_NAME = re.compile(r"[\[(]([^\])]*)[\])]")
_UNITS = {
    "s": "s", "sec": "s", "ms": "ms", "us": "us", "µs": "us", "ns": "ns", "v": "V", "volt": "V", "volts": "V",
    "mv": "mV", "%": "%", "pct": "%", "percent": "%", "rpm": "rpm", "radps": "rad/s", "rad/s": "rad/s",
    "mps": "m/s", "m/s": "m/s", "mm/s": "mm/s", "mmps": "mm/s", "cm/s": "cm/s", "cmps": "cm/s", "m": "m",
    "mm": "mm", "cm": "cm", "rad": "rad", "deg": "deg", "°": "deg", "deg/s": "deg/s", "dps": "deg/s",
    "degps": "deg/s", "rot": "rot", "turns": "rot", "turn": "rot", "rev": "rot", "turns/s": "rot/s",
    "rps": "rot/s", "rev/s": "rot/s", "millis": "ms", "micros": "us", "voltage": "V", "secs": "s",
}  # fmt: skip
# Units that a name's last word may say; single letters there say other things.
_LAST_WORDS = frozenset(_UNITS) - {"v", "m", "volt", "volts"} | {"V"}


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table.

    Attributes
    ----------
    side : `left`, `right`, or empty.
    unit : as the file says it in one way or another, or empty.
    outside : the name says that it was measured from outside the robot.
    """

    name: str
    kind: Kind
    side: str
    unit: str
    low: float
    high: float
    missing: int
    spark: str
    outside: bool = False


def guess_columns(table: TextTable) -> list[Column]:
    """A guess for every column, in the order of the table."""
    guessed = [_guess(name, values, table) for name, values in table.numbers.items()]
    if not any(column.kind == "time" for column in guessed):
        guessed = _by_shape(guessed, table)
    texts = [
        Column(name, "split" if _is_split(cells) else "other", "", "", np.nan, np.nan, 0, "")
        for name, cells in table.texts.items()
    ]
    return guessed + texts


def words(name: str) -> list[str]:
    """The words of a column's name in small letters: `leftEncoder_cnt [1]` has left, encoder, cnt."""
    plain = _UNIT_IN_NAME.sub(" ", name)
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", plain)
    return [word.lower() for word in re.split(r"[^A-Za-z°µ%]+", spaced) if word]


def sparkline(values: FloatArray, width: int = SPARK_WIDTH) -> str:
    """Values as a row of bars; a dot where there are none."""
    finite = np.isfinite(values)
    if not finite.any():
        return ""
    low, high = float(values[finite].min()), float(values[finite].max())
    shown = []
    for part in np.array_split(values, min(width, len(values))):
        seen = part[np.isfinite(part)]
        if seen.size == 0:
            shown.append("·")
            continue
        share = (float(seen.mean()) - low) / (high - low) if high > low else 0.0
        shown.append(BARS[min(int(share * len(BARS)), len(BARS) - 1)])
    return "".join(shown)


def _guess(name: str, values: FloatArray, table: TextTable) -> Column:
    found = words(name)
    side = next((_SIDES[word] for word in found if word in _SIDES), "")
    outside = bool(_OUTSIDE & set(found))
    kind: Kind = next((kind for kind, known in _WORDS.items() if known & set(found)), "other")
    if kind == "ticks" and _ESTIMATED & set(found):
        kind = "vel" if _WORDS["vel"] & set(found) else "pos"
    if kind in ("pos", "vel") and _ASKED & set(found):
        kind = "other"
    pose = next((_POSE[word] for word in found if word in _POSE), None)
    if pose is not None and not side and kind in ("other", "pos"):
        kind = pose
    if kind == "other" and found in (["v"], ["w"]):
        kind = "vel"
    finite = values[np.isfinite(values)]
    if name in table.iso or (kind == "time" and not _increases(finite)):
        kind = "time" if name in table.iso else "other"
    unit = _unit(name, found, table, kind)
    if kind == "time" and name in table.iso:
        unit = "s"
    if not unit and "odrive" in found and kind in ("pos", "vel"):
        unit = "rot" if kind == "pos" else "rot/s"
    if kind == "battery" and unit in ("", "V") and finite.size and finite.min() > LEAST_MILLIVOLTS:
        unit = "mV"
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (np.nan, np.nan)
    return Column(name, kind, side, unit, low, high, len(values) - finite.size, sparkline(values), outside)


def _unit(name: str, found: list[str], table: TextTable, kind: Kind) -> str:
    bracket = _UNIT_IN_NAME.search(name)
    said = table.units.get(name, "") or (bracket.group(1) if bracket else "")
    if said:
        return _UNITS.get(said.strip().lower(), said.strip())
    last = found[-1] if found else ""
    if kind in ("effort", "battery") and (last == "v" or {"volt", "volts", "voltage"} & set(found)):
        return "V"
    if kind == "effort" and {"current", "iq", "amps", "ampere"} & set(found):
        return "A"
    if last in _LAST_WORDS:
        return _UNITS[last]
    return next((_UNITS[word] for word in found if word in ("rpm", "percent", "pct", "ms", "us")), "")


def _increases(values: FloatArray) -> bool:
    steps = np.diff(values)
    return bool(values.size > 2 and np.all(steps >= 0.0) and steps.any())


def _is_split(cells: tuple[str, ...]) -> bool:
    """Whether text names stretches of rows: few words, each of them in long runs."""
    changes = sum(a != b for a, b in itertools.pairwise(cells))
    return len(set(cells)) > 1 and changes <= len(cells) / 20


def _by_shape(columns: list[Column], table: TextTable) -> list[Column]:
    """Guesses for a table whose names say nothing: what increases steadily is time, what stands still in
    steps is effort, what counts in whole numbers is an encoder; left comes before right.
    """
    values = [table.numbers[column.name] for column in columns]
    rising = [k for k, one in enumerate(values) if _increases(one[np.isfinite(one)])]
    if not rising:
        return columns
    spread = {k: _unevenness(values[k]) for k in rising}
    time = min(spread, key=lambda k: (round(spread[k], 2), k))
    rest = [k for k in range(len(columns)) if k != time and columns[k].kind == "other"]
    still = {k: float(np.mean(np.diff(values[k]) == 0.0)) for k in rest}
    count = 2 if len(rest) >= 4 else 1
    efforts = sorted(sorted(rest, key=lambda k: -still[k])[:count]) if len(rest) >= 2 else []
    motion = [k for k in rest if k not in efforts][:count]
    found = list(columns)
    found[time] = replace(columns[time], kind="time", side="", outside=False)
    groups: tuple[tuple[list[int], Kind | None], ...] = ((efforts, "effort"), (motion, None))
    for group, kind in groups:
        for place, k in enumerate(group):
            side = ("left", "right")[place] if count == 2 else ""
            seen = values[k][np.isfinite(values[k])]
            whole = bool(np.all(np.round(seen) == seen))
            guess: Kind = kind or ("ticks" if whole else "vel")
            found[k] = replace(columns[k], kind=guess, side=side, outside=False)
    return found


def _unevenness(values: FloatArray) -> float:
    """Deviation of the steps over their mean: a clock has steady steps."""
    steps = np.diff(values[np.isfinite(values)])
    return float(np.std(steps)) / max(float(np.mean(steps)), 1e-300)
