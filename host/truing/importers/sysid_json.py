"""WPILib SysId and its forerunner frc-characterization: one JSON object with a list of rows per test.

Rows of a drive have 10 numbers (2020) or 9, those of one mechanism 6 or 4; the file itself names no column.
"""

from __future__ import annotations

import gzip
import json
import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import RecordingError

from .foreign import Finding, ForeignTest, ImportOptions

KIND = "WPILib SysId JSON"

SPIN = "track-width"
TESTS = ("slow-forward", "slow-backward", "fast-forward", "fast-backward", SPIN)

GZIP = b"\x1f\x8b"
# Columns by the width of a row: frc-characterization of 2020 and SysId, a drive and one mechanism each.
LAYOUTS: dict[int, tuple[str, ...]] = {
    10: (
        *("time", "battery", "command", "voltage left", "voltage right"),
        *("position left", "position right", "speed left", "speed right", "gyro angle"),
    ),
    9: (
        *("time", "voltage left", "voltage right", "position left", "position right"),
        *("speed left", "speed right", "gyro angle", "gyro rate"),
    ),
    6: ("time", "battery", "command", "voltage", "position", "speed"),
    4: ("time", "voltage", "position", "speed"),
}
ONE_MECHANISM = (4, 6)
METRES_PER_UNIT = {"meters": 1.0, "feet": 0.3048, "inches": 0.0254}


def matches(path: Path, head: bytes) -> bool:
    """Whether this looks like one of our files: JSON, gzipped or not, that names a test."""
    if head[:2] == GZIP:
        return path.name.lower().endswith(".json.gz")
    return head.lstrip()[:1] == b"{" and path.suffix.lower() == ".json"


def read(path: Path, options: ImportOptions) -> tuple[list[ForeignTest], list[Finding]]:
    """Every test of the file; RecordingError names the test and row that is wrong."""
    data = _load(path)
    tests, findings = [], []
    per_unit, unit_finding = _metres_per_unit(data, options)
    findings.append(unit_finding)
    for name in TESTS:
        if not data.get(name):
            continue
        if name == SPIN and not options.spins:
            text = (
                f"test {SPIN} is left out: tyres twisted on the spot rub more; truing import --spins keeps it"
            )
            findings.append(Finding("spin_left_out", text))
            continue
        rows = _rows(path, name, data[name])
        tests.append(_test(name.replace("-", "_"), rows, per_unit))
        if rows.shape[1] in ONE_MECHANISM:
            text = "one mechanism, not a drive: the same numbers stand on both sides"
            findings.append(Finding("single_mechanism", text, name.replace("-", "_")))
    if not tests:
        known = ", ".join(TESTS)
        raise RecordingError(
            path, f"no test with rows; looked for {known}", next_step="Export the whole data file"
        )
    return tests, findings


def _load(path: Path) -> dict[str, Any]:
    try:
        raw = path.read_bytes()
        text = gzip.decompress(raw) if raw[:2] == GZIP else raw
        data = json.loads(text)
    except (OSError, EOFError, zlib.error) as error:
        raise RecordingError(path, f"cannot be unpacked, perhaps cut off: {error}") from None
    except (ValueError, RecursionError) as error:
        raise RecordingError(path, f"not readable as JSON: {error}") from None
    if not isinstance(data, dict):
        raise RecordingError(path, "not a SysId file: the JSON is not an object")
    return data


def _metres_per_unit(data: dict[str, Any], options: ImportOptions) -> tuple[float, Finding]:
    """SysId writes `units` and `unitsPerRotation`; its rows hold rotations. The forerunner writes neither."""
    if options.metres_per_unit is not None:
        text = f"positions scaled by {options.metres_per_unit:g} m per unit, as asked"
        return options.metres_per_unit, Finding("position_unit", text, corrected=True)
    unit, per_rotation = str(data.get("units", "")).lower(), data.get("unitsPerRotation")
    if unit not in METRES_PER_UNIT:
        known = f"the file says {unit!r}" if unit else "the file does not say"
        text = f"positions are taken as metres: {known}; truing import --metres-per-unit scales them"
        return 1.0, Finding("position_unit", text)
    text = (
        f"positions are taken as {unit}; the file's {per_rotation} units per rotation are not applied, since "
        "programs differ in whether they send rotations or units; truing import --metres-per-unit scales them"
    )
    return METRES_PER_UNIT[unit], Finding("position_unit", text)


def _rows(path: Path, name: str, raw: Any) -> FloatArray:
    """The rows of one test, shape (rows, columns); all of one known width and all finite numbers."""
    if not isinstance(raw, list) or not all(isinstance(row, list) for row in raw):
        raise RecordingError(path, f"test {name!r} is not a list of rows")
    width = len(raw[0])
    if width not in LAYOUTS:
        raise RecordingError(
            path, f"test {name!r}: rows of {width} numbers; 10 or 9 (a drive), 6 or 4 (a mechanism) are due"
        )
    for number, row in enumerate(raw, start=1):
        if len(row) != width:
            raise RecordingError(
                path, f"test {name!r}, its row {number}: {len(row)} numbers where the first row has {width}"
            )
        for column, value in zip(LAYOUTS[width], row, strict=True):
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
                raise RecordingError(
                    path, f"test {name!r}, its row {number}, {column}: {value!r} is not a finite number"
                )
    return np.array(raw, dtype=np.float64)


def _test(name: str, rows: FloatArray, per_unit: float) -> ForeignTest:
    c = dict(zip(LAYOUTS[rows.shape[1]], rows.T.copy(), strict=True))

    def both(left: str, right: str, alone: str) -> FloatArray:
        return np.array([c[left], c[right]] if left in c else [c[alone], c[alone]])

    return ForeignTest(
        name,
        c["time"],
        volts=both("voltage left", "voltage right", "voltage"),
        position=both("position left", "position right", "position") * per_unit,
        speed=both("speed left", "speed right", "speed") * per_unit,
        command=c.get("command"),
        battery_v=c.get("battery"),
        gyro_z_radps=c.get("gyro rate"),
    )
