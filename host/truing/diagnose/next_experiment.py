"""Design of the next experiment: explanations are simulated over a library of safe drives.

Compared are the wheels' speeds and, where an outside reference was logged, the pose over short windows. For
every drive the rival is refitted to what the other explanation predicts, on the drive and on the recordings
that exist (linearised first, by Gauss-Newton steps for the best few), so that only differences that no
other choice of its parameters can produce count (Box & Hill 1967; Atkinson & Fedorov 1975). The drive with
the largest smallest difference wins; of drives about as good, the shortest.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.diagnose.data.set_data import SetData, set_data
from truing.diagnose.measured import how_to_resolve
from truing.diagnose.present.text import effect_title, joined
from truing.diagnose.problem import Column, base_columns, effect_columns, moves_pose
from truing.diagnose.profiles import Limits, Profile, Robot, candidate_plans
from truing.diagnose.result import Explanation, NextExperiment, SignalNoise
from truing.diagnose.simulation.simulator import SetSimulator
from truing.levenberg import minimise
from truing.plan import Plan
from truing.recording.run import GYRO_COLUMN, MOTION_PAIRS, TRUTH_COLUMNS, WHEELS, RecordingSet, Run

# Whitened difference beyond which two explanations are nearly always distinguished; below half of it rarely.
CLEARLY_DIFFERENT = 4.0
# Number of drives for which the rival's parameters are refitted.
REFITTED_DRIVES = 3
ITERATIONS = 4
# Share of the best difference above which a shorter drive is preferred.
COMPARABLE_SHARE = 0.85
# Standard deviation of the prior of each parameter, as a share of its range.
PRIOR_SHARE = 0.5
# A rival contains the other explanation if its remaining difference is below this share of the reverse one.
CONTAINED = 0.02
# Largest difference below which two explanations need a direct measurement instead of a drive.
INDISTINGUISHABLE = 0.5
MIN_FLOOR_M = 2.0
DEFAULT_WHEELBASE_M = 0.3


@dataclass(frozen=True)
class _Model:
    """One explanation on one set of runs: what it predicts (k,), and its slopes (k, p).

    The k values are the wheels' speeds row by row, then forward, lateral and turn of each window of the pose.
    """

    columns: tuple[Column, ...]
    values: FloatArray
    slopes: FloatArray


def propose(
    explanations: Sequence[Explanation],
    recordings: RecordingSet,
    noise: Sequence[SignalNoise],
    limits: Limits | None = None,
) -> NextExperiment | None:
    """The drive that maximises the smallest expected difference between any two explanations.

    Parameters
    ----------
    explanations : two or more, fitted to `recordings`.
    noise : of the wheels' speeds in these recordings, and of the pose where they have one.
    limits : None: full effort, and the floor that the recordings themselves used (2 m at least).
    """
    if len(explanations) < 2:
        return None
    comparison = _DriveComparison(explanations, recordings, noise)
    data = comparison.known.data
    limits = limits or Limits(floor_m=max(MIN_FLOOR_M, reach(data)))
    axis = recordings.axis
    if axis is not None:
        limits = replace(
            limits, alike=True, floor_m=math.inf if axis.motion == "rotation" else limits.floor_m
        )
    rate = 1.0 / float(np.median(data.interval_s))
    library = list(candidate_plans(comparison.robot(), limits, rate))
    if not library:
        return None
    scores = comparison.linearised([plan for _, plan in library])
    first = [int(k) for k in np.argsort(-scores)[:REFITTED_DRIVES]]
    refined = {k: comparison.refitted(library[k][1]) for k in first}
    best = max(refined.values())
    good = [k for k, score in refined.items() if score >= COMPARABLE_SHARE * best]
    chosen = min(good, key=lambda k: (library[k][1].duration_s, -refined[k]))
    profile, plan = library[chosen]
    separates = tuple(one.effects for one in explanations)
    why = _why(profile, explanations, refined[chosen]) + _direct_measurement_text(
        explanations, comparison.indistinguishable
    )
    return NextExperiment(plan, separates, refined[chosen], why)


def reach(data: SetData) -> float:
    """How far from its start the robot's middle got in any recorded run, m."""
    return float(np.abs(data.travel_m.mean(axis=1)).max())


