"""A model goes into the user's own robot file, and the program that runs the file says what that brings."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
import pytest
from click.testing import CliRunner

from support import mujoco_robot
from support.exported import GEOMETRY, PLAIN
from support.mujoco_robot import RADIUS_M, STRAIGHT, TURNING, text, write_set
from truing.cli import group
from truing.errors import FileError, OutputError, TruingError
from truing.exporters import ExportOptions, exporter, own_mjcf
from truing.exporters.carried import check
from truing.exporters.consumers import Consumer
from truing.exporters.in_mujoco import driven
from truing.exporters.into import patched
from truing.exporters.own_robot import KEEP_MASSES, KEEP_MOTORS
from truing.exporters.recorded import error_mps, tasks
from truing.exporters.wheel_names import side_of, sides_of
from truing.exporters.xml_edit import XmlEdit
from truing.model.robot_model import RobotModel, parse_robot_model, read_robot_model
from truing.model.wheel import WheelPhysics
from truing.recording.baseline import RobotGeometry
from truing.recording.reader import read_recording_set

HIDDEN = {"mass_kg": 3.0, "frictionloss": 0.012, "delay_s": 0.04}
OWN = RobotGeometry("my robot", RADIUS_M, mujoco_robot.WHEELBASE_M, 4096.0)
# What a fit to straight runs of that robot gives, rounded: for tests that need no better.
FOUND = RobotModel(
    WheelPhysics(1.04, 0.336, delay_s=0.04, friction=0.048),
    WheelPhysics(1.04, 0.336, delay_s=0.04, friction=0.048),
    OWN,
)


def call(*arguments: object) -> dict[str, Any]:
    result = CliRunner().invoke(group, [*(str(item) for item in arguments), "--json"])
    if result.exception is not None:
        raise result.exception
    answer: dict[str, Any] = json.loads(result.stdout)
    return answer


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Straight and turning runs of the real robot, and a model fitted to the straight ones alone."""
    folder = tmp_path_factory.mktemp("own")
    write_set(folder / "straight", text(**HIDDEN), STRAIGHT)
    write_set(folder / "turning", text(**HIDDEN), TURNING)
    call("fit", folder / "straight", "--out", folder / "model.toml")
    return folder


def error_in_mujoco(path: Path, runs: Path) -> float:
    model = own_mjcf.load(path)
    simulate = driven(model, own_mjcf.drives(model, path), RADIUS_M)
    return error_mps(tasks(read_recording_set(runs)), simulate)


@pytest.mark.parametrize("keep", [None, KEEP_MASSES])
def test_the_users_own_robot_then_drives_as_the_real_one_also_where_nothing_was_fitted(
    world: Path, tmp_path: Path, keep: str | None
) -> None:
    """Friction, 40 ms of delay and a chassis of 3 kg instead of 2 are hidden; turning runs judge."""
    mine, truth = tmp_path / "my_robot.xml", tmp_path / "truth.xml"
    mine.write_text(text())
    truth.write_text(text(**HIDDEN))
    more = () if keep is None else ("--keep", keep)
    told = call("export", world / "model.toml", "--into", mine, "--check", world / "turning", *more)
    least = error_in_mujoco(truth, world / "turning")
    into = told["into"]
    print(f"{into['before_mps']:.4f} before, {into['after_mps']:.4f} after, {least:.4f} m/s the robot itself")
    assert into["before_mps"] > 20.0 * least
    assert into["after_mps"] < 1.15 * least, "of the noise: what the counts resolve"
    assert into["kept"] == (keep or KEEP_MOTORS), "a heavier chassis on known motors is the smaller change"
    assert into["after_mps"] == pytest.approx(error_in_mujoco(mine, world / "turning"))


