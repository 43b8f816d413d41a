"""Exported files, run by the programs that they are for: recordings simulated again by each.

| kind | run by |
| --- | --- |
| `python` | this Python, from the file alone |
| `fmu` | FMPy, which loads the unit's own compiled C |
| `mjcf` | MuJoCo, by its motors |
| `urdf` | MuJoCo's reader of URDF, by torques at the joints |
| `sdf` | MuJoCo, with the file's joints and masses (Gazebo is not to be had from a package index) |
| `simulink` | SciPy, by the discrete matrices |

The other kinds are parameters, and nothing runs them.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.model.robot_model import RobotModel
from truing.recording.run import WHEELS

from . import exporter
from .in_mujoco import driven, stepped
from .joint import joints
from .mjcf import IMPEDANCE, SOLREF_STEPS
from .mjcf import timestep as mujoco_step
from .own_joints import SdfFile
from .own_mjcf import drives, load
from .recorded import Simulate, Task, on_grid, travelled
from .terms import ExportOptions
from .xml_file import number

# Where a program is given efforts on an even grid, s; a row's interval holds four of them at least.
GRID_S, GRIDS_PER_ROW = 0.005, 4


@dataclass(frozen=True, slots=True)
class Consumer:
    """A program that runs a kind of file.

    Attributes
    ----------
    name : as a table shows it.
    module : the package that must be there.
    prepare : (file, model, options) to a simulation.
    """

    name: str
    module: str
    prepare: Callable[[Path, RobotModel, ExportOptions], Simulate]

    @property
    def installed(self) -> bool:
        """Whether it can be used here."""
        return importlib.util.find_spec(self.module) is not None


def simulation(kind: str, model: RobotModel, folder: Path, options: ExportOptions) -> Simulate:
    """Write the model as a file of that kind into a folder, and have its program run it."""
    path = folder / f"robot{exporter(kind).SUFFIX}"
    options = replace(options, period_s=GRID_S)
    exporter(kind).write(model, path, options)
    return CONSUMERS[kind].prepare(path, model, options)


def _step_s(task: Task) -> float:
    return min(GRID_S, float(np.median(np.diff(task.t_s))) / GRIDS_PER_ROW)


def _python(path: Path, _: RobotModel, __: ExportOptions) -> Simulate:
    spec = importlib.util.spec_from_file_location("truing_exported_robot", path)
    assert spec is not None
    assert spec.loader is not None
    module: ModuleType = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    def simulate(task: Task) -> FloatArray:
        grid, efforts = on_grid(task, _step_s(task))
        before = np.concatenate((np.zeros((2, 1)), efforts), axis=1)
        speeds = module.simulate(grid.tolist(), before[0].tolist(), before[1].tolist())
        return travelled(task, grid, np.array(speeds).T)

    return simulate


def _fmu(path: Path, _: RobotModel, __: ExportOptions) -> Simulate:
    import fmpy

    description = fmpy.read_model_description(str(path))
    unpacked = fmpy.extract(str(path), unzipdir=str(path.with_suffix("")))

    def simulate(task: Task) -> FloatArray:
        step_s = _step_s(task)
        grid, efforts = on_grid(task, step_s)
        # Held from each time on.
        held = np.concatenate((efforts, efforts[:, -1:]), axis=1)
        names: Any = [("time", float), ("effort_left", float), ("effort_right", float)]
        outputs = ["speed_left", "speed_right"]
        result = fmpy.simulate_fmu(
            unpacked,
            model_description=description,
            stop_time=float(grid[-1]),
            output_interval=step_s,
            input=np.array(list(zip(grid, *held, strict=True)), dtype=names),
            output=outputs,
        )
        return travelled(task, grid, np.array([result[name] for name in outputs]))

    return simulate


def _simulink(path: Path, _: RobotModel, __: ExportOptions) -> Simulate:
    import scipy.io
    import scipy.signal

    m = scipy.io.loadmat(path)
    delays = m["delay_samples"].ravel().astype(int)

    def simulate(task: Task) -> FloatArray:
        grid, efforts = on_grid(task, GRID_S)
        late = [
            np.concatenate((np.zeros(delay), row))[: row.size]
            for delay, row in zip(delays, efforts, strict=True)
        ]
        held = np.array([np.append(row, row[-1]) for row in late])
        _, speeds, _ = scipy.signal.dlsim((m["Ad"], m["Bd"], m["Cd"], m["Dd"], GRID_S), held.T)
        return travelled(task, grid, speeds.T)

    return simulate


def _mjcf(path: Path, model: RobotModel, options: ExportOptions) -> Simulate:
    compiled = load(path)
    return driven(compiled, drives(compiled, path), options.radius(model))


def _urdf(path: Path, model: RobotModel, options: ExportOptions) -> Simulate:
    compiled = load(path)
    torques = [joint.torque_nm for joint in joints(model, options)]
    return _by_torque(compiled, model, torques, options.radius(model))


def _sdf(path: Path, model: RobotModel, options: ExportOptions) -> Simulate:
    import mujoco

    file = SdfFile(path)
    pair = file.pair(None)
    own = file.robot(pair, options.radius(model))
    bodies = ""
    for name, axle in zip(pair, (own.left, own.right), strict=True):
        moment = number(file.about_axis(file.joints[name]))
        bodies += (
            f'<body><inertial pos="0 0 0" mass="1" diaginertia="{moment} {moment} {moment}"/>'
            f'<joint name="{name}" type="hinge" axis="0 1 0" damping="{number(axle.damping_nms)}" '
            f'frictionloss="{number(axle.friction_nm)}"/></body>'
        )
    compiled = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    torques = [own.left.torque_nm, own.right.torque_nm]
    return _by_torque(compiled, model, torques, options.radius(model))


def _by_torque(compiled: Any, model: RobotModel, torques: list[float], radius_m: float) -> Simulate:
    """Joints without motors: torques applied to them, with the solver settings that `mjcf` writes."""
    import mujoco

    step_s = mujoco_step(model)
    compiled.opt.timestep, compiled.opt.integrator = step_s, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    compiled.dof_solref[:] = SOLREF_STEPS * step_s, 1.0
    compiled.dof_solimp[:] = IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0

    def act(data: Any, efforts: tuple[float, float]) -> None:
        data.qfrc_applied[:] = np.array(torques) * efforts

    return stepped(compiled, act, lambda data: np.asarray(radius_m * data.qpos))


CONSUMERS = {
    "python": Consumer("Python", "numpy", _python),
    "fmu": Consumer("FMPy", "fmpy", _fmu),
    "mjcf": Consumer("MuJoCo", "mujoco", _mjcf),
    "urdf": Consumer("MuJoCo", "mujoco", _urdf),
    "sdf": Consumer("MuJoCo, its joints", "mujoco", _sdf),
    "simulink": Consumer("SciPy", "scipy", _simulink),
}


def own(model: RobotModel) -> Simulate:
    """The tool's own simulation of a model, in the place of a program's."""
    from truing.model.excitation import excitation
    from truing.model.wheel import simulate_physics

    def simulate(task: Task) -> FloatArray:
        grid, efforts = on_grid(task, _step_s(task))
        before = np.concatenate((np.zeros((2, 1)), efforts), axis=1)
        bounds, interval = np.array([0, grid.size], dtype=np.int64), np.array([grid[1]])
        speeds = []
        for effort, wheel in zip(before, WHEELS, strict=True):
            at_rows = excitation(
                grid, np.ascontiguousarray(effort), np.zeros(grid.size), bounds, interval, grid.size
            )
            now = replace(at_rows, mean_over_interval=False)
            physics = replace(model.wheel(wheel), recorder_lag_s=0.0, recorder_window_s=0.0)
            speeds.append(simulate_physics(physics.to_vector(), now, np.zeros(1)).speed_mps)
        return travelled(task, grid, np.array(speeds))

    return simulate
