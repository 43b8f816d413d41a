"""Run plans: timed segments of effort, wheel speed or body twist, read from TOML."""

from __future__ import annotations

import difflib
import itertools
import json
import math
import tomllib
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from truing.errors import FileError, PlanError

MAX_SEGMENTS = 256
MAX_SEGMENT_S = 600.0
MAX_SPEED_MPS = 10.0
MAX_YAW_RATE_RADPS = 50.0
RATES_HZ = (1, 200)
BUILT_IN_FOLDER = Path(__file__).parent / "plans"
_SUFFIX = ".toml"
_LIST_NEXT = "`truing plan list` shows the plans that come with truing"


class Kind(Enum):
    """What a segment's two numbers mean; the value is its key in a plan file."""

    EFFORT = "effort"
    VELOCITY = "velocity_mps"
    TWIST = "twist"


@dataclass(frozen=True, slots=True)
class Segment:
    """One timed step.

    `a` and `b` are left and right effort (-1..1), left and right wheel speed (m/s), or body speed
    (m/s) and yaw rate (rad/s, positive to the left), by `kind`.
    """

    kind: Kind
    duration_s: float
    a: float
    b: float

    @property
    def duration_ms(self) -> int:
        """As the board counts it."""
        return round(self.duration_s * 1000)


@dataclass(frozen=True, slots=True)
class Plan:
    """Segments that the board runs one after the other.

    `log_rate_hz` of 0 leaves the rate to the board's parameter. `unattended`: the board goes on when it
    hears no host any more; otherwise it then stops within its heartbeat_timeout_s.
    """

    name: str
    title: str
    segments: tuple[Segment, ...]
    log_rate_hz: int = 0
    unattended: bool = False

    @property
    def duration_s(self) -> float:
        """From the first segment's start to the last one's end."""
        return sum(segment.duration_s for segment in self.segments)

    def to_dict(self) -> dict[str, Any]:
        """As a plan file's content, for metadata and JSON."""
        content: dict[str, Any] = {"name": self.name, "title": self.title}
        if self.log_rate_hz:
            content["log_rate_hz"] = self.log_rate_hz
        if self.unattended:
            content["unattended"] = True
        content["segment"] = [
            {
                "duration_s": segment.duration_s,
                segment.kind.value: {"v_mps": segment.a, "omega_radps": segment.b}
                if segment.kind is Kind.TWIST
                else [segment.a, segment.b],
            }
            for segment in self.segments
        ]
        return content

    def to_toml(self) -> str:
        """As a plan file, which `truing run` takes; its name becomes the file's."""
        title = json.dumps(self.title, ensure_ascii=False)
        lines = [f"title = {title}"]
        if self.log_rate_hz:
            lines.append(f"log_rate_hz = {self.log_rate_hz}")
        if self.unattended:
            lines.append("unattended = true")
        for segment in self.segments:
            if segment.kind is Kind.TWIST:
                value = f"{{ v_mps = {segment.a!r}, omega_radps = {segment.b!r} }}"
            else:
                value = f"[{segment.a!r}, {segment.b!r}]"
            lines += ["", "[[segment]]", f"duration_s = {segment.duration_s!r}"]
            lines.append(f"{segment.kind.value} = {value}")
        return "\n".join(lines) + "\n"


def built_in_names() -> list[str]:
    """The plans that come with truing, as `truing run` takes them."""
    return sorted(
        (
            str(path.relative_to(BUILT_IN_FOLDER).with_suffix(""))
            for path in BUILT_IN_FOLDER.rglob("*" + _SUFFIX)
        ),
        key=_natural,
    )


def load_plan(name_or_path: str) -> Plan:
    """Return the plan that the user means: a built-in name (`paper/XI`) or the path of a TOML file."""
    names = built_in_names()
    for name in names:
        if name.lower() == name_or_path.lower():
            return _read(BUILT_IN_FOLDER / (name + _SUFFIX), name)
    path = Path(name_or_path)
    if path.suffix == _SUFFIX or path.exists():
        return _read(path, path.stem)
    close = difflib.get_close_matches(name_or_path, names, n=3, cutoff=0.5)
    raise PlanError(
        f"{name_or_path}: neither a plan that comes with truing nor a file",
        f"did you mean {', '.join(close)}?" if close else _LIST_NEXT,
    )


def parse_plan(content: dict[str, Any], name: str, where: str) -> Plan:
    """Return the plan in a TOML document.

    Parameters
    ----------
    name : what to call the plan.
    where : what to call the document in errors.
    """
    _known_keys(content, {"title", "log_rate_hz", "unattended", "repeat", "segment"}, where)
    title = content.get("title", name)
    if not isinstance(title, str):
        raise PlanError(f"{where}: title: must be text")
    rate = _integer(content.get("log_rate_hz", 0), f"{where}: log_rate_hz")
    if rate and not RATES_HZ[0] <= rate <= RATES_HZ[1]:
        raise PlanError(f"{where}: log_rate_hz: {rate} is outside {RATES_HZ[0]} to {RATES_HZ[1]}")
    unattended = content.get("unattended", False)
    if not isinstance(unattended, bool):
        raise PlanError(f"{where}: unattended: must be true or false")
    repeat = _integer(content.get("repeat", 1), f"{where}: repeat")
    if repeat < 1:
        raise PlanError(f"{where}: repeat: must be 1 or more")
    tables = content.get("segment")
    if not isinstance(tables, list) or not tables:
        raise PlanError(
            f"{where}: there is no [[segment]]",
            "add for example: [[segment]] duration_s = 2.0, effort = [0.3, 0.3]",
        )
    segments = tuple(_segment(table, f"{where}: segment {i}") for i, table in enumerate(tables, 1)) * repeat
    if len(segments) > MAX_SEGMENTS:
        raise PlanError(
            f"{where}: {len(segments)} segments are more than the {MAX_SEGMENTS} that a board holds",
            "split the plan into several runs",
        )
    return Plan(name=name, title=title, segments=segments, log_rate_hz=rate, unattended=unattended)