def _why(profile: Profile, explanations: Sequence[Explanation], score: float) -> str:
    names = joined([" with ".join(map(effect_title, one.effects)) for one in explanations], "and")
    names = names if len(explanations) == 2 else "these explanations"
    expected = f"the closest two would differ by {score:.1f} times the noise, the rival refitted"
    if score < 0.5 * CLEARLY_DIFFERENT:
        option = how_to_resolve(name for one in explanations for name in one.effects)
        direct = f"; or measure directly, and give {option}" if option else ""
        return (
            f"No safe run within the robot's limits distinguishes {names} well; this is the best one: "
            f"{expected}. More floor, a faster log or a pose from outside would help{direct}"
        )
    again = "" if score >= CLEARLY_DIFFERENT else ", so drive it two or three times"
    return f"It distinguishes {names}: {_catalogue_hint(explanations) or profile.shows}; {expected}{again}"


def _direct_measurement_text(
    explanations: Sequence[Explanation], indistinguishable: set[tuple[int, int]]
) -> str:
    """Explanations that no drive distinguishes, and what would."""
    from truing.diagnose.catalogue import CATALOGUE

    texts = []
    for first, second in sorted(
        pair for pair in indistinguishable if pair[0] < pair[1] and pair[::-1] in indistinguishable
    ):
        one, other = explanations[first].effects, explanations[second].effects
        names = [name for name in one if name not in other] + [name for name in other if name not in one]
        text = f"no drive distinguishes {joined([effect_title(name) for name in names], 'from')}"
        hint = CATALOGUE[names[0]].separated_by.get(names[-1], "") if len(names) == 2 else ""
        text = f"{text} ({hint})" if hint else text
        option = how_to_resolve(names)
        texts.append(f"{text}: give what you measure with {option}" if option else text)
    return "".join(f"; {text}" for text in texts)


def _catalogue_hint(explanations: Sequence[Explanation]) -> str:
    """The catalogue's advice for separating the first two, where each is a single effect."""
    from truing.diagnose.catalogue import CATALOGUE

    names = [one.effects[0] for one in explanations[:2] if len(one.effects) == 1]
    if len(names) < 2 or any(name not in CATALOGUE for name in names):
        return ""
    first, second = names
    return CATALOGUE[first].separated_by.get(second, "") or CATALOGUE[second].separated_by.get(first, "")


