"""The kinds of files that a model is exported as; a test keeps them equal to the exporters."""

from __future__ import annotations

# First those for simulators, then controllers, then the rest.
KINDS: dict[str, str] = {
    "mjcf": "MJCF: MuJoCo",
    "sdf": "SDF: Gazebo",
    "urdf": "URDF",
    "fmu": "FMU: FMI 2.0 co-simulation, Linux on x86-64",
    "wpilib": "gains kS, kV, kA: WPILib",
    "ros2-control": "ros2_control: diff_drive_controller",
    "c": "C: one file that simulates",
    "c-header": "C: a header with the board's parameters",
    "python": "Python: one file, no packages",
    "simulink": "Simulink: state space and script",
    "mat": "MATLAB structure",
    "toml": "TOML: the whole model",
}
