"""The active error model: none, the MOM paper's, or a diagnosed one; each parameter with its slider."""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

from truing.errors import FileError
from truing.recording.baseline import Baseline, WheelModel
from truing.recording.writer import replace_file
from truing.studies.mom_odometry import NO_ERROR, PAPER_MODEL, REAL, ErrorModel, fit_line

Kind: TypeAlias = Literal["none", "paper", "found"]
# The values are stored in model files.
KINDS: dict[Kind, str] = {"none": "None", "paper": "MOM paper", "found": "Diagnosed"}
_NUMBERS = ("gain_left", "gain_right", "tau_left", "tau_right")
_UNITS = {"gain": "m/s", "tau": "s"}
_PAPER_UNITS = {"scale": "", "straight": "rad/m", "turning_right": "rad/m", "turning_left": "rad/m"}


@dataclass(frozen=True, slots=True)
class Slider:
    """One parameter that a user may adjust.

    Attributes
    ----------
    key : `paper.NAME`, `number.NAME` or `effect.EFFECT.NAME`.
    low, high : ends of the slider.
    interval : 95 % interval from the recordings, or the range of the paper's own figures; None if unknown.
    """

    key: str
    title: str
    unit: str
    value: float
    low: float
    high: float
    interval: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class ModelChoice:
    """The active error model and its parameters.

    Attributes
    ----------
    numbers : `gain_left`, `tau_left`, ... in m/s and s, in place of the baseline's; may be empty.
    effects : the catalogue's effects with their documented parameters.
    source : where the model comes from, as text.
    """

    kind: Kind = "none"
    paper: ErrorModel = PAPER_MODEL
    numbers: dict[str, float] = field(default_factory=dict)
    effects: dict[str, dict[str, float]] = field(default_factory=dict)
    source: str = ""

    @property
    def motion(self) -> ErrorModel:
        """The errors of commanded motion: the paper's model if it is active."""
        return self.paper if self.kind == "paper" else NO_ERROR

    def with_value(self, key: str, value: float) -> ModelChoice:
        """A copy with one parameter changed."""
        what, _, name = key.partition(".")
        if what == "paper":
            return replace(self, paper=replace(self.paper, **{name: value}))
        if what == "number":
            return replace(self, numbers=self.numbers | {name: value})
        effect, _, parameter = name.partition(".")
        return replace(
            self, effects=self.effects | {effect: self.effects.get(effect, {}) | {parameter: value}}
        )

    def applied(self, baseline: Baseline) -> Baseline:
        """The baseline with the diagnosed parameters and effects."""
        if self.kind != "found":
            return baseline
        left, right = (
            WheelModel(
                self.numbers.get(f"gain_{side}", given.gain_mps),
                self.numbers.get(f"tau_{side}", given.time_constant_s),
            )
            for side, given in (("left", baseline.left), ("right", baseline.right))
        )
        effects = {name: dict(table) for name, table in self.effects.items()}
        return replace(baseline, left=left, right=right, effects=baseline.effects | effects)

    def to_json(self) -> dict[str, Any]:
        """As plain data, for another process."""
        return asdict(self)

    @classmethod
    def of_json(cls, content: dict[str, Any]) -> ModelChoice:
        """From `to_json`."""
        return cls(**{**content, "paper": ErrorModel(**content["paper"])})


def offered_kinds(model: ModelChoice) -> dict[str, str]:
    """Value and text of the error models that can be chosen: a diagnosed one where there was a diagnosis."""
    diagnosed = bool(model.effects or model.numbers)
    return {str(kind): text for kind, text in KINDS.items() if kind != "found" or diagnosed}


def paper_sliders(model: ErrorModel) -> list[Slider]:
    """The paper's four constants; the interval is from its printed value to the one that Table 2 implies."""
    implied = fit_line(REAL)
    spans = {
        "scale": tuple(sorted((PAPER_MODEL.scale, implied.scale))),
        "straight": tuple(sorted((PAPER_MODEL.straight, implied.straight))),
    }
    titles = {
        "scale": "distance scale",
        "straight": "drift on straight lines",
        "turning_right": "drift turning right",
        "turning_left": "drift turning left",
    }
    return [
        Slider(
            f"paper.{name}",
            title,
            _PAPER_UNITS[name],
            getattr(model, name),
            *((-0.2, 0.2) if name == "scale" else (-0.6, 0.6)),
            spans.get(name),  # type: ignore[arg-type]
        )
        for name, title in titles.items()
    ]


def explanations(verdict: dict[str, Any]) -> list[tuple[int, str]]:
    """The explanations of a diagnosis, each with the names of its effects."""
    groups: dict[int, list[str]] = {}
    for effect in verdict["effects"]:
        groups.setdefault(int(effect.get("explanation", 0)), []).append(str(effect["name"]).replace("_", " "))
    return [(number, " with ".join(names)) for number, names in groups.items()] or [(0, "parameters only")]