def test_fitted_through_the_own_robot_turning_runs_give_its_physics_too(world: Path, tmp_path: Path) -> None:
    """From a data sheet's numbers alone, on turns and one straight run: the scrub is in the own robot."""
    mine, truth, runs = tmp_path / "my_robot.xml", tmp_path / "truth.xml", tmp_path / "runs"
    mine.write_text(text())
    truth.write_text(text(**HIDDEN))
    write_set(runs, text(**HIDDEN), TURNING | {"gentle": STRAIGHT["gentle"]})
    into = call("export", runs / "baseline.toml", "--into", mine, "--check", runs, "--refine")["into"]
    assert into["judges"] == "03_gentle"
    least = error_in_mujoco(truth, world / "straight")
    print(
        f"{into['before_mps']:.4f} before, {into['after_mps']:.4f} after (run left out); {least:.4f} at least"
    )
    assert into["before_mps"] > 20.0 * least
    assert into["after_mps"] < 1.3 * least
    found = parse_robot_model(into["refined"]["model"])
    assert found.left.friction == pytest.approx(HIDDEN["frictionloss"] / 0.25, rel=0.05)
    assert found.left.delay_s == pytest.approx(HIDDEN["delay_s"], abs=0.002)
    kept = patched(mine, found, keep=into["kept"])
    assert kept.patch.chassis_factor == pytest.approx(1.0, abs=0.01)
    assert into["kept"] == KEEP_MOTORS
    assert kept.own.chassis_kg == pytest.approx(HIDDEN["mass_kg"], rel=0.03)


def test_only_numbers_of_the_drive_change_and_a_backup_is_kept(tmp_path: Path) -> None:
    mine = tmp_path / "my_robot.xml"
    mine.write_text(text())
    model = tmp_path / "model.toml"
    FOUND.save(model)
    told = call("export", model, "--into", mine)["into"]
    assert Path(told["backup"]).read_text(encoding="utf-8") == text()
    before, after = text().splitlines(), mine.read_text().splitlines()
    assert len(before) == len(after)
    changed = [new for old, new in zip(before, after, strict=True) if old != new]
    names = ("mass=", "diaginertia=", "damping=", "solreffriction=", "motor name=")
    assert all(any(name in line for name in names) for line in changed)
    assert "<!-- measured on the bench -->" in mine.read_text()
    assert all(line in told["diff"] for line in changed)
    again = patched(mine, FOUND)
    assert again.after == mine.read_bytes(), "what has been put in once is not put in twice"
    assert call("export", model, "--into", mine)["into"]["backup"].endswith(".bak1")
    other = tmp_path / "other.xml"
    assert call("export", model, "--into", mine, "--out", other)["into"]["backup"] is None
    assert other.read_bytes() == mine.read_bytes()


def test_from_python_it_goes_into_another_file_or_in_place(tmp_path: Path) -> None:
    import truing

    mine, other = tmp_path / "my_robot.xml", tmp_path / "other.xml"
    mine.write_text(text())
    made = truing.export(FOUND, other, into=mine)
    assert (made.kind, made.files) == ("mjcf", (other,))
    assert mine.read_text() == text()
    in_place = truing.export(FOUND, mine, into=mine)
    assert mine.read_bytes() == other.read_bytes()
    assert in_place.files[1].read_text() == text()


def test_a_run_with_a_gap_or_in_motion_is_said(tmp_path: Path) -> None:
    rows = ["t_s,effort_left,effort_right,vel_left_mps,vel_right_mps"]
    rows += [f"{0.02 * k + (1.0 if k > 30 else 0.0):.2f},0.2,0.2,0.2,0.2" for k in range(60)]
    (tmp_path / "run.csv").write_text("\n".join(rows) + "\n")
    task = tasks(read_recording_set(tmp_path / "run.csv"))[0]
    assert task.t_s.size == 31
    assert "up to its gap at 0.6 s, 31 of 60 rows" in task.left_out
    assert "begins in motion" in task.left_out


def test_a_patch_that_would_make_it_worse_is_not_written(world: Path, tmp_path: Path) -> None:
    right, model = tmp_path / "right.xml", tmp_path / "model.toml"
    right.write_text(text(**HIDDEN))
    RobotModel(WheelPhysics(2.0, 0.1), WheelPhysics(2.0, 0.1), OWN).save(model)
    with pytest.raises(OutputError, match="it would be worse on"):
        call("export", model, "--into", right, "--check", world / "turning")
    assert right.read_text() == text(**HIDDEN)
    assert [path.name for path in tmp_path.iterdir() if ".bak" in path.name or "truing-" in path.name] == []


