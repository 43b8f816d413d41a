"""A load that an axis holds, a winch or a lift: found, taken out of the efforts, and said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from numpy.typing import NDArray

import truing
from truing.cli import group
from truing.errors import IdentifyError
from truing.identify.first_baseline import with_first_baseline
from truing.recording.held_load import held_load, without_held_load
from truing.recording.reader import read_recording_set
from truing.recording.run import RecordingSet, Run

Array = NDArray[np.float64]
GAIN_MPS, TAU_S, FRICTION = 2.0, 0.2, 0.05
LOAD = 0.3


def columns(seed: int, load: float = LOAD, way: float = 1.0, rows: int = 400) -> dict[str, Array]:
    """A lift that rises and sinks under efforts of one sign, 50 Hz; `way`: how the motor is wired."""
    rng = np.random.default_rng(seed)
    t = 0.02 * np.arange(rows)
    effort = np.full(rows, load)
    for begin in range(20, rows - 60, 60):
        effort[begin : begin + 40] = load + rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.22)
    v, speeds = 0.0, []
    for u in effort:
        for _ in range(20):
            free = v + 1e-3 * (GAIN_MPS * (u - load) - v) / TAU_S
            v = float(np.sign(free) * max(abs(free) - 1e-3 * GAIN_MPS * FRICTION / TAU_S, 0.0))
        speeds.append(v)
    speed = np.array(speeds) + 1e-3 * rng.standard_normal(rows)
    return {"t_s": t, "effort": way * effort, "vel_mps": speed}


def lift(load: float = LOAD, way: float = 1.0, count: int = 3) -> RecordingSet:
    return truing.read([columns(seed, load, way) for seed in range(count)], name="lift")


def run(*arguments: object) -> Result:
    return CliRunner().invoke(group, [str(a) for a in arguments])


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_load_and_friction_come_out_whichever_way_the_motor_is_wired(way: float) -> None:
    found = held_load(lift(way=way))
    assert found is not None
    assert found.half_widths[0] < 0.01
    # A row's acceleration is a difference: that much beside the interval.
    assert found.effort == pytest.approx(way * LOAD, abs=found.half_widths[0] + 0.002)
    assert found.friction == pytest.approx(FRICTION, abs=max(found.half_widths[1], 0.01))
    assert found.is_turned == (way < 0.0)


def test_what_is_left_of_the_efforts_drives_the_axis_with_its_sign() -> None:
    for way in (1.0, -1.0):
        taken = without_held_load(lift(way=way))
        assert taken.held_load is not None
        assert without_held_load(taken) is taken, "it is taken out once"
        plain = lift(load=0.0)
        for one, other in zip(taken, plain, strict=True):
            assert one.effort("left") == pytest.approx(other.effort("left"), abs=0.02)


@pytest.mark.parametrize("load", [0.0, 0.04])
def test_an_axis_driven_with_both_signs_holds_no_load_that_is_taken_out(load: float) -> None:
    assert held_load(lift(load=load)) is None


def test_a_lift_that_only_rises_is_left_alone() -> None:
    """One way alone, load and friction are one number."""
    made = columns(1)
    up = {name: values[(made["vel_mps"] > -0.02)] for name, values in made.items()}
    up["t_s"] = 0.02 * np.arange(len(up["t_s"]))
    assert held_load(truing.read([up], name="rises")) is None


def test_two_wheels_hold_none() -> None:
    made = columns(1)
    pair = {"t_s": made["t_s"]}
    for side in ("left", "right"):
        pair |= {f"effort_{side}": made["effort"], f"vel_{side}_mps": made["vel_mps"]}
    recordings = RecordingSet("robot", (Run("01", pair, order=tuple(pair)),))
    assert held_load(recordings) is None


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_lift_is_diagnosed_beside_its_load(way: float, tmp_path: Path) -> None:
    """It was refused: "turns against its effort", with swapped leads as the cause."""
    for number in range(3):
        made = columns(number, way=way)
        rows = zip(*(values.tolist() for values in made.values()), strict=True)
        file = tmp_path / "lift" / "runs" / f"{number + 1:02d}.csv"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("\n".join([",".join(made), *(",".join(map(repr, row)) for row in rows)]) + "\n")
    model = tmp_path / "model.toml"
    said = run("diagnose", tmp_path / "lift", "--export", f"toml:{model}")
    assert said.exit_code == 0, said.output
    text = " ".join(said.stdout.split())
    assert f"it holds a load: {way * 0.3:.1f}" in text.replace("0.299", "0.3").replace("0.301", "0.3")
    assert "of full effort keeps it still" in text
    assert "friction" in text.split("What is missing")[1].split("Parameters")[0]
    assert "Add the load to the simulation as a constant effort" in text
    written = truing.read(read_recording_set(tmp_path / "lift"), str(model)).baseline
    assert written is not None
    assert written.left.gain_mps == pytest.approx(GAIN_MPS, rel=0.05)
    steps = run("identify", tmp_path / "lift").output
    assert "holds a load" in steps
    assert "swapped" not in steps


def test_a_first_baseline_never_turns_a_wheel_against_its_effort() -> None:
    """A line through runs that a controller shaped had a negative gain, and a diagnosis ended in nan."""
    t = 0.02 * np.arange(400)
    speed = np.where((t > 2.0) & (t < 4.0), 1.0, 0.0)
    effort = np.where(speed > 0.0, -0.1, 0.0) + 0.3 * np.exp(-(((t - 2.0) / 0.05) ** 2))
    found = with_first_baseline(truing.read([{"t_s": t, "effort": effort, "vel_mps": speed}], name="axis"))
    assert found.baseline is not None
    assert found.baseline.left.gain_mps > 0.0


def test_swapped_leads_of_an_axis_are_still_refused() -> None:
    made = columns(1, load=0.0)
    made["effort"] = -made["effort"]
    with pytest.raises(IdentifyError, match="turns against its effort"):
        truing.diagnose(truing.read([made], name="swapped"), jobs=1)
