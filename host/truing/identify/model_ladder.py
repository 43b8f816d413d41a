"""All models of a recording set side by side: what each added piece of physics buys, on unseen runs too."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from truing.errors import IdentifyError
from truing.identify.arx import ArxFit, fit_arx_signal
from truing.identify.data_checks import refuse_absurd
from truing.identify.effort_checks import refuse_efforts
from truing.identify.effort_row import effort_row
from truing.identify.grey_box import SharedFits, WheelFit, fit_wheel
from truing.identify.held_out import PARSIMONY, simplest_good
from truing.identify.identifiable import STEPS_ADVICE, TIME_CONSTANT, at_a_bound
from truing.identify.output_error import PhysicsFit
from truing.identify.row_sampling import SAID, with_row_sampling
from truing.identify.signals import wheel_signal
from truing.identify.state_space import StateSpaceFit, fit_state_space_signal
from truing.identify.structures import DELAY, STRUCTURES, Structure
from truing.model.robot_model import RobotModel
from truing.progress import Progress
from truing.recording.axis import Axis
from truing.recording.baseline import RobotGeometry
from truing.recording.frames import preformatted
from truing.recording.run import WHEELS, RecordingSet, Wheel

BASIC = ("linear", "friction", "delay")
# A run whose error grows by this factor when it is left out holds something that no other run holds.
IRREPLACEABLE = 4.0
RICHER = tuple(name for name in STRUCTURES if name not in BASIC)


@dataclass(frozen=True, slots=True)
class WheelModels:
    """Every model of one wheel.

    Attributes
    ----------
    steps : the grey-box fits, simplest first; only the chosen one has intervals.
    chosen : the simplest of them whose error on left-out runs is within 2 % of the lowest; with one run, of
        the fitted error and up to friction and delay; with a run that no other can stand in for, these.
    arx, state_space : None where they cannot be fitted.
    missing : what could not be done, and why.
    """

    wheel: Wheel
    steps: tuple[WheelFit, ...]
    chosen: WheelFit
    arx: ArxFit | None
    state_space: StateSpaceFit | None
    missing: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "wheel": self.wheel,
            "chosen": self.chosen.structure.name,
            "grey_box": [step.to_json() for step in self.steps],
            "arx": None if self.arx is None else self.arx.to_json(),
            "state_space": None if self.state_space is None else self.state_space.to_json(),
            "missing": list(self.missing),
        }


@dataclass(frozen=True, slots=True)
class SetModels:
    """Every model of a recording set; a wheel that cannot be fitted is in `refused` with the reason.

    `notes` say what holds for the recordings as a whole.
    """

    name: str
    wheels: tuple[WheelModels, ...]
    refused: dict[Wheel, str]
    robot: RobotGeometry
    rate_hz: float
    notes: tuple[str, ...] = ()
    axis: Axis | None = None

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "name": self.name,
            "wheels": [wheel.to_json() for wheel in self.wheels],
            "refused": dict(self.refused),
            "notes": list(self.notes),
        }

    def __str__(self) -> str:
        from truing.identify.model_tables import model_tables
        from truing.identify.summary import fitted_lines

        return "\n".join([*fitted_lines(self), *(table.to_text() for table in model_tables(self))])

    def _repr_html_(self) -> str:
        return preformatted(str(self))

    def robot_model(self) -> RobotModel:
        """The chosen models of both wheels as one robot.

        A wheel that could not be fitted has a copy of the other's, and `source` says so.

        Raises
        ------
        IdentifyError : the runs do not show a wheel's gain or time constant.
        """
        chosen = {models.wheel: models.chosen for models in self.wheels}
        source = {"recordings": self.name}
        for wheel, fit in chosen.items():
            _refuse_unknown(wheel, fit)
            error = fit.held_out or fit.free_run
            kind = "left-out runs" if fit.held_out is not None else "the fitted run"
            source[wheel] = f"{fit.structure.name}; free-run error {error.percent:.2f} % on {kind}"
        for wheel, reason in self.refused.items():
            source[wheel] = f"a copy of the other wheel, not fitted: {reason}"
        left, right = (chosen.get(wheel, self.wheels[0].chosen).physics for wheel in WHEELS)
        return RobotModel(left, right, self.robot, self.rate_hz, source)


def _refuse_unknown(wheel: Wheel, fit: WheelFit) -> None:
    """Stop where a number that every simulation needs is not known."""
    for name, words in (("gain_mps", "gain"), (TIME_CONSTANT, "time constant")):
        quantity = fit.parameters.get(name)
        if quantity is not None and quantity.value is None:
            raise IdentifyError(
                f"no model is written: the {wheel} wheel's {words} is not known ({quantity.reason})",
                STEPS_ADVICE,
            )


def fit_models(
    recordings: RecordingSet,
    *,
    richer: bool = False,
    progress: Progress | None = None,
) -> SetModels:
    """Fit both wheels, each on its own thread (the compiled rollouts release the interpreter).

    Parameters
    ----------
    richer : also try every structure beyond friction and delay.

    Raises
    ------
    RecordingError, IdentifyError : efforts that are none; speeds that no robot has; no wheel can be fitted.
    """
    refuse_absurd(recordings)
    refuse_efforts(recordings)
    recordings = with_row_sampling(recordings)
    names = BASIC + (RICHER if richer else ())
    done = dict.fromkeys(recordings.wheels, 0.0)

    def wheel_models(wheel: Wheel) -> WheelModels:
        def tell(share: float) -> None:
            done[wheel] = share
            if progress is not None:
                progress(sum(done.values()) / len(done))

        return _fit_wheel_models(recordings, wheel, names, tell)

    wheels: list[WheelModels] = []
    refused: dict[Wheel, str] = {}
    with ThreadPoolExecutor(len(WHEELS)) as pool:
        futures = {wheel: pool.submit(wheel_models, wheel) for wheel in recordings.wheels}
        for wheel, future in futures.items():
            try:
                wheels.append(future.result())
            except IdentifyError as error:
                refused[wheel] = error.message
    if not wheels:
        raise IdentifyError("; ".join(f"{wheel} wheel: {reason}" for wheel, reason in refused.items()))
    robot = recordings.robot or RobotGeometry()
    rate = float(np.median([run.rate_hz for run in recordings]))
    offset = effort_row(recordings)
    notes: tuple[str, ...] = ()
    if offset is not None and offset.sentence():
        notes = (f"{offset.wheel} wheel: {offset.sentence()}. {offset.advice()}",)
    if recordings.runs[0].instant:
        notes += (SAID,)
    return SetModels(recordings.name, tuple(wheels), refused, robot, rate, notes, recordings.axis)


def _fit_wheel_models(
    recordings: RecordingSet, wheel: Wheel, names: tuple[str, ...], progress: Progress
) -> WheelModels:
    runs, robot = recordings.runs, recordings.robot
    signal = wheel_signal(runs, wheel, robot)
    shared = SharedFits(signal)
    visible = [STRUCTURES[name] for name in names if _is_visible(STRUCTURES[name], signal.has_supply)]
    steps: list[WheelFit] = []
    for number, structure in enumerate(visible):
        steps.append(
            fit_wheel(
                runs, wheel, structure, robot, intervals=False, shared=shared,
                hold_out=structure.name in BASIC, nested=_richest_within(steps, structure),
            )
        )  # fmt: skip
        progress(0.7 * (number + 1) / len(visible))
    chosen = _choose(steps, shared)
    progress(0.85)
    missing: list[str] = []
    plain = next(step for step in steps if step.structure is DELAY)
    alone = _irreplaceable_run(plain)
    if alone is not None:
        chosen = plain
        missing.append(
            f"the other runs do not show what {alone} shows, so that leaving runs out says little here; "
            "friction and delay were taken"
        )
    number = steps.index(chosen)
    steps[number] = chosen = chosen.with_intervals()
    arx: ArxFit | None = None
    state_space: StateSpaceFit | None = None
    try:
        arx = fit_arx_signal(signal, wheel)
    except IdentifyError as error:
        missing.append(f"ARX: {error.message}")
    try:
        state_space = fit_state_space_signal(signal, wheel)
    except IdentifyError as error:
        missing.append(f"state space: {error.message}")
    progress(1.0)
    return WheelModels(wheel, tuple(steps), chosen, arx, state_space, tuple(missing))


def _choose(steps: list[WheelFit], shared: SharedFits) -> WheelFit:
    """The simplest step within 2 % of the lowest error on runs left out; judges those that this may concern.

    A run that is left out is never simulated better than when it is fitted, so that the error on the
    fitted runs bounds the other one from below. Richer structures whose bound already rules them out, both
    as the choice and as what rules the choice out, are not judged; `steps` gets those that are.
    """
    plain = next(step for step in steps if step.structure is DELAY)
    if plain.held_out is None:
        return _choose_by_fit(steps)
    while True:
        # A time constant at the end of what is searched is no estimate, however well it fits.
        sound = [step for step in steps if at_a_bound(step.search) is None] or steps
        judged = [(step, step.held_out.rms_mps) for step in sound if step.held_out is not None]
        waiting = [step for step in sound if step.held_out is None]
        if judged:
            scores = [(error, len(step.structure.free)) for step, error in judged]
            chosen, error = judged[simplest_good(scores)]
            best = min(score for score, _ in scores)
            waiting = [step for step in waiting if _may_change(step, chosen, error, best)]
            if not waiting:
                return chosen
        step = min(waiting, key=lambda one: (len(one.structure.free), one.free_run.rms_mps))
        new = step.with_runs_left_out(shared)
        if new.held_out is None:
            return plain
        steps[steps.index(step)] = new


def _choose_by_fit(steps: list[WheelFit]) -> WheelFit:
    """Where no run can be left out: the simplest up to friction and delay within 2 % of the lowest error."""
    basic = [step for step in steps if step.structure.name in BASIC]
    return basic[simplest_good([(step.free_run.rms_mps, len(step.structure.free)) for step in basic])]


def _may_change(step: WheelFit, chosen: WheelFit, error_mps: float, best_mps: float) -> bool:
    """Whether a step that was not judged may be the choice, or put the choice (of this error) out of it."""
    bound = step.free_run.rms_mps
    if PARSIMONY * bound < error_mps:
        return True
    simpler = (len(step.structure.free), bound) < (len(chosen.structure.free), error_mps)
    return simpler and bound <= PARSIMONY * best_mps


def _richest_within(steps: Sequence[WheelFit], structure: Structure) -> PhysicsFit | None:
    """The search's end of the richest structure fitted so far that this one contains."""
    within = [step for step in steps if set(step.structure.free) < set(structure.free)]
    return max(within, key=lambda step: len(step.structure.free)).search if within else None


def _irreplaceable_run(fit: WheelFit) -> str | None:
    """The run that is simulated far worse when it is left out than when it is fitted, if there is one."""
    if fit.held_out is None:
        return None
    fitted, held_out = fit.free_run.by_run_mps, fit.held_out.by_run_mps
    worst = max(held_out, key=lambda name: held_out[name])
    if held_out[worst] > IRREPLACEABLE * max(fitted[worst], fit.free_run.rms_mps):
        return worst
    return None


def _is_visible(structure: Structure, has_supply: bool) -> bool:
    return has_supply or "supply_share" not in structure.free