OTHERWISE = f"""<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <default>
    <default class="wheel"><joint axis="0 -1 0" damping="0.012"/></default>
  </default>
  <option timestep="0.002" integrator="implicitfast" cone="elliptic" impratio="10"/>
  <worldbody>
    <geom type="plane" size="50 50 0.1" friction="2 0.005 0.0001"/>
    <body name="base" pos="0 0 {RADIUS_M}">
      <freejoint/>
      <geom type="box" size="0.1 0.08 0.02" pos="0 0 -0.03" mass="2.0" contype="0" conaffinity="0"/>
      <geom type="sphere" size="0.015" pos="0.08 0 -0.035" priority="1" condim="1" mass="0"/>
      <geom type="sphere" size="0.015" pos="-0.08 0 -0.035" priority="1" condim="1" mass="0"/>
      <body pos="0 0.12 0"><joint name="front" class="wheel"/>
        <geom type="cylinder" size="{RADIUS_M} 0.012" euler="1.5707963 0 0" mass="0.08"/></body>
      <body pos="0 -0.12 0"><joint name="back" class="wheel"/>
        <geom type="cylinder" size="{RADIUS_M} 0.012" euler="1.5707963 0 0" mass="0.08"/></body>
    </body>
  </worldbody>
  <actuator>
    <general joint="front" gear="-2" gainprm="0.0125" ctrlrange="-10 10"/>
    <general joint="back" gear="-2" gainprm="0.0125" ctrlrange="-10 10"/>
  </actuator>
</mujoco>
"""


def test_defaults_signs_volts_and_a_mass_of_shapes_are_understood(tmp_path: Path) -> None:
    """The same robot written otherwise: axes and gears turned round, 10 V, no `inertial`, other names."""
    path = tmp_path / "otherwise.xml"
    path.write_text(OTHERWISE)
    made = patched(path, FOUND)
    assert made.joints == ("front", "back"), "by where they stand: the left one has the larger y"
    assert made.own.left.torque_nm == pytest.approx(0.25)
    assert made.own.left.damping_nms == 0.012
    plain = tmp_path / "plain.xml"
    plain.write_text(text())
    same = patched(plain, FOUND)
    assert made.patch.left.friction_nm == pytest.approx(same.patch.left.friction_nm)
    assert made.patch.chassis_factor == pytest.approx(same.patch.chassis_factor)
    path.write_bytes(made.after)
    model = own_mjcf.load(path)
    assert model.body("base").mass[0] == pytest.approx(2.0 * made.patch.chassis_factor, rel=1e-5)
    left = own_mjcf.drives(model, path)[0]
    assert (left.control, left.forward) == (10.0, -1.0)
    assert patched(path, FOUND).patch.chassis_factor == pytest.approx(1.0, abs=1e-4)


def test_torque_gain_and_time_constant_of_the_recordings_hold_in_the_users_numbers(tmp_path: Path) -> None:
    path = tmp_path / "my_robot.xml"
    path.write_text(text())
    for keep in (KEEP_MASSES, KEEP_MOTORS):
        made = patched(path, FOUND, keep=keep)
        for axle, wheel in ((made.patch.left, FOUND.left), (made.patch.right, FOUND.right)):
            gain = RADIUS_M * axle.torque_nm / axle.damping_nms
            assert gain == pytest.approx(wheel.gain_mps)
            assert made.patch.inertia_kgm2 / axle.damping_nms == pytest.approx(wheel.time_constant_s)
            assert axle.friction_nm == pytest.approx(wheel.friction * axle.torque_nm)
    quick = RobotModel(WheelPhysics(1.04, 0.01), WheelPhysics(1.04, 0.01), OWN)
    with pytest.raises(TruingError, match="the chassis would weigh"):
        patched(path, quick, keep=KEEP_MOTORS)
    assert patched(path, quick).patch.kept == KEEP_MASSES


