"""What acts for some time only does so at its times, in its runs, and with the strength that is asked for."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import pytest

from hil_sim.host_robot import Placing, replay
from truing.arrays import FloatArray
from truing.plan import load_plan
from truing.trial.effects import CATALOGUE, INTERMITTENT, OUTSIDE
from truing.trial.order import tasks
from truing.trial.recording_builder import prepare_trial
from truing.trial.robot import Robot
from truing.trial.sealed_process import family_of
from truing.trial.spec import draw_trial, with_strengths

Value: TypeAlias = float | tuple[float, float]

pytestmark = pytest.mark.usefixtures("native_library")

# A run is 10 s long after the robot was let go, and drives from the first second on until the ninth.
RUN_S, HELD_S, DRIVE_FROM_S, DRIVE_UNTIL_S = 11.0, 0.5, 1.0, 9.0
EFFORT = 0.4
# So quick a robot that what has acted is forgotten half a second later.
QUICK = Robot(gain_mps=(1.2, 1.2), time_constant_s=(0.06, 0.06))
# Smallest difference of speeds that counts.
SEEN_MPS = 1e-3


@dataclass(frozen=True)
class Driven:
    """Speeds and x of each millisecond after the release, shapes (runs, 10000, 2) and (runs, 10000)."""

    speed_mps: FloatArray
    x_m: FloatArray


def driven(
    runs: int, effort: float = EFFORT, seed: int = 1, theta_rad: float = 0.0, **hidden: Value
) -> Driven:
    """Forward at one effort, run after run, each from the line at this heading."""
    parameters, effects = Robot(**{**QUICK.__dict__, "hidden": hidden}).build()
    begins = [RUN_S * k for k in range(runs)]
    placings = [Placing(at, at + HELD_S, 0.0, 0.0, theta_rad) for at in (begin + 0.1 for begin in begins)]
    time_s = np.arange(round(RUN_S * runs * 1000)) * 1e-3 % RUN_S - 0.1 - HELD_S
    asked = np.where((time_s >= DRIVE_FROM_S) & (time_s < DRIVE_UNTIL_S), effort, 0.0)
    samples = replay(parameters, effects, np.column_stack([asked, asked]), seed, placings)
    travel_m = samples["measured_rad"] * QUICK.radius_m
    speed = np.diff(travel_m, axis=0, prepend=travel_m[:1]) * 1e3
    starts = [round(each.release_s * 1000) for each in placings]
    rows = [slice(start, start + 10_000) for start in starts]
    return Driven(np.stack([speed[each] for each in rows]), np.stack([samples["x_m"][each] for each in rows]))


def changed(runs: int, effort: float = EFFORT, seed: int = 1, **hidden: Value) -> FloatArray:
    """Largest speed difference of either wheel that the effects make, shape (runs, 10000), m/s."""
    with_effect = driven(runs, effort, seed, **hidden).speed_mps
    difference: FloatArray = np.abs(with_effect - driven(runs, effort, seed).speed_mps).max(axis=2)
    return difference


def span(from_s: float, until_s: float) -> slice:
    return slice(round(from_s * 1000), round(until_s * 1000))


CARPET: dict[str, Value] = {
    "intermittent__carpet_nm": (0.2, 0.2),
    "intermittent__carpet_from_s": 3.0,
    "intermittent__carpet_for_s": 2.0,
}
PUSH: dict[str, Value] = {
    "intermittent__push_n": (3.0, 3.0),
    "intermittent__push_share": 1.0,
    "intermittent__push_from_s": 3.0,
    "intermittent__push_for_s": 2.0,
}
BINDING: dict[str, Value] = {
    "intermittent__bind_nm": (0.3, 0.0),
    "intermittent__bind_every_s": 2.0,
    "intermittent__bind_for_s": 0.2,
}
KNOCKS: dict[str, Value] = {
    "intermittent__knock_n": (30.0, 30.0),
    "intermittent__knock_every_s": 2.0,
    "intermittent__knock_for_s": 0.03,
}


@pytest.mark.parametrize("hidden", [CARPET, PUSH], ids=["carpet", "push"])
def test_a_carpet_and_a_push_act_from_their_beginning_to_their_end_in_each_run(
    hidden: dict[str, Value],
) -> None:
    for run in changed(3, **hidden):
        assert run[span(0.0, 2.99)].max() < 1e-9
        assert run[span(3.3, 5.0)].min() > 0.05
        assert run[span(5.8, 9.0)].max() < SEEN_MPS


def test_a_carpet_by_place_acts_where_the_wheels_are_on_it() -> None:
    strip = {"intermittent__carpet_from_m": 1.0, "intermittent__carpet_for_m": 0.5}
    hidden = {"intermittent__carpet_nm": (0.2, 0.2), **strip}
    there = driven(2, **hidden)
    difference = np.abs(there.speed_mps - driven(2).speed_mps).max(axis=2)
    for run, x_m in zip(difference, there.x_m, strict=True):
        assert x_m[-1] > 2.0
        assert run[x_m < 0.99].max() < 1e-9
        assert run[(x_m > 1.2) & (x_m < 1.5)].min() > 0.05
        assert run[(x_m > 1.8)].max() < SEEN_MPS


def test_along_the_edge_of_a_carpet_one_wheel_is_on_it() -> None:
    """Heading along y, the left wheel passes half a wheelbase below x = 0."""
    strip = {"intermittent__carpet_from_m": -0.2, "intermittent__carpet_for_m": 0.1}
    hidden = {"intermittent__carpet_nm": (0.2, 0.2), **strip}
    assert 0.1 < 0.5 * QUICK.wheelbase_m < 0.2
    speed = driven(1, theta_rad=0.5 * math.pi, **hidden).speed_mps[0][span(1.2, 1.6)]
    assert speed[:, 1].min() - speed[:, 0].max() > 0.02


def test_one_wheel_on_the_carpet_is_braked_and_the_robot_turns() -> None:
    speed = driven(1, **(CARPET | {"intermittent__carpet_nm": (0.2, 0.0)})).speed_mps[0][span(4.0, 5.0)]
    assert speed[:, 1].min() - speed[:, 0].max() > 0.05


def test_dry_friction_moves_no_robot_that_stands_and_a_push_does() -> None:
    assert changed(1, effort=0.0, **CARPET, **BINDING).max() == 0.0
    assert changed(1, effort=0.0, **PUSH)[0][span(3.5, 5.0)].min() > 0.05


def test_a_push_comes_in_a_share_of_the_runs_forward_and_back() -> None:
    hidden = PUSH | {"intermittent__push_share": 0.5, "intermittent__push_room_s": 2.0}
    plain, pushed = driven(16).speed_mps, driven(16, **hidden).speed_mps
    difference = (pushed - plain).mean(axis=2)
    there = np.abs(difference).max(axis=1) > SEEN_MPS
    assert 4 <= there.sum() <= 12
    signs = {int(np.sign(each[np.argmax(np.abs(each))])) for each in difference[there]}
    assert signs == {-1, 1}
    begins = np.array([np.flatnonzero(np.abs(each) > SEEN_MPS)[0] for each in difference[there]]) * 1e-3
    assert begins.min() >= 3.0
    assert begins.max() < 5.02
    assert np.ptp(begins) > 0.5


@pytest.mark.parametrize(("hidden", "room_s"), [(BINDING, 0.5), (KNOCKS, 1.97)], ids=["binding", "knocks"])
def test_a_binding_bearing_and_knocks_come_once_in_each_stretch(
    hidden: dict[str, Value], room_s: float
) -> None:
    """A stretch is 2 s long; while the robot drives four have begun."""
    difference = changed(3, **hidden)
    begins = []
    for run in difference:
        rising = np.diff(run, prepend=0.0) > SEEN_MPS
        times_s = np.flatnonzero(rising & (np.arange(len(run)) >= 2000)) * 1e-3
        firsts = [times_s[(times_s >= at) & (times_s < at + 2.0)] for at in (2.0, 4.0, 6.0)]
        for at, group in zip((2.0, 4.0, 6.0), firsts, strict=True):
            assert at <= group[0] < at + room_s + 0.01
            assert np.ptp(group) < 0.21
        begins.append([float(group[0]) for group in firsts])
    assert np.ptp(np.array(begins) % 2.0) > 0.05
    assert len({tuple(each) for each in begins}) == 3


def test_a_bearing_of_one_wheel_binds_that_wheel() -> None:
    speed = driven(1, **BINDING).speed_mps[0] - driven(1).speed_mps[0]
    assert speed[:, 0].min() < 3.0 * speed[:, 1].min()
    assert speed[:, 0].min() < -0.05


def test_the_seed_decides_when_it_acts_and_nothing_else_does() -> None:
    first, again, other = (changed(2, seed=seed, **KNOCKS) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.allclose(first, other, atol=SEEN_MPS)
    # The same moments at another effort: what drives the robot is not asked.
    slow = changed(2, effort=0.5 * EFFORT, **KNOCKS)
    assert np.array_equal(np.argmax(first > SEEN_MPS, axis=1), np.argmax(slow > SEEN_MPS, axis=1))


@pytest.mark.parametrize("name", sorted(INTERMITTENT))
def test_its_draws_are_of_the_seed_and_not_of_the_strength(name: str) -> None:
    trial = draw_trial(5, "intermittent", (name,))
    weak, strong = (with_strengths(trial, (value,)).hidden for value in (0.1, 0.2))
    forces = {key for key in weak if key.endswith(("carpet_nm", "push_n", "bind_nm", "knock_n"))}
    assert len(forces) == 1
    for key, value in weak.items():
        assert np.allclose(np.multiply(value, 2.0 if key in forces else 1.0), strong[key])
    others = with_strengths(draw_trial(6, "intermittent", (name,)), (0.1,)).hidden
    assert any(others.get(key) != value for key, value in weak.items() if key not in forces)


@pytest.mark.parametrize("name", sorted(INTERMITTENT))
def test_its_strength_is_about_the_one_that_was_drawn(name: str) -> None:
    plans = tuple(load_plan(f"diagnosis/{plan}") for plan in ("steps_from_rest", "independent_steps"))
    trial = draw_trial(11, "intermittent", (name,), plans=plans)
    made = prepare_trial(trial)
    assert made.strengths[0] >= 1.0
    assert made.strengths[0] == pytest.approx(trial.effects[0].strength, rel=0.25)


def test_the_block_conceals_its_four_kinds_equally_often_at_full_strength() -> None:
    every = tasks(60, 1, "intermittent")
    assert {name: sum(each.effect == name for each in every) for name in INTERMITTENT} == dict.fromkeys(
        INTERMITTENT, 15
    )
    for each in every:
        family, names = family_of(each.effect)
        assert (family, names) == ("intermittent", (each.effect,))
        assert draw_trial(each.seed, family, names, weak=each.weak).effects[0].strength >= 1.0


def test_the_block_of_gear_backlash_is_of_full_strength() -> None:
    assert {(each.effect, each.weak) for each in tasks(40, 1, "backlash")} == {("gear_backlash", False)}


def test_the_trials_of_the_other_blocks_are_what_they_were() -> None:
    """Recordings of campaigns that ran before these kinds came follow from this order and these draws."""
    assert not set(INTERMITTENT) & (set(OUTSIDE) | set(CATALOGUE))
    every = [(each.effect, each.seed, each.weak, each.on_board) for each in tasks(470, 1)]
    drawn = [draw_trial(seed, *family_of(effect)).names for effect, seed, _, _ in every if effect == "pair"]
    drawn += [draw_trial(seed, "outside").names for seed in range(40)]
    assert _digest(every) == "0e016bfd3d61a6de"
    assert _digest(drawn) == "ee88128091a4efb2"


def _digest(values: object) -> str:
    return hashlib.sha256(repr(values).encode()).hexdigest()[:16]
