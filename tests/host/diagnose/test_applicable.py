"""What no signal separates is not tested: counts per revolution and gain, without a pose from outside."""

from __future__ import annotations

import numpy as np

from support.simulated_runs import RICH, recordings
from truing.diagnose.applicable import applicable_effects
from truing.diagnose.data.set_data import SetData
from truing.diagnose.problem import effect_columns
from truing.diagnose.simulation.simulator import SetSimulator


def moving(*, equal: bool, gyro: bool) -> SetData:
    speeds = tuple(0.8 * run for run in RICH)
    extra = tuple({"gyro_z_radps": np.zeros(len(run))} for run in RICH) if gyro else ()
    return recordings(RICH, speeds, equal=equal, extra=extra)


def free(data: SetData) -> list[str]:
    return [column.name for column in effect_columns(SetSimulator(data), "encoder_scale", ())]


def test_counts_per_revolution_are_one_with_free_gains() -> None:
    assert "encoder_scale" not in applicable_effects(moving(equal=False, gyro=False))


def test_of_equal_wheels_the_ratio_of_the_scales_is_free() -> None:
    data = moving(equal=True, gyro=False)
    assert "encoder_scale" in applicable_effects(data)
    assert free(data) == ["encoder_scale.left"]


def test_a_yaw_rate_separates_scales_from_gains() -> None:
    data = moving(equal=False, gyro=True)
    assert "encoder_scale" in applicable_effects(data)
    assert free(data) == ["encoder_scale.left", "encoder_scale.right"]