def test_a_lag_of_the_driver_becomes_a_filter_of_the_actuator_and_goes_with_it(tmp_path: Path) -> None:
    path = tmp_path / "my_robot.xml"
    path.write_text(text())
    slow = RobotModel(replace(FOUND.left, lag_s=0.05), replace(FOUND.right, lag_s=0.07), OWN)
    path.write_bytes(patched(path, slow).after)
    model = own_mjcf.load(path)
    assert model.actuator_dynprm[:, 0] == pytest.approx([0.05, 0.07])
    path.write_bytes(patched(path, FOUND).after)
    assert own_mjcf.load(path).na == 0


@pytest.mark.parametrize("kind", ["urdf", "sdf"])
@pytest.mark.parametrize("keep", [KEEP_MASSES, KEEP_MOTORS])
def test_a_urdf_or_sdf_gets_the_same_numbers(tmp_path: Path, kind: str, keep: str) -> None:
    path = tmp_path / f"robot.{kind}"
    # Motors strong enough to move the base as well, which the exported file has beside its axles.
    old = RobotModel(WheelPhysics(1.0, 0.04), WheelPhysics(1.0, 0.04), GEOMETRY)
    exporter(kind).write(old, path, ExportOptions(inertia_kgm2=0.004))
    made = patched(path, PLAIN, keep=keep)
    path.write_bytes(made.after)
    again = patched(path, PLAIN, keep=keep)
    assert again.patch.chassis_factor == pytest.approx(1.0, abs=1e-3)
    for axle, wheel in ((again.own.left, PLAIN.left), (again.own.right, PLAIN.right)):
        gain = GEOMETRY.wheel_radius_m * axle.torque_nm / axle.damping_nms  # type: ignore[operator]
        assert gain == pytest.approx(wheel.gain_mps, rel=1e-4)
        assert axle.friction_nm == pytest.approx(wheel.friction * axle.torque_nm, rel=1e-4)
    times = [again.own.inertia_kgm2 / axle.damping_nms for axle in (again.own.left, again.own.right)]
    wanted = (PLAIN.left.time_constant_s, PLAIN.right.time_constant_s)
    # One mass has to serve both wheels, so that its motors' damping cannot have both time constants.
    assert times == pytest.approx(wanted, rel=1e-4 if keep == KEEP_MASSES else 0.1)
    assert any("delay is left out" in line for line in made.lines)


def test_what_a_urdf_lacks_is_added_and_a_xacro_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    moments = '<inertia ixx="1e-4" iyy="2e-4" izz="1e-4"/>'
    wheels = "".join(
        f'<link name="{s}"><inertial><mass value="0.1"/>{moments}</inertial></link>'
        f'<joint name="{s}_joint" type="continuous"><!-- wheel --><parent link="base"/><child link="{s}"/>'
        f'<origin xyz="0 {y} 0"/><axis xyz="0 1 0"/></joint>'
        for s, y in (("left", 0.1), ("right", -0.1))
    )
    base = f'<link name="base"><inertial><mass value="3.0"/>{moments}</inertial></link>'
    path.write_text(f'<robot name="r">{base}{wheels}</robot>')
    made = patched(path, PLAIN)
    assert made.patch.kept == KEEP_MASSES, "no torque is known that could be kept"
    tree = Xml.fromstring(made.after)
    for joint in tree.findall("joint"):
        dynamics, limit = joint.find("dynamics"), joint.find("limit")
        assert dynamics is not None
        assert limit is not None
        assert float(dynamics.attrib["friction"]) > 0.0
        assert float(limit.attrib["effort"]) > 0.0
    assert b"<!-- wheel -->" in made.after
    path.write_text(path.read_text().replace('value="3.0"', 'value="${mass}"'))
    with pytest.raises(FileError, match="no number") as error:
        patched(path, PLAIN)
    assert "xacro" in error.value.next_step


