"""The baseline.toml that lies beside a trial's recordings: what the user knows of the robot."""

from __future__ import annotations

from typing import Protocol


class Geometry(Protocol):
    """What the user measures on a robot, and reads off its encoders."""

    @property
    def radius_m(self) -> float:
        """Of the wheels."""

    @property
    def wheelbase_m(self) -> float:
        """Distance between the wheels."""

    @property
    def counts_per_rev(self) -> int:
        """Of the encoders, per revolution of the wheel."""


def baseline_text(
    robot: Geometry, gain_mps: tuple[float, float], time_constant_s: tuple[float, float], rate_hz: int
) -> str:
    """The file's text, with these numbers of the left and the right wheel."""
    lines = [
        "[robot]",
        'name = "trial"',
        f"wheel_radius_m = {robot.radius_m:.6g}",
        f"wheelbase_m = {robot.wheelbase_m:.6g}",
        f"counts_per_rev = {robot.counts_per_rev}",
    ]
    for i, side in enumerate(("left", "right")):
        lines += [
            f"[wheel.{side}]",
            f"gain_mps = {gain_mps[i]:.5g}",
            f"time_constant_s = {time_constant_s[i]:.5g}",
        ]
    return "\n".join([*lines, "[log]", f"rate_hz = {rate_hz}", ""])
