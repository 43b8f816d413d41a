"""The identification of a whole recording set: steps, free-run fits, and what looks wrong."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from truing.errors import IdentifyError
from truing.identify.data_checks import Finding, check_set, refuse_absurd
from truing.identify.effort_checks import refuse_efforts
from truing.identify.effort_row import effort_row
from truing.identify.first_order import FirstOrderFit, fit_first_order
from truing.identify.identifiable import STEPS_ADVICE
from truing.identify.row_sampling import SAID, with_row_sampling
from truing.identify.step_metrics import StepMetrics, step_metrics
from truing.model.robot_model import RobotModel
from truing.model.wheel import WheelPhysics
from truing.progress import Progress, ignore_progress
from truing.recording.axis import Axis
from truing.recording.baseline import RobotGeometry
from truing.recording.frames import preformatted
from truing.recording.run import WHEELS, Geometry, RecordingSet, Run, SpeedSource, Wheel

SCHEMA = 1
# A wheel whose effort stays below this in a run is not driven there.
DRIVEN_EFFORT = 0.02
# A run goes one way when this share of its effort has one sign.
ONE_WAY_SHARE = 0.95
# A ramp's time constant this much above the steps' is friction in disguise.
SUSPECT_FACTOR = 1.5
RAMP_NOTE = (
    "a ramp alone cannot tell lag from dry friction: without friction in it, gain and τ come out too high"
)


@dataclass(frozen=True, slots=True)
class WheelSteps:
    """The steps of one wheel in one run, or why there are none."""

    wheel: Wheel
    steps: tuple[StepMetrics, ...]
    reason: str | None


@dataclass(frozen=True, slots=True)
class RunIdentification:
    """One run: what was commanded, and the steps of both wheels."""

    name: str
    source: SpeedSource
    left: WheelSteps
    right: WheelSteps

    @property
    def wheels(self) -> tuple[WheelSteps, WheelSteps]:
        """Left, right."""
        return self.left, self.right

    @property
    def mode(self) -> str:
        """The paper's label: effort or velocity, and which wheels (E-L, V-B, ...); '' without steps."""
        driven = [side for side in self.wheels if any(step.input != 0.0 for step in side.steps)]
        if not driven:
            return ""
        kind = "V" if driven[0].steps[0].kind == "velocity" else "E"
        return f"{kind}-{'B' if len(driven) == 2 else driven[0].wheel[0].upper()}"

    @property
    def level_count(self) -> int:
        """The largest number of non-zero levels that a wheel has."""
        return max(sum(step.input != 0.0 for step in side.steps) for side in self.wheels)


@dataclass(frozen=True, slots=True)
class Identification:
    """Everything that `truing identify` says about a set."""

    name: str
    runs: tuple[RunIdentification, ...]
    fits: tuple[FirstOrderFit, ...]
    findings: tuple[Finding, ...]
    robot: RobotGeometry = field(default_factory=RobotGeometry)
    rate_hz: float | None = None
    axis: Axis | None = None

    def __str__(self) -> str:
        from truing.identify.tables import result_text

        return result_text(self)

    def _repr_html_(self) -> str:
        return preformatted(str(self))

    @property
    def whole_fits(self) -> dict[Wheel, FirstOrderFit]:
        """The fit of each wheel that holds for the whole set (the first one made)."""
        fits: dict[Wheel, FirstOrderFit] = {}
        for fit in self.fits:
            fits.setdefault(fit.wheel, fit)
        return fits

    def robot_model(self) -> RobotModel:
        """Gains and time constants of both wheels with the geometry: a model, and a baseline as a file.

        Raises
        ------
        IdentifyError
            The runs do not show a wheel's gain or time constant; says which and why.
        """
        left, right = (self._wheel("left" if self.axis else wheel) for wheel in WHEELS)
        return RobotModel(left, right, self.robot, self.rate_hz, {"recordings": self.name})

    def _wheel(self, wheel: Wheel) -> WheelPhysics:
        fit = self.whole_fits.get(wheel)
        if fit is None:
            raise IdentifyError(
                f"{self.name}: no baseline, the {wheel} wheel is never driven", "Drive both wheels"
            )
        for words, quantity in (("gain", fit.gain), ("time constant", fit.time_constant)):
            if quantity.value is None:
                raise IdentifyError(
                    f"{self.name}: no baseline, the {wheel} wheel's {words} is unknown ({quantity.reason})",
                    STEPS_ADVICE,
                )
        assert fit.gain.value is not None
        assert fit.time_constant.value is not None
        return WheelPhysics(fit.gain.value, fit.time_constant.value)

    def to_json(self) -> dict[str, Any]:
        """For `--json`; numbers that could not be determined are null and carry a reason."""
        return {
            "schema": SCHEMA,
            "name": self.name,
            "runs": [
                {
                    "run": run.name,
                    "mode": run.mode,
                    "speed_from": run.source,
                    **{side.wheel: _side_to_json(side) for side in run.wheels},
                }
                for run in self.runs
            ],
            "first_order": [fit.to_json() for fit in self.fits],
            "findings": [
                {"run": finding.run, "wheel": finding.wheel, "topic": finding.topic, "text": finding.text}
                for finding in self.findings
            ],
        }


