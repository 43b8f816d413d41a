"""Exported MJCF and URDF move in MuJoCo, and SDF as Gazebo's own parser reads it, as our own model does."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from support.exported import GEOMETRY, PERIOD_S, PLAIN, RICH, drive, ours, scale
from truing.exporters import ExportOptions, exporter
from truing.exporters.into import patched
from truing.exporters.joint import joints
from truing.model.robot_model import RobotModel

if TYPE_CHECKING:
    from mujoco import MjModel

# What integration may cost: an implicit step of h errs by h / (2 e tau) of a speed step at worst, 1 in 2000
# at h = tau / 400; friction whose constraint acts within 2 h adds as much again at each stop.
TOLERANCE = 1e-3
STEP_S = 5e-4


def moved(model: MjModel, torques: np.ndarray | None = None) -> np.ndarray:
    """Rim speeds at the rows of `drive`, shape (2, n), under controls, or under torques at full effort."""
    import mujoco

    t, efforts = drive()
    data = mujoco.MjData(model)
    steps = round(PERIOD_S / model.opt.timestep)
    assert steps * model.opt.timestep == pytest.approx(PERIOD_S)
    speeds = np.zeros_like(efforts)
    for row in range(1, t.size):
        for _ in range(steps):
            if torques is None:
                data.ctrl[:] = efforts[:, row]
            else:
                data.qfrc_applied[:] = torques * efforts[:, row]
            mujoco.mj_step(model, data)
        speeds[:, row] = data.qvel * GEOMETRY.wheel_radius_m
    return speeds


@pytest.mark.parametrize("model", [PLAIN, RICH], ids=["plain", "rich"])
def test_a_wheel_in_mujoco_moves_as_ours_with_its_friction_and_delay(
    tmp_path: Path, model: RobotModel
) -> None:
    import mujoco

    path = tmp_path / "robot.xml"
    mjcf = exporter("mjcf")
    mjcf.write(model, path)
    ours_now = ours(model, mjcf.HOLDS, *drive())
    error = np.abs(moved(mujoco.MjModel.from_xml_path(str(path))) - ours_now)
    assert error.max() < TOLERANCE * scale(model)


def test_a_wheel_in_mujoco_holds_against_efforts_below_its_friction(tmp_path: Path) -> None:
    import mujoco

    path = tmp_path / "robot.xml"
    exporter("mjcf").write(PLAIN, path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.ctrl[:] = 0.9 * PLAIN.left.friction, -0.9 * PLAIN.right.friction
    for _ in range(4000):
        mujoco.mj_step(model, data)
    crept_m = np.abs(data.qpos) * GEOMETRY.wheel_radius_m
    assert crept_m.max() < 1e-3, "less than a millimetre in two seconds"


def test_the_inertia_is_a_free_choice_that_changes_no_motion(tmp_path: Path) -> None:
    import mujoco

    speeds = []
    for inertia in (1e-3, 0.1):
        path = tmp_path / f"{inertia}.xml"
        exporter("mjcf").write(PLAIN, path, ExportOptions(inertia_kgm2=inertia))
        speeds.append(moved(mujoco.MjModel.from_xml_path(str(path))))
    assert np.abs(speeds[0] - speeds[1]).max() < 1e-4 * scale(PLAIN)


def test_a_urdf_in_mujoco_moves_as_ours_without_the_delay_that_it_cannot_hold(tmp_path: Path) -> None:
    import mujoco

    path = tmp_path / "robot.urdf"
    urdf = exporter("urdf")
    urdf.write(PLAIN, path)
    model = stiffened(mujoco.MjModel.from_xml_path(str(path)))
    torques = np.array([joint.torque_nm for joint in joints(PLAIN, ExportOptions())])
    error = np.abs(moved(model, torques) - ours(PLAIN, urdf.HOLDS, *drive()))
    assert error.max() < TOLERANCE * scale(PLAIN)


def stiffened(model: MjModel) -> MjModel:
    """URDF and SDF know no solver settings: those of the exported MJCF."""
    import mujoco

    model.opt.timestep, model.opt.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.dof_solref[:] = 2.0 * STEP_S, 1.0
    model.dof_solimp[:] = 0.9999, 0.9999, 0.001, 0.5, 2.0
    return model


def test_a_urdf_parser_reads_joints_limits_and_dynamics(tmp_path: Path) -> None:
    import yourdfpy

    path = tmp_path / "robot.urdf"
    exporter("urdf").write(PLAIN, path)
    robot = yourdfpy.URDF.load(str(path), build_scene_graph=False, load_meshes=False)
    assert robot.validate()
    for joint in joints(PLAIN, ExportOptions()):
        read = robot.joint_map[joint.name]
        assert read.type == "continuous"
        np.testing.assert_array_equal(read.axis, [0.0, 1.0, 0.0])
        assert float(read.dynamics.damping) == joint.damping_nms
        assert float(read.dynamics.friction) == joint.friction_nm
        assert (float(read.limit.effort), float(read.limit.velocity)) == (joint.torque_nm, joint.top_radps)
        link = robot.link_map[f"{joint.side}_wheel_link"]
        assert link.inertial.inertia[1, 1] == joint.inertia_kgm2
    assert robot.joint_map["left_wheel_joint"].origin[1, 3] == pytest.approx(0.5 * GEOMETRY.wheelbase_m)


def test_delay_and_breakaway_are_said_in_the_file(tmp_path: Path) -> None:
    for kind in ("urdf", "sdf"):
        path = tmp_path / f"robot.{kind}"
        exporter(kind).write(RICH, path)
        text = path.read_text()
        assert (
            "delay is left out, this format has no place for it: delay_s 0.063 left, 0.041 right (s)" in text
        )
        assert "breakaway is left out" in text


READER = r"""
#include <cstdio>
#include <sdf/sdf.hh>
int main(int, char **argv)
{
    sdf::Root root;
    for (const auto &error : root.Load(argv[1])) {
        std::fprintf(stderr, "%s\n", error.Message().c_str());
        return 1;
    }
    const sdf::Model *model = root.Model();
    for (const char *name : {"left", "right"}) {
        const sdf::Joint *joint = model->JointByName(std::string(name) + "_wheel_joint");
        const sdf::JointAxis *axis = joint->Axis();
        const sdf::Link *link = model->LinkByName(joint->ChildLinkName());
        std::printf("%.17g %.17g %.17g %.17g ", axis->Damping(), axis->Friction(), axis->Effort(),
                    axis->MaxVelocity());
        std::printf("%.17g %d\n", link->Inertial().Moi()(1, 1), joint->Type() == sdf::JointType::REVOLUTE);
    }
}
"""


@pytest.fixture(scope="module")
def sdf_reader(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A program that reads a file with Gazebo's own parser and prints its joints."""
    headers = sorted(Path("/usr/include").glob("sdformat-*"))
    if not headers or shutil.which("g++") is None:
        pytest.fail("libsdformat-dev and g++ are missing; ./run test installs them", pytrace=False)
    folder = tmp_path_factory.mktemp("sdf")
    (folder / "reader.cc").write_text(READER)
    includes = [
        f"-I{headers[-1]}",
        *(f"-I{path}" for path in sorted(Path("/usr/include/ignition").glob("*"))),
    ]
    library = f"-lsdformat{headers[-1].name.split('-')[1].split('.')[0]}"
    command = ["g++", "-std=c++17", "-O0", "-w", *includes, "reader.cc", "-o", "reader", library]
    subprocess.run([*command, "-lignition-math6"], cwd=folder, check=True, timeout=110)
    return folder / "reader"


