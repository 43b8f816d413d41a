"""A user's own MuJoCo robot, and recordings of the "real" one: the same robot with physics added to it.

It stands for the file that somebody has: free body, wheels on a floor, casters, motors with a gear, names of
its own. `written` writes it; keywords change the robot that is then driven and recorded.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

RADIUS_M, WHEELBASE_M, COUNTS_PER_REV = 0.05, 0.24, 4096
ROW_S = 0.02
# What a data sheet says: gain and time constant of the robot without the hidden physics.
GUESSED = "".join(f"[wheel.{side}]\ngain_mps = 1.04\ntime_constant_s = 0.23\n" for side in ("left", "right"))


def text(
    *,
    mass_kg: float = 2.0,
    frictionloss: float = 0.0,
    damping: float = 0.012,
    gear: float = 0.25,
    delay_s: float = 0.0,
    step_s: float = 0.002,
) -> str:
    """The robot as MJCF."""
    share = mass_kg / 2.0
    delay = f' delay="{delay_s - 0.5 * step_s}" nsample="{round(delay_s / step_s) + 1}"' if delay_s else ""
    axle = "".join(
        f"""
      <body name="{body}" pos="0 {y} 0">
        <joint name="{joint}" type="hinge" axis="0 1 0" damping="{damping}" frictionloss="{frictionloss}"
               solreffriction="{2 * step_s} 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"/>
        <geom type="cylinder" size="{RADIUS_M} 0.012" euler="1.5707963 0 0" mass="0.08"/>
      </body>"""
        for body, joint, y in (("tyre_l", "axle_l", 0.12), ("tyre_r", "axle_r", -0.12))
    )
    casters = "".join(
        f'\n      <geom type="sphere" size="0.015" pos="{x} 0 -0.035" priority="1" condim="1" mass="0"/>'
        for x in (0.08, -0.08)
    )
    return f"""<mujoco model="my robot">
  <!-- measured on the bench -->
  <compiler angle="radian"/>
  <option timestep="{step_s}" integrator="implicitfast" cone="elliptic" impratio="10"/>
  <worldbody>
    <geom name="floor" type="plane" size="50 50 0.1" friction="2 0.005 0.0001"/>
    <body name="chassis" pos="0 0 {RADIUS_M}">
      <freejoint/>
      <inertial pos="0 0 -0.03" mass="{mass_kg}"
                diaginertia="{0.008 * share} {0.009 * share} {0.016 * share}"/>{casters}{axle}
    </body>
  </worldbody>
  <actuator>
    <motor name="motor_l" joint="axle_l" gear="{gear}" ctrlrange="-1 1"{delay}/>
    <motor name="motor_r" joint="axle_r" gear="{gear}" ctrlrange="-1 1"{delay}/>
  </actuator>
</mujoco>
"""


Efforts = tuple[tuple[float, float, float], ...]
# (left, right, seconds): what a model is fitted to, and what then tests it.
STRAIGHT: dict[str, Efforts] = {
    "steps": ((0.0, 0.0, 0.3), (0.4, 0.4, 1.2), (0.8, 0.8, 1.2), (0.2, 0.2, 1.0), (0.0, 0.0, 0.7)),
    "gentle": ((0.06, 0.06, 0.8), (0.15, 0.15, 1.2), (-0.5, -0.5, 1.2), (-0.1, -0.1, 0.8), (0.0, 0.0, 0.4)),
}
TURNING: dict[str, Efforts] = {
    "one_wheel": ((0.5, 0.0, 1.2), (0.3, 0.6, 1.2), (0.0, 0.0, 0.5)),
    "on_the_spot": ((0.4, -0.4, 1.2), (-0.6, -0.4, 1.2), (0.0, 0.0, 0.5)),
}


def record(mjcf: str, plan: Efforts) -> str:
    """Drive a robot by (left, right, seconds) and log rows of 20 ms: a run's CSV."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf)
    data = mujoco.MjData(model)
    angles = [model.joint(name).qposadr[0] for name in ("axle_l", "axle_r")]
    steps = round(ROW_S / model.opt.timestep)
    efforts = np.concatenate([np.tile((a, b), (round(s / ROW_S), 1)) for a, b, s in plan])
    rows = ["t_s,effort_left,effort_right,ticks_left,ticks_right", "0.0,0.0,0.0,0,0"]
    for number, effort in enumerate(efforts, start=1):
        data.ctrl[:] = effort
        for _ in range(steps):
            mujoco.mj_step(model, data)
        counts = np.floor(data.qpos[angles] * COUNTS_PER_REV / (2.0 * np.pi)).astype(int)
        rows.append(f"{ROW_S * number:.3f},{effort[0]},{effort[1]},{counts[0]},{counts[1]}")
    return "\n".join(rows) + "\n"


def write_set(folder: Path, mjcf: str, plans: dict[str, Efforts]) -> Path:
    """A recording set of that robot: the runs, and a baseline."""
    (folder / "runs").mkdir(parents=True)
    robot = f"wheel_radius_m = {RADIUS_M}\nwheelbase_m = {WHEELBASE_M}\ncounts_per_rev = {COUNTS_PER_REV}\n"
    (folder / "baseline.toml").write_text(f"[robot]\n{robot}{GUESSED}")
    for number, (name, plan) in enumerate(plans.items(), start=1):
        (folder / "runs" / f"{number:02d}_{name}.csv").write_text(record(mjcf, plan))
    return folder