def identify_set(recordings: RecordingSet, progress: Progress = ignore_progress) -> Identification:
    """Identify every run of a set, and fit the runs together.

    Parameters
    ----------
    progress : is told the share of the work that is done, 0 to 1.
    """
    refuse_absurd(recordings)
    refuse_efforts(recordings)
    recordings = with_row_sampling(recordings)
    runs = []
    for number, run in enumerate(recordings, start=1):
        runs.append(_identify_run(run, recordings.robot, recordings.wheels))
        progress(0.3 * number / len(recordings))
    jobs = _fit_jobs(recordings, runs)
    fits = []
    for number, (wheel, label, members) in enumerate(jobs, start=1):
        scale = speed_scale(recordings, wheel)
        fits.append(fit_first_order(members, wheel, recordings.robot, label=label, scale_mps=scale))
        progress(0.3 + 0.7 * number / len(jobs))
    findings = check_set(recordings)
    if recordings.runs[0].instant:
        findings += (Finding(recordings.runs[0].name, SAID, None, "row_sampling"),)
    offset = effort_row(recordings)
    if offset is not None and offset.sentence():
        text = f"{offset.sentence()}. {offset.advice()}"
        findings += (Finding(recordings.runs[0].name, text, offset.wheel, "effort_row"),)
    return Identification(
        recordings.name,
        tuple(runs),
        _mark_uncertain_ramps(fits),
        findings,
        recordings.robot or RobotGeometry(),
        float(np.median([run.rate_hz for run in recordings])),
        recordings.axis,
    )


def speed_scale(recordings: RecordingSet, wheel: Wheel) -> float:
    """The 98th percentile of |speed| of a wheel over the whole set, m/s: what per cents refer to."""
    speeds = [np.abs(run.speed(wheel, recordings.robot).values) for run in recordings]
    return float(np.percentile(np.concatenate(speeds), 98))


def _identify_run(run: Run, baseline: Geometry | None, wheels: tuple[Wheel, ...]) -> RunIdentification:
    left, right = (
        WheelSteps(wheel, *(step_metrics(run, wheel, baseline) if wheel in wheels else ((), None)))
        for wheel in WHEELS
    )
    return RunIdentification(run.name, run.speed("left", baseline).source, left, right)


def _fit_jobs(
    recordings: RecordingSet, identified: list[RunIdentification]
) -> list[tuple[Wheel, str, list[Run]]]:
    """What to fit: all runs together, and where ramps are among them, each kind and direction alone."""
    stepped = {run.name: any(side.steps for side in run.wheels) for run in identified}
    mixed = not all(stepped.values())
    jobs: list[tuple[Wheel, str, list[Run]]] = []
    for wheel in recordings.wheels:
        driven = [run for run in recordings if float(np.abs(run.effort(wheel)).max()) >= DRIVEN_EFFORT]
        if not driven:
            continue
        jobs.append((wheel, "all runs" if len(driven) > 1 else driven[0].name, driven))
        if not mixed or len(driven) < 2:
            continue
        groups: dict[str, list[Run]] = {}
        for run in driven:
            kind = "steps" if stepped[run.name] else "ramps"
            groups.setdefault(f"{kind} {_direction(run, wheel)}", []).append(run)
        steps_first = sorted(groups, key=lambda label: (label.startswith("ramps"), label))
        jobs.extend((wheel, label, groups[label]) for label in steps_first)
    return jobs


def _mark_uncertain_ramps(fits: list[FirstOrderFit]) -> tuple[FirstOrderFit, ...]:
    """Mark fits to ramps whose time constants contradict those of the steps, or are not to be had.

    On a slow ramp dry friction looks like lag (both put the speed behind the effort by a constant),
    and a model without friction can only call it lag.
    """
    known: dict[Wheel, list[float]] = {"left": [], "right": []}
    for fit in fits:
        if fit.label.startswith("steps") and fit.time_constant.value is not None:
            known[fit.wheel].append(fit.time_constant.value)
    marked = []
    for fit in fits:
        longest = SUSPECT_FACTOR * max(known[fit.wheel], default=float("inf"))
        value = fit.time_constant.value
        if fit.label.startswith("ramps") and known[fit.wheel] and (value is None or value > longest):
            marked.append(replace(fit, notes=(*fit.notes, RAMP_NOTE)))
        else:
            marked.append(fit)
    return tuple(marked)


def _direction(run: Run, wheel: Wheel) -> str:
    effort = run.effort(wheel)
    forward = float(effort[effort > 0.0].sum())
    backward = float(-effort[effort < 0.0].sum())
    share = forward / (forward + backward)
    if share >= ONE_WAY_SHARE:
        return "forward"
    return "backward" if share <= 1.0 - ONE_WAY_SHARE else "both ways"


def _side_to_json(side: WheelSteps) -> dict[str, Any]:
    tree: dict[str, Any] = {
        "steps": [
            {
                "step": step.number,
                "kind": step.kind,
                "input": step.input,
                "previous": step.previous,
                "direction": step.direction,
                "start_s": step.start_s,
                "duration_s": step.duration_s,
                "steady_mps": step.steady_mps,
                "gain": step.gain.to_json(),
                "time_constant_s": step.time_constant.to_json(),
                "dead_time_s": step.dead_time.to_json(),
                "overshoot_percent": step.overshoot.to_json(),
                "undershoot_percent": step.undershoot.to_json(),
                "ripple_mmps": step.ripple.to_json(),
                "notes": list(step.notes),
            }
            for step in side.steps
        ]
    }
    if side.reason is not None:
        tree["reason"] = side.reason
    return tree
