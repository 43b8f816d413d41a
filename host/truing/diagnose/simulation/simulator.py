"""Free-run simulation of a whole recording set: a vector of numbers in, reported speeds and poses out."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.diagnose.catalogue import CATALOGUE, Catalogue
from truing.diagnose.data.set_data import GRAVITY, SetData
from truing.diagnose.effect import SIDES, Parameter, Scale
from truing.diagnose.simulation.assemble import BASELINE_PARAMETERS, kernel_of, parameter_offsets
from truing.diagnose.simulation.state import Inputs, Scratch, new_scratch
from truing.diagnose.simulation.windows import Windows, pose_windows
from truing.errors import TruingError
from truing.recording.baseline import Baseline

# Derivatives: a step of this share of the parameter's own size (or of its weak start).
DERIVATIVE_SHARE = 1e-4
MIN_STEP_S = 5e-4
# Where the measured speeds change by less than this share of full speed per time constant, substeps may be
# longer by this factor. Measured, not simulated: derivatives by differences need the same substeps.
STEADY_SHARE = 0.15
STEADY_FACTOR = 3.0
# The currents that charge and heat are made of need no fine substeps.
CURRENTS_FACTOR = 3.0
# Derivatives that are kept: as many as a fit without a part of the runs takes steps, and where it began.
KEPT_JACOBIANS = 4


@dataclass(frozen=True)
class Layout:
    """Where each number stands in the simulator's vector.

    Attributes
    ----------
    names : "gain_left", "tau_left", "gain_right", "tau_right", then "<effect>.<parameter>".
    lower, upper : shape (p,), bounds of the vector's numbers (multiples of `scale`).
    scale : shape (p,), plain unit per number of the vector.
    """

    names: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray
    scale: FloatArray
    wheel: tuple[str | None, ...]
    owner: tuple[str, ...]
    _index: dict[str, int]

    def index(self, name: str) -> int:
        """Place of a number by its name."""
        return self._index[name]

    def __len__(self) -> int:
        return len(self.names)


class SetSimulator:
    """Simulates every run of a set from its efforts alone.

    The vector `theta` holds the baseline's four numbers in m/s and s, then every effect's parameters as
    multiples of their scale (`Parameter.scale`); `report` turns them into the documented ones.

    Parameters
    ----------
    data : the recordings.
    baseline : what the user's simulation knows; the data's own where None.
    catalogue : the effects to compile in.
    step_factor : makes every substep shorter (or longer), to see what steps do to a result.
    commanded : poses are predicted from the simulated wheels instead of the measured ones (what the robot
        would do when commanded), for recordings whose encoders see the drift themselves.
    """

    def __init__(
        self,
        data: SetData,
        baseline: Baseline | None = None,
        catalogue: Catalogue = CATALOGUE,
        step_factor: float = 1.0,
        commanded: bool = False,
    ) -> None:
        self.data = data
        self.baseline = data.baseline if baseline is None else baseline
        self.catalogue = catalogue
        self.step_factor = step_factor
        self.commanded = commanded
        self._windows: dict[float, Windows] = {}
        self._chosen = np.arange(data.segments, dtype=np.int64)
        self._rows = np.arange(len(data))
        self._kernel = kernel_of(catalogue, len(data.sides))
        self._offsets = parameter_offsets(catalogue)
        self._prepare()
        self.layout = self._make_layout()
        self._check_baseline_effects()

    @property
    def tied(self) -> bool:
        """Whether the baseline has both wheels equal, so that a refit keeps them equal."""
        return self.baseline.has_equal_wheels

    @property
    def baseline_effects(self) -> tuple[str, ...]:
        """Effects that the user's simulation already contains."""
        return tuple(name for name in self.catalogue.names if name in self.baseline.effects)

    def start(self) -> FloatArray:
        """The baseline's own numbers, every other effect off, shape (p,)."""
        theta = np.zeros(len(self.layout))
        left, right = self.baseline.left, self.baseline.right
        theta[:4] = left.gain_mps, left.time_constant_s, right.gain_mps, right.time_constant_s
        for name, effect in self.catalogue.items():
            offset = self._offsets[name]
            for k, item in enumerate(effect.parameters):
                theta[offset + k] = item.off
            if name in self.baseline.effects:
                given = {key: float(value) for key, value in self.baseline.effects[name].items()}
                numbers = dict(zip(self.layout.names[:4], theta[:4].tolist(), strict=True))
                for key, value in effect.internal(given | numbers).items():
                    if key not in numbers:
                        index = self.layout.index(f"{name}.{key}")
                        theta[index] = value / self.layout.scale[index]
        return theta

    def enabled(self, effects: Iterable[str]) -> BoolArray:
        """A mask of the catalogue's effects, shape (effects,); the baseline's own are always on."""
        wanted = {*effects, *self.baseline_effects}
        unknown = wanted - set(self.catalogue)
        if unknown:
            raise TruingError(f"no effect is called {min(unknown)!r}")
        return np.array([name in wanted for name in self.catalogue.names], dtype=bool)

    def report(self, effect: str, theta: FloatArray) -> dict[str, float]:
        """The documented parameters of one effect, in their units."""
        plain = theta * self.layout.scale
        offset = self._offsets[effect]
        parameters = self.catalogue[effect].parameters
        values = {item.name: float(plain[offset + k]) for k, item in enumerate(parameters)}
        values |= {name: float(plain[k]) for k, name in enumerate(self.layout.names[:4])}
        return self.catalogue[effect].reported(values)

    def internal(self, effect: str, theta: FloatArray) -> dict[str, float]:
        """All parameters of one effect by their internal names, nuisance ones too, in plain units."""
        names = [item.name for item in self.catalogue[effect].parameters]
        plain = theta * self.layout.scale
        return {name: float(plain[self._offsets[effect] + k]) for k, name in enumerate(names)}

    def range_of(self, effect: str, name: str) -> tuple[float, float]:
        """Smallest and largest value that a reported parameter of an effect can have, in its unit."""
        entry = self.catalogue[effect]
        for k, item in enumerate(entry.parameters):
            if item.name == name:
                scale = float(self.layout.scale[self._offsets[effect] + k])
                return item.lower * scale, item.upper * scale
        return (0.0 if name in entry.non_negative else -math.inf), math.inf

    def units(self, effect: str) -> dict[str, str]:
        """Units of what `report` gives."""
        entry = self.catalogue[effect]
        own = {item.name: item.unit for item in entry.parameters} | dict(entry.units)
        return {name: own[name] for name in self.report(effect, self.start())}

    def speeds(self, theta: FloatArray, on: BoolArray) -> FloatArray:
        """Reported speeds, shape (n, 2), m/s; rows of a segment's start hold its initial speed."""
        out, _ = self._simulate(theta, on)
        return np.asarray(out[self._rows])

    def currents(self, theta: FloatArray, on: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Mean squared motor current of each wheel (n, 2) and battery current (n,), of stall current."""
        p, active, step_s = self._pack(theta, on)
        scratch = self._new_scratch()
        slow_bits = self._mask("slow")
        self._run(p, active, step_s, scratch, self._all, track=slow_bits)
        return scratch.heat[self._rows], scratch.draw[self._rows]

    def ground(self, theta: FloatArray, on: BoolArray) -> FloatArray:
        """Body increments of every row from measured wheel travel, shape (n, 3).

        Columns: forward m, turn rad (0 without a wheelbase), lateral m. A segment's first row has none.
        The wheels are simulated only where an effect needs it (slip, backlash).
        """
        p, active, _ = self._pack(theta, on)
        travel = self._measured
        lost = np.zeros_like(travel)
        if self.commanded or active & (self._mask("grip") | self._mask("gap")):
            speeds, lost = self._simulate(theta, on)
            if self.commanded:
                travel = speeds * self.data.dt_s[:, None]
        out = np.zeros((len(self.data), 3))
        self._kernel.ground_motion(p, active, self._inputs, travel, lost, out)
        return np.asarray(out[self._rows])

    def windows(self, horizon_s: float = 1.0) -> Windows:
        """The windows that `pose_residuals` judges."""
        if horizon_s not in self._windows:
            self._windows[horizon_s] = pose_windows(self.data, horizon_s)
        return self._windows[horizon_s]

    def pose_residuals(self, theta: FloatArray, on: BoolArray, horizon_s: float = 1.0) -> FloatArray:
        """Measured minus predicted displacement over each window, shape (m, 3).

        Forward m and lateral m in the body frame at the window's start, and turn rad; NaN where nothing
        measured it (a gyro measures the turn alone).
        """
        windows = self.windows(horizon_s)
        predicted = np.zeros((len(windows), 3))
        if len(self._rows) == len(self.data):
            motion = self.ground(theta, on)
        else:
            motion = np.zeros((len(self.data), 3))
            motion[self._rows] = self.ground(theta, on)
        self._kernel.windowed_motion(motion, windows.first, windows.last, predicted)
        return np.asarray(windows.measured - predicted)

    def pose_runs(self, windows_per_block: int = 1, horizon_s: float | None = None) -> IntArray:
        """Block number of each window of `pose_residuals`, shape (m,); no block spans two runs."""
        return self.windows(horizon_s or self.data.pose_horizon_s).blocks(windows_per_block)

    def jacobian(self, theta: FloatArray, on: BoolArray, free: Sequence[int]) -> FloatArray:
        """Derivatives of the speeds, shape (n, 2, len(free)), by differences.

        While no effect lets one wheel move the other, a parameter of the left wheel and its twin of the
        right one are moved in one simulation. The last few are kept: fits that leave out a part of the
        runs each, or are continued, begin at the same numbers. Do not write to the result.
        """
        p, active, _ = self._pack(theta, on)
        asked = (active, p.tobytes(), tuple(free))
        found = self._jacobians.pop(asked, None)
        if found is None:
            found = self._differences(theta, on, free)
            if len(self._jacobians) == KEPT_JACOBIANS:
                del self._jacobians[next(iter(self._jacobians))]
        self._jacobians[asked] = found
        return found

    def _differences(self, theta: FloatArray, on: BoolArray, free: Sequence[int]) -> FloatArray:
        base = self.speeds(theta, on)
        out = np.zeros((*base.shape, len(free)))
        coupled = any(
            self.catalogue[name].couples for name, use in zip(self.catalogue.names, on, strict=True) if use
        )
        waiting = {column: index for column, index in enumerate(free) if self._is_simulated(index)}
        while waiting:
            column, index = next(iter(waiting.items()))
            del waiting[column]
            together = [(column, index)]
            side = self.layout.wheel[index]
            if side is not None and not coupled:
                for other, place in waiting.items():
                    if self.layout.wheel[place] not in (None, side):
                        together.append((other, place))
                        del waiting[other]
                        break
            moved = theta.copy()
            steps = [self.derivative_step(theta, place) for _, place in together]
            for (_, place), size in zip(together, steps, strict=True):
                moved[place] += size
            change = self.speeds(moved, on) - base
            for (which, place), size in zip(together, steps, strict=True):
                if len(together) == 1:
                    out[:, :, which] = change / size
                else:
                    wheel = 0 if self.layout.wheel[place] == "left" else 1
                    out[:, wheel, which] = change[:, wheel] / size
        return out

    def _is_simulated(self, index: int) -> bool:
        """Whether a number belongs to a wheel that is simulated, or to no single one."""
        side = self.layout.wheel[index]
        return side is None or SIDES.index(side) in self.data.sides

    def derivative_step(self, theta: FloatArray, index: int) -> float:
        """A step for differences that stays within the bounds."""
        size = DERIVATIVE_SHARE * max(abs(float(theta[index])), float(self._typical[index]))
        return -size if theta[index] + size > self.layout.upper[index] else size

    def select(self, runs: Sequence[int]) -> SetSimulator:
        """A simulator that gives the rows of these runs only.

        Effects whose state lives over the whole set (charge, heat) still see every run before: only
        their first pass runs over all of them.
        """
        chosen = copy.copy(self)
        keep = np.isin(self.data.run_of_segment, np.asarray(list(runs), dtype=np.int64))
        chosen._chosen = np.flatnonzero(keep).astype(np.int64)
        chosen._rows = np.flatnonzero(np.isin(self.data.run_of_row, np.asarray(list(runs), dtype=np.int64)))
        chosen._scratch = chosen._new_scratch()
        chosen._known = (-1, b"")
        chosen._jacobians = {}
        return chosen

    @property
    def rows(self) -> IntArray:
        """Rows of the set that the results belong to."""
        return self._rows

    def _make_layout(self) -> Layout:
        names = ["gain_left", "tau_left", "gain_right", "tau_right"]
        both = (self.baseline.left, self.baseline.right)
        start = [value for wheel in both for value in (wheel.gain_mps, wheel.time_constant_s)]
        lower = [0.02 * value for value in start]
        upper = [20.0 * value for value in start]
        scale = [1.0] * BASELINE_PARAMETERS
        wheel: list[str | None] = ["left", "left", "right", "right"]
        owner = [""] * BASELINE_PARAMETERS
        typical = list(start)
        for name, effect in self.catalogue.items():
            for item in effect.parameters:
                names.append(f"{name}.{item.name}")
                lower.append(item.lower)
                upper.append(item.upper)
                scale.append(self._scale(item))
                wheel.append(item.wheel)
                owner.append(name)
                typical.append(_typical(item))
        self._typical = np.array(typical)
        return Layout(
            tuple(names),
            np.array(lower),
            np.array(upper),
            np.array(scale),
            tuple(wheel),
            tuple(owner),
            {name: index for index, name in enumerate(names)},
        )

    def _scale(self, item: Parameter) -> float:
        left, right = self.baseline.left, self.baseline.right
        top = max(left.gain_mps, right.gain_mps)
        values: dict[Scale, float] = {
            "one": 1.0,
            "speed": top,
            "per_speed_squared": 1.0 / top**2,
            "duration": max(self.data.duration_s, 1e-9),
            "time_constant": 0.5 * (left.time_constant_s + right.time_constant_s),
            "acceleration": top / (0.5 * (left.time_constant_s + right.time_constant_s)) / GRAVITY,
        }
        return values[item.scale]

    def _prepare(self) -> None:
        """Everything that the kernel reads and that does not depend on the numbers."""
        data = self.data
        count = max(len(pieces.end_s) for pieces in data.pieces)
        piece_end, piece_effort = np.full((2, count), math.inf), np.zeros((2, count))
        for w, pieces in enumerate(data.pieces):
            piece_end[w, : len(pieces.end_s)] = pieces.end_s
            piece_effort[w, : len(pieces.end_s)] = pieces.effort
        nothing = np.zeros((len(data), 2))
        angles = nothing if data.angle_rad is None else data.angle_rad
        origins = nothing if data.origin_rad is None else data.origin_rad
        top_mps = np.array(self.baseline.full_effort_mps)
        self._inputs = Inputs(
            start=data.starts,
            first_piece=np.stack([pieces.starts for pieces in data.pieces]).astype(np.int64),
            piece_end=piece_end,
            piece_effort=piece_effort,
            t=data.t_s,
            dt=data.dt_s,
            elapsed=data.elapsed_s,
            interval=data.interval_s,
            initial=data.initial_mps,
            angles=angles,
            angle_rates=nothing if data.angle_rad is None else _rates(angles, data),
            origins=np.ascontiguousarray(origins[data.starts[:-1]]),
            heading=np.zeros(len(data)) if data.heading_rad is None else data.heading_rad,
            radius=float(data.wheel_radius_m or 1.0),
            top=top_mps,
            wheelbase=float(self.baseline.wheelbase_m or math.inf),
            instant=data.instant,
        )
        self._measured = np.zeros((len(data), 2))
        self._measured[1:] = np.diff(data.travel_m, axis=0)
        self._measured[data.first] = 0.0
        self._all = np.arange(data.segments, dtype=np.int64)
        self._smallest_tau = min(self.baseline.left.time_constant_s, self.baseline.right.time_constant_s)
        self._coarser = np.where(_steady(data, top_mps, self._smallest_tau), STEADY_FACTOR, 1.0)
        self._ones = np.ones(len(data))
        self._unsettled = sum(1 << bit for bit, one in enumerate(self.catalogue.values()) if not one.settles)
        self._scratch = self._new_scratch()
        self._known = (-1, b"")
        self._known_steps_s: dict[int, float] = {}
        self._jacobians: dict[tuple[int, bytes, tuple[int, ...]], FloatArray] = {}  # the latest last

    def _new_scratch(self) -> Scratch:
        stage = self._kernel.stage
        return new_scratch(len(self.data), int(stage.SLOW_SLOTS), int(stage.STATE_SLOTS))

    def _check_baseline_effects(self) -> None:
        for name, table in self.baseline.effects.items():
            if name not in self.catalogue:
                raise TruingError(f"{self.baseline.path}: [effect.{name}] is no effect of the catalogue")
            for key, value in table.items():
                if isinstance(value, bool) or not isinstance(value, (int, float)):
                    raise TruingError(f"{self.baseline.path}: [effect.{name}] {key} must be a number")

    def _mask(self, hook: str) -> int:
        return int(getattr(self._kernel.stage, f"USES_{hook.upper()}"))

    def _pack(self, theta: FloatArray, on: BoolArray) -> tuple[FloatArray, int, float]:
        p = np.ascontiguousarray(theta * self.layout.scale)
        active = sum(1 << bit for bit, use in enumerate(on) if use)
        return p, active, self._step_s(active)

    def _step_s(self, active: int) -> float:
        """The longest substep that solves these effects together; infinite where every step is exact."""
        if active not in self._known_steps_s:
            self._known_steps_s[active] = self._longest_step_s(active)
        return self._known_steps_s[active]

    def _longest_step_s(self, active: int) -> float:
        wanted = [
            effect
            for bit, effect in enumerate(self.catalogue.values())
            if active >> bit & 1 and effect.step_share < math.inf
        ]
        if not wanted or (len(wanted) == 1 and wanted[0].exact):
            return math.inf
        share = min(effect.step_share for effect in wanted)
        return max(share * self._smallest_tau, MIN_STEP_S) * self.step_factor

    def _simulate(self, theta: FloatArray, on: BoolArray) -> tuple[FloatArray, FloatArray]:
        p, active, step_s = self._pack(theta, on)
        scratch = self._scratch
        # Poses are asked for at the numbers that the speeds were just asked for.
        asked = (active, p.tobytes())
        if asked == self._known:
            return scratch.speed, scratch.lost
        self._known = (-1, b"")
        slow_bits = active & self._mask("slow")
        if slow_bits:
            # First pass without the slow effects: their states follow from its currents.
            scratch.slows[:] = 0.0
            others = active & ~slow_bits
            coarse_s = CURRENTS_FACTOR * self._step_s(others)
            self._run(p, others, coarse_s, scratch, self._all, track=self._mask("slow"))
            self._kernel.slow(
                p, active, self.data.dt_s, scratch.heat, scratch.draw, self.data.elapsed_s, scratch.slows
            )
        self._run(p, active, step_s, scratch, self._chosen)
        self._known = asked
        return scratch.speed, scratch.lost

    def _run(
        self, p: FloatArray, active: int, step_s: float, scratch: Scratch, chosen: IntArray, track: int = 0
    ) -> None:
        coarser = self._coarser if active & self._unsettled == 0 else self._ones
        self._kernel.rollout(p, active, track != 0, chosen, step_s, coarser, self._inputs, scratch)

    @cached_property
    def effects(self) -> tuple[str, ...]:
        """All effects by name, in the order of the mask."""
        return self.catalogue.names


def _typical(item: Parameter) -> float:
    """The size of a parameter where it is weak: what a step for differences is measured by."""
    sizes = [abs(value - item.off) for value in item.starts if value != item.off]
    if sizes:
        return min(sizes)
    return min(item.upper - item.lower, max(abs(item.upper), abs(item.lower)))


def _steady(data: SetData, top_mps: FloatArray, tau_s: float) -> BoolArray:
    """Rows in and beside which both measured speeds hardly change and no wheel creeps, shape (n,)."""
    speed = np.abs(data.speed_mps / top_mps)
    change = np.zeros(len(data))
    change[1:] = np.abs(np.diff(data.speed_mps / top_mps, axis=0)).max(axis=1)
    change /= STEADY_SHARE * data.dt_s / tau_s
    sure = (change < 1.0) & ((speed > 0.05) | (speed < 0.01)).all(axis=1)
    steady = sure.copy()
    steady[1:] &= sure[:-1]
    steady[:-1] &= sure[1:]
    return np.asarray(steady)


def _rates(angles: FloatArray, data: SetData) -> FloatArray:
    """Measured wheel rates at the rows, shape (n, 2), rad/s: the mean of both neighbouring intervals."""
    rates = np.zeros_like(angles)
    for a, b in pairwise(data.starts):
        mean = np.diff(angles[a:b], axis=0) / data.dt_s[a + 1 : b, None]
        rates[a], rates[b - 1] = mean[0], mean[-1]
        rates[a + 1 : b - 1] = 0.5 * (mean[1:] + mean[:-1])
    return rates