class _DriveComparison:
    """Simulates drives after the recordings that exist, under every explanation."""

    def __init__(
        self, explanations: Sequence[Explanation], recordings: RecordingSet, noise: Sequence[SignalNoise]
    ) -> None:
        self.explanations = explanations
        self.recordings = recordings
        self.noise = {entry.signal: entry for entry in noise}
        self.known = SetSimulator(set_data(recordings))
        self.horizon_s = self.known.data.pose_horizon_s
        # Pairs (truth, rival) in which the rival contains the truth as a special case: no run refutes it,
        # its extra parameter is estimated as zero instead. And pairs that no drive distinguishes.
        self.contained: set[tuple[int, int]] = set()
        self.indistinguishable: set[tuple[int, int]] = set()

    def robot(self) -> Robot:
        """The robot's parameters that the library needs."""
        theta = self.explanations[0].theta
        base = self.known.data.baseline.wheelbase_m
        gain, constant = float(max(theta[0], theta[2])), float(max(theta[1], theta[3]))
        return Robot(gain, constant, DEFAULT_WHEELBASE_M if base is None else base)

    def linearised(self, plans: Sequence[Plan]) -> FloatArray:
        """Smallest whitened difference for each drive, shape (plans,); all are simulated in one go."""
        simulator = self._simulator(plans)
        weights, drive = self._weights(simulator), self._drive(simulator)
        models = [self._model(simulator, one) for one in self.explanations]
        squares: dict[tuple[int, int], FloatArray] = {}
        for pair in itertools.permutations(range(len(models)), 2):
            truth, rival = models[pair[0]], models[pair[1]]
            gap = weights * (truth.values - rival.values)
            slopes = weights[:, None] * rival.slopes
            prior = _prior(rival.columns)
            known = _normal(gap[drive < 0], slopes[drive < 0])
            settled = _remaining_gap(known, prior)
            squares[pair] = np.zeros(len(plans))
            for k in range(len(plans)):
                more = _normal(gap[drive == k], slopes[drive == k])
                both = (known[0] + more[0], known[1] + more[1], known[2] + more[2])
                squares[pair][k] = max(_remaining_gap(both, prior) - settled, 0.0)
        self.contained = {
            pair for pair, found in squares.items() if found.sum() < CONTAINED * squares[pair[::-1]].sum()
        }
        asked = squares.keys() - self.contained
        self.indistinguishable = {pair for pair in asked if squares[pair].max() < INDISTINGUISHABLE**2}
        if self.indistinguishable == asked:
            self.indistinguishable = set()
        tested = [squares[pair] for pair in asked - self.indistinguishable]
        return np.asarray(np.sqrt(np.min(tested, axis=0)))

    def refitted(self, plan: Plan) -> float:
        """Smallest whitened difference for one drive, the rival refitted on it and on the recordings."""
        simulator = self._simulator([plan])
        weights, old = self._weights(simulator), self._drive(simulator) < 0
        smallest = math.inf
        for pair in itertools.permutations(range(len(self.explanations)), 2):
            if pair in self.contained | self.indistinguishable:
                continue
            truth, rival = self.explanations[pair[0]], self.explanations[pair[1]]
            target = self._values(simulator, self._theta(simulator, truth), truth.effects)
            smallest = min(smallest, self._gap(simulator, target, rival, weights, old))
        return math.sqrt(max(smallest, 0.0))

    def _gap(
        self,
        simulator: SetSimulator,
        target: FloatArray,
        rival: Explanation,
        weights: FloatArray,
        old: BoolArray,
    ) -> float:
        """Squared whitened distance of the refitted rival from `target` that the drive adds."""
        columns = self._columns(simulator, rival)
        start = self._theta(simulator, rival)

        def place(x: FloatArray) -> FloatArray:
            theta = start.copy()
            for value, column in zip(x, columns, strict=True):
                theta[list(column.entries)] = value
            return theta

        def residual(x: FloatArray) -> FloatArray:
            return weights * (target - self._values(simulator, place(x), rival.effects))

        def jacobian(x: FloatArray, _: FloatArray) -> FloatArray:
            return -weights[:, None] * self._slopes(simulator, place(x), rival.effects, columns)

        first = np.array([start[column.entries[0]] for column in columns])
        lower, upper = (np.array([getattr(column, end) for column in columns]) for end in ("lower", "upper"))
        flat, slopes = residual(first), jacobian(first, first)
        settled = _remaining_gap(_normal(flat[old], -slopes[old]), _prior(columns))
        end = minimise(residual, jacobian, first, lower, upper, iterations=ITERATIONS, tolerance=1e-3)
        left = residual(end.theta)
        return float(left @ left) - settled

    def _model(self, simulator: SetSimulator, one: Explanation) -> _Model:
        theta, columns = self._theta(simulator, one), self._columns(simulator, one)
        values = self._values(simulator, theta, one.effects)
        return _Model(columns, values, self._slopes(simulator, theta, one.effects, columns))

    def _values(self, simulator: SetSimulator, theta: FloatArray, effects: tuple[str, ...]) -> FloatArray:
        """Predicted values of every signal, shape (k,)."""
        on = simulator.enabled(effects)
        return np.concatenate((simulator.speeds(theta, on).ravel(), self._pose(simulator, theta, effects)))

    def _pose(self, simulator: SetSimulator, theta: FloatArray, effects: tuple[str, ...]) -> FloatArray:
        """Displacements over the windows, flat; the measured part is the same for all and cancels."""
        if not len(simulator.windows(self.horizon_s)):
            return np.zeros(0)
        missed = simulator.pose_residuals(theta, simulator.enabled(effects), self.horizon_s)
        return -np.nan_to_num(missed).ravel()

    def _slopes(
        self,
        simulator: SetSimulator,
        theta: FloatArray,
        effects: tuple[str, ...],
        columns: Sequence[Column],
    ) -> FloatArray:
        """Derivatives of all values by the free numbers, shape (k, p)."""
        entries = [entry for column in columns for entry in column.entries]
        raw = simulator.jacobian(theta, simulator.enabled(effects), entries)
        wheels = raw.reshape(-1, len(entries))
        at = self._pose(simulator, theta, effects)
        slopes = np.zeros((len(wheels) + len(at), len(columns)))
        first = 0
        for k, column in enumerate(columns):
            last = first + len(column.entries)
            slopes[: len(wheels), k] = wheels[:, first:last].sum(axis=1)
            first = last
            if len(at) and moves_pose(column, simulator.data.commanded):
                moved = theta.copy()
                step = simulator.derivative_step(theta, column.entries[0])
                moved[list(column.entries)] += step
                slopes[len(wheels) :, k] = (self._pose(simulator, moved, effects) - at) / step
        return slopes

    def _columns(self, simulator: SetSimulator, one: Explanation) -> tuple[Column, ...]:
        base = base_columns(simulator, simulator.tied, simulator.baseline_effects)
        return base + tuple(
            column for name in one.effects for column in effect_columns(simulator, name, one.effects)
        )

    def _theta(self, simulator: SetSimulator, one: Explanation) -> FloatArray:
        """The explanation's numbers in the units of a set that is longer by some drives."""
        return np.asarray(one.theta * self.known.layout.scale / simulator.layout.scale)

    def _simulator(self, plans: Sequence[Plan]) -> SetSimulator:
        """The recordings with the drives behind them; wheel motion by the first explanation."""
        at_rest = [_as_run(plan, self.recordings, None, number) for number, plan in enumerate(plans)]
        preliminary = SetSimulator(set_data(self._with(at_rest)))
        one = self.explanations[0]
        speeds = preliminary.speeds(self._theta(preliminary, one), preliminary.enabled(one.effects))
        moving = []
        for number, plan in enumerate(plans):
            rows = preliminary.data.rows_of(len(self.recordings) + number)
            moving.append(_as_run(plan, self.recordings, speeds[rows], number))
        return SetSimulator(set_data(self._with(moving)))

    def _with(self, runs: Sequence[Run]) -> RecordingSet:
        return replace(self.recordings, runs=(*self.recordings.runs, *runs))

    def _weights(self, simulator: SetSimulator) -> FloatArray:
        """One over the noise that each value counts with, shape (k,); zero where it is not used.

        Counting noise grows with the log rate; a disturbance that outlasts a row makes rows count less.
        """
        data = simulator.data
        weights = np.zeros((len(data), 2))
        usual = float(np.median(self.known.data.interval_s))
        for column, wheel in enumerate(WHEELS):
            entry = self.noise.get(f"vel_{wheel}_mps")
            if entry is None:
                continue
            counting = entry.quantisation * usual / data.dt_s
            lasting = np.maximum(2.0 * entry.correlation_s / data.dt_s, 1.0)
            weights[:, column] = 1.0 / np.sqrt(counting**2 + entry.disturbance**2 * lasting + 1e-12)
        weights[~data.judged] = 0.0
        signals = TRUTH_COLUMNS if data.has_truth else ("", "", GYRO_COLUMN)
        seen = [self.noise.get(signal) for signal in signals]
        pose_weights = [0.0 if entry is None else 1.0 / entry.rms for entry in seen]
        return np.concatenate(
            (weights.ravel(), np.tile(pose_weights, len(simulator.windows(self.horizon_s))))
        )

    def _drive(self, simulator: SetSimulator) -> IntArray:
        """The drive that each value belongs to, shape (k,); below zero those of the recordings."""
        wheels = np.repeat(simulator.data.run_of_row, 2)
        windows = np.repeat(simulator.windows(self.horizon_s).run, 3)
        return np.asarray(np.concatenate((wheels, windows)) - len(self.recordings), dtype=np.int64)


