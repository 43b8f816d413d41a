"""The plans that can be driven: those that come with truing, saved paths, and proposed experiments."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from truing.errors import TruingError
from truing.plan import Kind, Plan, Segment, built_in_names, load_plan

GROUPS = {
    "diagnosis": "Diagnosis",
    "paper": "The paper's tests",
    "other": "Other plans",
    "saved": "Saved paths",
    "next": "Proposed next",
    "step": "Step",
    "tune": "Tune the feedforward",
    "check": "Check the wiring",
}
_REST_S, _REST_AFTER_S = 1.0, 1.5


@dataclass(frozen=True, slots=True)
class StepSettings:
    """A step from rest and back to rest.

    Attributes
    ----------
    kind : `effort` (% of the supply) or `velocity` (m/s).
    """

    kind: str = "effort"
    height: float = 40.0
    duration_s: float = 2.0
    wheel: str = "both"
    rate_hz: float = 20.0

    def plan(self) -> Plan:
        """As `truing step` drives it."""
        effort = self.kind == "effort"
        height = self.height / 100.0 if effort else self.height
        left, right = (height if self.wheel in ("both", side) else 0.0 for side in ("left", "right"))
        what = f"{height:.0%} effort" if effort else f"{height:g} m/s"
        return Plan(
            name="step",
            title=f"Step of {what}, {self.wheel}, {self.duration_s:g} s",
            segments=(
                Segment(Kind.EFFORT, _REST_S, 0.0, 0.0),
                Segment(Kind.EFFORT if effort else Kind.VELOCITY, self.duration_s, left, right),
                Segment(Kind.EFFORT, _REST_AFTER_S, 0.0, 0.0),
            ),
            log_rate_hz=int(self.rate_hz),
        )


def plans_of(group: str, sequences: Path, diagnoses: Path) -> dict[str, str]:
    """Name or path, and text, of every plan of a group."""
    if group in ("diagnosis", "paper", "other"):
        names = [name for name in built_in_names() if _group_of(name) == group]
        return {name: _listed(name.rpartition("/")[2], load_plan(name).title) for name in names}
    if group == "saved":
        return {str(path): path.stem for path in _newest_first(sequences.glob("*.toml"))}
    if group == "next":
        return {
            str(path): path.name.removesuffix(".next.toml")
            for path in _newest_first(diagnoses.glob("*.next.toml"))
        }
    return {}


def plan_named(group: str, name: str, sequences: Path, diagnoses: Path) -> Plan | None:
    """A plan of a group; None where it is not in it, or not valid any more."""
    if name not in plans_of(group, sequences, diagnoses):
        return None
    try:
        return load_plan(name)
    except TruingError:
        return None


def _group_of(name: str) -> str:
    folder = name.rpartition("/")[0]
    return folder if folder in ("diagnosis", "paper") else "other"


def _listed(name: str, title: str) -> str:
    """Name and title; a paper's test has its number in both."""
    return f"{name}: {title.removeprefix(f'Test {name}: ')}"


def _newest_first(files: object) -> list[Path]:
    return sorted(files, key=lambda path: -path.stat().st_mtime)  # type: ignore[call-overload, no-any-return]