def diagnosed_model(
    verdict: dict[str, Any], explanation: int | None = None
) -> tuple[ModelChoice, list[Slider]]:
    """The result of a diagnosis as a model and its sliders, for one explanation of several.

    Parameters
    ----------
    verdict : the JSON of `truing diagnose`.
    explanation : its number; None selects the first.
    """
    effects: dict[str, dict[str, float]] = {}
    sliders = []
    chosen = explanations(verdict)[0][0] if explanation is None else explanation
    for effect in verdict["effects"]:
        if int(effect.get("explanation", 0)) != chosen:
            continue
        name = str(effect["name"])
        table = effects.setdefault(name, {})
        for parameter, entry in effect["parameters"].items():
            if entry["value"] is None:
                continue
            table[parameter] = float(entry["value"])
            title = f"{name.replace('_', ' ')}: {parameter.replace('_', ' ')}"
            sliders.append(_slider(f"effect.{name}.{parameter}", title, entry))
    numbers: dict[str, float] = {}
    if verdict["verdict"] != "consistent":
        for item in verdict["numbers"]:
            stem = "gain" if item["name"] == "gain_mps" else "tau"
            key = f"{stem}_{item['wheel']}"
            entry = item["with_effects"]
            if key in _NUMBERS and entry["value"] is not None:
                numbers[key] = float(entry["value"])
                title = f"{item['wheel']} {'gain' if stem == 'gain' else 'time constant'}"
                sliders.append(_slider(f"number.{key}", title, entry | {"unit": _UNITS[stem]}))
    choice = ModelChoice("found", numbers=numbers, effects=effects, source=f"diagnosis of {verdict['name']}")
    return choice, sliders


def _slider(key: str, title: str, entry: dict[str, Any]) -> Slider:
    value = float(entry["value"])
    low, high = (value if end is None else float(end) for end in entry["ci95"])
    around = max(3.0 * (high - low), 0.5 * abs(value), 1e-6)
    left, right = min(low, value) - around, max(high, value) + around
    # A parameter whose whole interval is positive cannot be negative.
    if min(low, value) >= 0.0:
        left = max(left, 1e-4 * max(high, value) if key.startswith("number.") else 0.0)
    interval = (low, high) if math.isfinite(low) and math.isfinite(high) and high > low else None
    unit = "" if entry["unit"] in ("1", "fraction", "ratio", "factor") else str(entry["unit"])
    return Slider(key, title, unit, value, left, right, interval)


def read_verdict(path: Path) -> dict[str, Any]:
    """A diagnosis as `truing diagnose --json` wrote it.

    Raises
    ------
    FileError : it cannot be read, or is not a diagnosis.
    """
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise FileError(path, f"cannot be read: {error}") from error
    wanted = ("verdict", "effects", "numbers", "name")
    if not isinstance(content, dict) or any(key not in content for key in wanted):
        raise FileError(path, "is not a diagnosis", "`truing diagnose RUNS --json FILE` writes one")
    return content


def model_text(choice: ModelChoice, baseline: Baseline | None) -> str:
    """A model file: a baseline with the diagnosed effects, followed by the view's own tables."""
    lines = [f"# The robot's model, saved by the view: {choice.source or KINDS[choice.kind].lower()}", ""]
    if baseline is not None:
        changed = choice.applied(baseline)
        if changed.robot is not None:
            lines.append("[robot]")
            if changed.robot.name:
                lines.append(f"name = {json.dumps(changed.robot.name, ensure_ascii=False)}")
            for name in ("wheel_radius_m", "wheelbase_m", "counts_per_rev"):
                value = getattr(changed.robot, name)
                if value is not None:
                    lines.append(f"{name} = {value!r}")
            lines.append("")
        for side, wheel in (("left", changed.left), ("right", changed.right)):
            lines += [f"[wheel.{side}]", f"gain_mps = {wheel.gain_mps!r}"]
            lines += [f"time_constant_s = {wheel.time_constant_s!r}", ""]
        if changed.log_rate_hz is not None:
            lines += ["[log]", f"rate_hz = {changed.log_rate_hz!r}", ""]
        for name, table in changed.effects.items():
            lines.append(f"[effect.{name}]")
            lines += [f"{key} = {float(value)!r}" for key, value in table.items()]
            lines.append("")
    # The tables that the view reads back, independent of the baseline.
    lines += ["[view]", f"kind = {json.dumps(choice.kind)}", f"source = {json.dumps(choice.source)}"]
    lines += ["[view.motion_error]", *(f"{name} = {float(v)!r}" for name, v in asdict(choice.paper).items())]
    lines += ["[view.numbers]", *(f"{name} = {value!r}" for name, value in choice.numbers.items())]
    for name, table in choice.effects.items():
        lines += [f"[view.effect.{name}]", *(f"{key} = {value!r}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def save_model(choice: ModelChoice, baseline: Baseline | None, path: Path) -> Path:
    """Write the robot's model file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, model_text(choice, baseline).encode("utf-8"))
    return path


def load_model(path: Path) -> ModelChoice | None:
    """The saved model of the robot; None if the file is missing or invalid."""
    try:
        table = tomllib.loads(path.read_text("utf-8"))["view"]
        return ModelChoice(
            kind=table["kind"] if table["kind"] in KINDS else "none",
            paper=ErrorModel(**{name: float(v) for name, v in table["motion_error"].items()}),
            numbers={name: float(value) for name, value in table.get("numbers", {}).items()},
            effects={
                name: {key: float(value) for key, value in values.items()}
                for name, values in table.get("effect", {}).items()
            },
            source=str(table.get("source", "")),
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
