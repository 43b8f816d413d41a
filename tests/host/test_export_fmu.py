"""The exported FMU is valid FMI 2.0, and an independent importer simulates it as our own model."""

from __future__ import annotations

import ctypes
import re
import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

from support.exported import PERIOD_S, PLAIN, RICH, drive, ours, scale
from truing.errors import TruingError
from truing.exporters import exporter
from truing.exporters.fmu import PARAMETERS
from truing.model.robot_model import RobotModel

OUTPUTS = ("speed_left", "speed_right")


@pytest.fixture(scope="module", params=["plain", "rich"])
def exported(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, RobotModel]:
    model = {"plain": PLAIN, "rich": RICH}[request.param]
    path = tmp_path_factory.mktemp("fmu") / "robot.fmu"
    exporter("fmu").write(model, path)
    return path, model


def inputs() -> np.ndarray:
    """The drive as an importer wants it: held from each time on, so that an effort stands a row earlier."""
    t, efforts = drive()
    held = np.concatenate((efforts[:, 1:], efforts[:, -1:]), axis=1)
    names = [("time", float), ("effort_left", float), ("effort_right", float)]
    return np.array(list(zip(t, *held, strict=True)), dtype=names)


def simulated(path: Path, **more: object) -> np.ndarray:
    """Speeds at the rows of `drive`, shape (2, n)."""
    t = drive()[0]
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=float(t[-1]),
        output_interval=PERIOD_S,
        input=inputs(),
        output=list(OUTPUTS),
        **more,
    )
    return np.array([result[name] for name in OUTPUTS])


def test_the_unit_is_valid_and_its_c_has_no_warnings(
    exported: tuple[Path, RobotModel], tmp_path: Path
) -> None:
    path, _ = exported
    assert validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as bundle:
        bundle.extractall(tmp_path)
    warnings = ("-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror", "-ffp-contract=off")
    for source in sorted((tmp_path / "sources").glob("*.c")):
        subprocess.run(["gcc", "-std=c11", *warnings, "-c", source, "-o", tmp_path / "x.o"], check=True)


def test_an_importer_simulates_it_as_our_own_model(exported: tuple[Path, RobotModel]) -> None:
    path, model = exported
    error = np.abs(simulated(path) - ours(model, exporter("fmu").HOLDS, *drive()))
    # Both solve constant friction in closed form; where it depends on speed both step, by 2.5 ms at most.
    assert error.max() < (1e-9 if model is PLAIN else 1e-4) * scale(model)


def test_the_length_of_a_communication_step_does_not_matter(exported: tuple[Path, RobotModel]) -> None:
    path, model = exported
    coarse, fine = (simulated(path, step_size=size) for size in (PERIOD_S, 0.1 * PERIOD_S))
    assert np.abs(coarse - fine).max() < (1e-9 if model is PLAIN else 1e-4) * scale(model)


def test_parameters_can_be_set_and_give_the_other_model(tmp_path: Path) -> None:
    path = tmp_path / "robot.fmu"
    exporter("fmu").write(PLAIN, path)
    values = {
        f"{side}.{name}": getattr(wheel, name)
        for side, wheel in (("left", RICH.left), ("right", RICH.right))
        for name, _ in PARAMETERS
    }
    error = np.abs(simulated(path, start_values=values) - ours(RICH, exporter("fmu").HOLDS, *drive()))
    assert error.max() < 1e-4 * scale(RICH)


def test_travel_is_the_integral_of_speed_and_the_pose_follows_the_wheels(tmp_path: Path) -> None:
    path = tmp_path / "robot.fmu"
    exporter("fmu").write(PLAIN, path)
    t = drive()[0]
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=float(t[-1]),
        step_size=0.001,
        output_interval=0.001,
        input=inputs(),
        output=["speed_left", "travel_left", "travel_right", "x", "y", "theta"],
    )
    # The trapezoid rule errs by a step's square; kinks where the effort changes cost a little more.
    integral = np.concatenate(
        ([0.0], np.cumsum(0.0005 * (result["speed_left"][1:] + result["speed_left"][:-1])))
    )
    assert np.abs(integral - result["travel_left"]).max() < 1e-4
    turned = (result["travel_right"] - result["travel_left"]) / PLAIN.robot.wheelbase_m
    np.testing.assert_allclose(result["theta"], turned, atol=1e-9)
    middle = 0.5 * (np.diff(result["travel_left"]) + np.diff(result["travel_right"]))
    heading = 0.5 * (result["theta"][1:] + result["theta"][:-1])
    np.testing.assert_allclose(result["x"][-1], np.sum(middle * np.cos(heading)), atol=1e-9)
    np.testing.assert_allclose(result["y"][-1], np.sum(middle * np.sin(heading)), atol=1e-9)