_Normal = tuple[FloatArray, FloatArray, float]


def _normal(gap: FloatArray, slopes: FloatArray) -> _Normal:
    """Normal equations of moving the rival by some of its slopes to close the gap."""
    return slopes.T @ slopes, slopes.T @ gap, float((gap**2).sum())


def _prior(columns: Sequence[Column]) -> FloatArray:
    """Precision of the weak prior, shape (p,)."""
    return np.array([1.0 / (PRIOR_SHARE * max(column.upper - column.lower, 1e-9)) ** 2 for column in columns])


def _remaining_gap(normal: _Normal, prior: FloatArray) -> float:
    """Minimum of the squared gap over the rival's parameters."""
    matrix, vector, square = normal
    step = np.linalg.solve(matrix + np.diag(prior), vector)
    return float(square - vector @ step)


def _as_run(plan: Plan, recordings: RecordingSet, speeds: FloatArray | None, number: int) -> Run:
    """A drive as a run with the columns of the recorded runs; wheels at rest where `speeds` is None."""
    rate = plan.log_rate_hz or recordings.runs[0].rate_hz
    count = max(math.ceil(plan.duration_s * rate), 20) + 1
    t_s = np.arange(count) / rate
    edges = np.concatenate(([0.0], np.cumsum([segment.duration_s for segment in plan.segments])))
    columns = {"t_s": t_s}
    for side, values in (("left", [s.a for s in plan.segments]), ("right", [s.b for s in plan.segments])):
        # Mean over each row's interval, from the integral of the effort.
        levels = np.array(values)
        integral = np.concatenate(([0.0], np.cumsum(levels * np.diff(edges))))
        at = np.interp(t_s, edges, integral)
        columns[f"effort_{side}"] = np.concatenate(([levels[0]], np.diff(at) * rate))
    speeds = np.zeros((count, 2)) if speeds is None else speeds
    travel = np.cumsum(speeds, axis=0) / rate
    scale = None if recordings.baseline is None else recordings.baseline.metres_per_count
    for source, names in MOTION_PAIRS.items():
        if not all(run.has_pair(source) for run in recordings):
            continue
        for column, name in enumerate(names):
            if source == "vel":
                columns[name] = speeds[:, column]
            elif source == "pos":
                columns[name] = travel[:, column]
            else:
                columns[name] = np.rint(travel[:, column] / (scale or 1.0))
    base = None if recordings.baseline is None else recordings.baseline.wheelbase_m
    poses = _dead_reckoned(speeds, rate, base) if base else {}
    columns |= {name: pose for name, pose in poses.items() if all(name in run.columns for run in recordings)}
    return Run(f"~{number:03d}_{plan.name}", columns)


def _dead_reckoned(speeds: FloatArray, rate_hz: float, wheelbase_m: float) -> dict[str, FloatArray]:
    """Dead-reckoned pose of ideal wheels (n, 2), as an outside reference would log it."""
    turn_radps = (speeds[:, 1] - speeds[:, 0]) / wheelbase_m
    heading = np.cumsum(turn_radps) / rate_hz
    forward_m = speeds.mean(axis=1) / rate_hz
    x_m, y_m = np.cumsum(forward_m * np.cos(heading)), np.cumsum(forward_m * np.sin(heading))
    return {**dict(zip(TRUTH_COLUMNS, (x_m, y_m, heading), strict=True)), GYRO_COLUMN: turn_radps}