def test_gazebos_own_parser_reads_the_joints_and_they_move_as_ours(tmp_path: Path, sdf_reader: Path) -> None:
    import mujoco

    path = tmp_path / "robot.sdf"
    sdf = exporter("sdf")
    sdf.write(PLAIN, path)
    done = subprocess.run([sdf_reader, path], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert "Warning" not in done.stderr
    read = np.array([[float(word) for word in line.split()] for line in done.stdout.splitlines()])
    expected = [
        (j.damping_nms, j.friction_nm, j.torque_nm, j.top_radps, j.inertia_kgm2, 1.0)
        for j in joints(PLAIN, ExportOptions())
    ]
    np.testing.assert_allclose(read, expected, rtol=1e-12)
    # What `--into` leaves of the file is still one that Gazebo reads, with the numbers of the patch.
    other = RobotModel(RICH.left, RICH.right, GEOMETRY)
    made = patched(path, other, keep="masses")
    patched_path = tmp_path / "patched.sdf"
    patched_path.write_bytes(made.after)
    again = subprocess.run([sdf_reader, patched_path], capture_output=True, text=True, timeout=60, check=True)
    for line, axle in zip(again.stdout.splitlines(), (made.patch.left, made.patch.right), strict=True):
        numbers = [float(word) for word in line.split()[:3]]
        assert numbers == pytest.approx([axle.damping_nms, axle.friction_nm, axle.torque_nm], rel=1e-5)
    # The same numbers as the joints of a simulator.
    wheels = "".join(
        f'<body><inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/>'
        f'<joint type="hinge" axis="0 1 0" damping="{damping}" frictionloss="{friction}"/></body>'
        for damping, friction, _, _, inertia, _ in read
    )
    model = stiffened(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{wheels}</worldbody></mujoco>"))
    error = np.abs(moved(model, read[:, 2]) - ours(PLAIN, sdf.HOLDS, *drive()))
    assert error.max() < TOLERANCE * scale(PLAIN)