@pytest.fixture
def slave(tmp_path: Path) -> FMU2Slave:
    """An instance that is ready to step, and its description as `slave.description`."""
    path = tmp_path / "robot.fmu"
    exporter("fmu").write(PLAIN, path)
    description = fmpy.read_model_description(str(path))
    instance = FMU2Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(str(path), unzipdir=str(tmp_path / "unpacked")),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="robot",
    )
    instance.instantiate()
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    instance.description = description
    yield instance
    instance.freeInstance()


def reference(slave: FMU2Slave, name: str) -> int:
    return next(item.valueReference for item in slave.description.modelVariables if item.name == name)


def test_a_snapshot_brings_back_speeds_and_efforts_on_their_way(slave: FMU2Slave) -> None:
    slave.exitInitializationMode()
    effort, speed = [reference(slave, "effort_left")], [reference(slave, "speed_left")]
    slave.setReal(effort, [0.7])
    slave.doStep(0.0, 0.03)
    kept = slave.getFMUState()
    raw = slave.serializeFMUState(kept)
    first = []
    for k in range(10):
        slave.doStep(0.03 + 0.05 * k, 0.05)
        first.append(slave.getReal(speed)[0])
    assert first[-1] > 0.5, "the effort that was on its way has arrived"
    for state in (kept, slave.deserializeFMUState(raw)):
        slave.setFMUState(state)
        again = []
        for k in range(10):
            slave.doStep(0.03 + 0.05 * k, 0.05)
            again.append(slave.getReal(speed)[0])
        assert again == first
        slave.freeFMUState(state)


def test_reset_gives_the_model_as_it_was_exported(slave: FMU2Slave) -> None:
    gain = [reference(slave, "left.gain_mps")]
    slave.setReal(gain, [9.0])
    slave.reset()
    assert slave.getReal(gain) == [PLAIN.left.gain_mps]


@pytest.mark.parametrize(
    ("name", "value", "when"),
    [
        ("left.time_constant_s", 0.0, "end"),
        ("right.delay_s", -1.0, "end"),
        ("effort_left", float("nan"), "set"),
        ("speed_left", 1.0, "set"),
        ("left.gain_mps", 1.0, "late"),
    ],
)
def test_what_makes_no_sense_is_refused(slave: FMU2Slave, name: str, value: float, when: str) -> None:
    target = [reference(slave, name)]
    if when == "end":
        slave.setReal(target, [value])
        with pytest.raises(Exception, match="ExitInitializationMode"):
            slave.exitInitializationMode()
        return
    if when == "late":
        slave.exitInitializationMode()
    with pytest.raises(Exception, match="SetReal"):
        slave.setReal(target, [value])


def test_a_library_offers_every_function_of_the_standard_and_nothing_else(slave: FMU2Slave) -> None:
    header = Path(slave.unzipDirectory, "sources", "fmi2.h").read_text(encoding="utf-8")
    declared = set(re.findall(r"\b(fmi2[A-Z]\w+)\(", header))
    assert len(declared) == 34, "FMI 2.0 has 24 common functions and 10 for co-simulation slaves"
    listing = subprocess.run(
        ["nm", "-D", "--defined-only", slave.dll._name], capture_output=True, text=True, check=True
    ).stdout
    offered = {line.split()[-1] for line in listing.splitlines()}
    assert offered == declared
    assert all(isinstance(getattr(slave.dll, name), ctypes._CFuncPtr) for name in declared)


def test_the_same_model_gives_the_same_bytes_and_another_model_another_identity(tmp_path: Path) -> None:
    for name, model in (("a", PLAIN), ("b", PLAIN), ("c", RICH)):
        (tmp_path / name).mkdir()
        exporter("fmu").write(model, tmp_path / name / "robot.fmu")
    a, b, c = ((tmp_path / name / "robot.fmu") for name in "abc")
    assert a.read_bytes() == b.read_bytes()
    assert fmpy.read_model_description(str(a)).guid != fmpy.read_model_description(str(c)).guid


def test_without_a_compiler_the_error_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(TruingError, match="C compiler") as caught:
        exporter("fmu").write(PLAIN, tmp_path / "robot.fmu")
    assert "gcc" in caught.value.next_step
    assert not (tmp_path / "robot.fmu").exists()