def _read(path: Path, name: str) -> Plan:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror})", _LIST_NEXT) from error
    except UnicodeDecodeError as error:
        raise PlanError(f"{path}: is not UTF-8 text") from error
    except tomllib.TOMLDecodeError as error:
        raise PlanError(
            f"{path}: is not TOML: {error}", "`truing plan show paper/XI --toml` prints one to start from"
        ) from error
    return parse_plan(content, name, str(path))


def _segment(table: object, where: str) -> Segment:
    if not isinstance(table, dict):
        raise PlanError(f"{where}: must be a table")
    kinds = [kind for kind in Kind if kind.value in table]
    _known_keys(table, {"duration_s"} | {kind.value for kind in Kind}, where)
    if len(kinds) != 1:
        what = " and ".join(kind.value for kind in kinds) if kinds else "none"
        raise PlanError(f"{where}: needs exactly one of effort, velocity_mps, twist; it has {what}")
    if "duration_s" not in table:
        raise PlanError(f"{where}: duration_s: is missing")
    duration_s = _number(table["duration_s"], f"{where}: duration_s")
    if not 0.001 <= duration_s <= MAX_SEGMENT_S:
        raise PlanError(f"{where}: duration_s: {duration_s:g} is outside 0.001 to {MAX_SEGMENT_S:g}")
    kind = kinds[0]
    value = table[kind.value]
    if kind is Kind.TWIST:
        a, b = _twist(value, f"{where}: twist")
    else:
        limit = 1.0 if kind is Kind.EFFORT else MAX_SPEED_MPS
        a, b = _wheels(value, f"{where}: {kind.value}", limit)
    return Segment(kind, duration_s, a, b)


def _wheels(value: object, where: str, limit: float) -> tuple[float, float]:
    """One number for both wheels, [left, right], or {left, right}."""
    if isinstance(value, dict):
        _known_keys(value, {"left", "right"}, where)
        pair = [value.get("left", 0.0), value.get("right", 0.0)]
    elif isinstance(value, list):
        if len(value) != 2:
            raise PlanError(f"{where}: needs two numbers, left and right; it has {len(value)}")
        pair = value
    else:
        pair = [value, value]
    a, b = (_number(x, where) for x in pair)
    for x in (a, b):
        if abs(x) > limit:
            raise PlanError(f"{where}: {x:g} is outside -{limit:g} to {limit:g}")
    return a, b


def _twist(value: object, where: str) -> tuple[float, float]:
    if not isinstance(value, dict):
        raise PlanError(f"{where}: must be a table, for example {{ v_mps = 0.3, omega_radps = 0.5 }}")
    _known_keys(value, {"v_mps", "omega_radps"}, where)
    v = _number(value.get("v_mps", 0.0), f"{where}.v_mps")
    omega = _number(value.get("omega_radps", 0.0), f"{where}.omega_radps")
    if abs(v) > MAX_SPEED_MPS:
        raise PlanError(f"{where}.v_mps: {v:g} is outside -{MAX_SPEED_MPS:g} to {MAX_SPEED_MPS:g}")
    if abs(omega) > MAX_YAW_RATE_RADPS:
        limit = MAX_YAW_RATE_RADPS
        raise PlanError(f"{where}.omega_radps: {omega:g} is outside -{limit:g} to {limit:g}")
    return v, omega


def _known_keys(table: dict[str, Any], known: set[str], where: str) -> None:
    for key in table:
        if key not in known:
            close = difflib.get_close_matches(key, known, n=1)
            hint = f"did you mean {close[0]}?" if close else f"known here: {', '.join(sorted(known))}"
            raise PlanError(f"{where}: {key}: unknown key", hint)


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise PlanError(f"{where}: must be a number")
    if not math.isfinite(value):
        raise PlanError(f"{where}: must be a finite number, not {value}")
    return float(value)


def _integer(value: object, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise PlanError(f"{where}: must be a whole number")
    return value


_ROMAN = {"I": 1, "V": 5, "X": 10}


def _natural(name: str) -> tuple[str, int, str]:
    """Sorts `paper/IX` before `paper/X`."""
    folder, _, last = name.rpartition("/")
    if last and set(last) <= set(_ROMAN):
        values = [_ROMAN[c] for c in last] + [0]
        return folder, sum(-v if v < w else v for v, w in itertools.pairwise(values)), last
    return folder, 0, last
