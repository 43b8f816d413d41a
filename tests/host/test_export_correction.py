"""A learned correction in the programs that exports are for: FMPy, gcc and MuJoCo simulate it as we do."""

from __future__ import annotations

import importlib.util
import subprocess
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave

from truing.exporters import notes, write_model
from truing.model.correction import Correction, Rows, Term, corrected_speeds
from truing.model.robot_model import RobotModel, parse_robot_model
from truing.model.wheel import WheelPhysics
from truing.recording.baseline import RobotGeometry

GAIN, TAU = (1.2, 1.1), (0.3, 0.25)
STEP_S, STEPS = 0.02, 160
JUMP = (-1.0, -0.4, -0.0, 0.0, 0.4, 1.0)
TERMS = (
    Term("friction", "speed", 0.0, JUMP, (0.2, 0.12, 0.05, 0.05, 0.1, 0.2), (0.1,) * 6),
    Term("force", "recent_effort", 0.1, (-1.0, 0.0, 1.0), (-0.5, 0.0, 0.5), (-0.3, 0.0, 0.3)),
    Term("inertia", "effort", 0.0, (-1.0, 0.0, 1.0), (-0.2, 0.0, 0.2), (-0.1, 0.0, 0.1)),
)
MODEL = RobotModel(
    WheelPhysics(GAIN[0], TAU[0]),
    WheelPhysics(GAIN[1], TAU[1]),
    RobotGeometry("corrected", 0.05, 0.3, 2400.0),
    50.0,
    correction=Correction(GAIN, TAU, TERMS, (0.05, -0.03), (0.02, -0.1)),
)


@pytest.fixture(scope="module")
def efforts() -> np.ndarray:
    """Held efforts of both wheels, shape (STEPS, 2)."""
    rng = np.random.default_rng(1)
    return np.repeat(rng.uniform(-0.8, 0.8, (STEPS // 10, 2)), 10, axis=0)


@pytest.fixture(scope="module")
def expected(efforts: np.ndarray) -> np.ndarray:
    """Speeds at the end of every step by our own kernel, shape (STEPS, 2), m/s."""
    held = np.vstack((np.zeros((1, 2)), efforts))
    base, recent, state = np.zeros_like(held), np.zeros_like(held), np.zeros(2)
    for k in range(1, len(held)):
        keep = np.exp(-STEP_S / np.array(TAU))
        base[k] = held[k] * GAIN + (base[k - 1] - held[k] * GAIN) * keep
        fades = np.exp(-STEP_S / 0.1)
        recent[k] = (state - held[k]) * (1.0 - fades) * 0.1 / STEP_S
        state = held[k] + (state - held[k]) * fades
    variables = {("recent_effort", 0.1): recent, ("effort", 0.0): held}
    rows = Rows(np.array([0, len(held)]), np.full(len(held), STEP_S), held, True, variables)
    assert MODEL.correction is not None
    speeds = corrected_speeds(MODEL.correction, rows, base)[1:]
    assert np.abs(speeds - base[1:]).max() > 0.1, "there is something to carry"
    return speeds


def test_the_model_file_holds_every_lookup() -> None:
    assert parse_robot_model(MODEL.to_toml()) == MODEL


def test_fmpy_simulates_the_correction(tmp_path: Path, efforts: np.ndarray, expected: np.ndarray) -> None:
    path = tmp_path / "corrected.fmu"
    write_model("fmu", MODEL, path)
    description = fmpy.read_model_description(str(path))
    references = {each.name: each.valueReference for each in description.modelVariables}
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(str(path), str(tmp_path / "unzipped")),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="corrected",
    )
    slave.instantiate()
    slave.setupExperiment()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    inputs, outputs = (
        [references[f"{what}_{side}"] for side in ("left", "right")] for what in ("effort", "speed")
    )
    speeds = []
    for k, pair in enumerate(efforts):
        slave.setReal(inputs, pair.tolist())
        slave.doStep(k * STEP_S, STEP_S)
        speeds.append(slave.getReal(outputs))
    slave.freeInstance()
    assert np.array(speeds) == pytest.approx(expected, abs=1e-4)


def test_a_compiled_c_file_simulates_the_correction(
    tmp_path: Path, efforts: np.ndarray, expected: np.ndarray
) -> None:
    source, program = tmp_path / "corrected.c", tmp_path / "corrected"
    write_model("c", MODEL, source)
    strict = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-DROBOT_MAIN"]
    subprocess.run(["gcc", *strict, str(source), "-o", str(program), "-lm"], check=True)
    lines = "".join(f"{STEP_S} {left!r} {right!r}\n" for left, right in efforts.tolist())
    done = subprocess.run([str(program)], input=lines, check=True, capture_output=True, text=True)
    speeds = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    assert speeds == pytest.approx(expected, abs=1e-4)


def test_mujoco_simulates_the_correction_with_the_file_beside_its_own(
    tmp_path: Path, efforts: np.ndarray, expected: np.ndarray
) -> None:
    import mujoco

    files, _ = write_model("mjcf", MODEL, tmp_path / "corrected.xml")
    spec = importlib.util.spec_from_file_location("corrected_correction", files[1])
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    model = mujoco.MjModel.from_xml_path(str(files[0]))
    data = mujoco.MjData(model)
    correction = module.Correction(model)
    speeds = []
    for pair in efforts:
        for _ in range(round(STEP_S / model.opt.timestep)):
            data.ctrl[:] = pair
            correction.apply(model, data)
            mujoco.mj_step(model, data)
        speeds.append(correction.shown(data))
    assert np.sqrt(np.mean((np.array(speeds) - expected) ** 2)) < 4e-3
    assert any("acts where the Python file" in note for note in notes("mjcf", MODEL))


def test_a_format_without_lookups_says_what_it_leaves_out() -> None:
    assert any("learned correction" in note for note in notes("urdf", MODEL))