@pytest.mark.parametrize(
    ("name", "side"),
    [
        ("wheel_left_joint", "left"),
        ("RightWheel", "right"),
        ("axle_l", "left"),
        ("front", None),
        ("lr", None),
    ],
)
def test_a_name_says_its_side(name: str, side: str | None) -> None:
    assert side_of(name) == side


def test_wheels_that_cannot_be_told_are_asked_for(tmp_path: Path) -> None:
    four = {"fl": 0.1, "fr": -0.1, "rl": 0.1, "rr": -0.1}
    with pytest.raises(FileError, match="which two joints") as error:
        sides_of(tmp_path, four, None)
    assert "--joints" in error.value.next_step
    assert sides_of(tmp_path, four, ("rl", "rr")) == ("rl", "rr")
    assert sides_of(tmp_path, {"arm": 0.0, "wheel_1": -0.1, "wheel_2": 0.1}, None) == ("wheel_2", "wheel_1")
    with pytest.raises(FileError, match="no driven joint 'x'"):
        sides_of(tmp_path, four, ("x", "fr"))


def test_an_edit_leaves_the_rest_of_a_file_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    path.write_text("<a>\n  <b x='1>2'  y=\"2\" /><!-- <b/> é -->\n  <c>  3 </c></a>\n", encoding="utf-8")
    edit = XmlEdit(path)
    b, c = edit.root.children
    edit.set_attribute(b, "y", "5")
    edit.set_attribute(b, "z", "6")
    edit.add_child(b, "<d/>")
    edit.set_text(c, "4")
    wanted = '<a>\n  <b x=\'1>2\'  y="5" z="6" >\n    <d/>\n  </b><!-- <b/> é -->\n  <c>4</c></a>\n'
    assert edit.result().decode() == wanted
    assert np.array_equal([n.tag for n in Xml.fromstring(edit.result()).iter()], ["a", "b", "d", "c"])


def test_every_program_simulates_the_recordings_again(world: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    write_set(runs, text(**HIDDEN), {"steps": STRAIGHT["steps"]})
    found = call("export", world / "model.toml", "--check", runs)["check"]
    by_kind = {one["kind"]: one for one in found["formats"]}
    assert set(by_kind) == {"python", "fmu", "mjcf", "urdf", "sdf", "simulink"}
    own = found["own_mps"]
    for kind, one in by_kind.items():
        holds = exporter(kind).HOLDS
        assert one["given_mps"] > 20.0 * own
        for term in ("friction", "delay"):
            if term in holds:
                assert one["terms"][term] > 1.02 * one["after_mps"], f"{kind} carries {term}"
            else:
                assert one["terms"][term] is None
        if {"friction", "delay"} <= holds:
            assert one["after_mps"] < 1.1 * own, kind
        else:
            assert one["after_mps"] > 3.0 * own, f"{kind} cannot hold all of it"
    arguments = [
        "export",
        world / "model.toml",
        "--to",
        "urdf",
        "--out",
        tmp_path / "a.urdf",
        "--check",
        runs,
    ]
    shown = CliRunner().invoke(group, [str(item) for item in arguments])
    assert "cannot hold it" in shown.output
    assert (tmp_path / "a.urdf").is_file()


def test_what_cannot_be_run_is_said_and_the_rest_is_run(
    world: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    found = check(FOUND, read_recording_set(world / "turning"), ("fmu", "wpilib", "python"))
    fmu, wpilib, python = found.formats
    assert "C compiler" in fmu.why_not
    assert "parameters" in wpilib.why_not
    assert python.after_mps is not None
    monkeypatch.setattr(Consumer, "installed", False)
    lacking = check(FOUND, read_recording_set(world / "turning"), ("fmu",)).formats[0]
    assert "fmpy is not installed" in lacking.why_not


def test_a_model_is_found_again_by_its_own_program(world: Path) -> None:
    model = read_robot_model(world / "model.toml")
    for wheel in (model.left, model.right):
        assert wheel.delay_s == pytest.approx(0.04, abs=0.002)
        assert wheel.friction == pytest.approx(0.048, abs=0.003)
