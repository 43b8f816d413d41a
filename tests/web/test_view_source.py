"""Where live samples come from: the status at a picture's rate, the telemetry stream for more."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from support.chain import Chain
from truing.web.worker.source import StatusSource, StreamSource, open_source


@pytest.mark.usefixtures("native_library")
def test_two_hundred_samples_a_second_arrive_with_the_command_beside_them(image: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        source = open_source(device, 200.0)
        assert isinstance(source, StreamSource)
        samples, statuses = [], 0
        began = chain.robot.time_s
        while chain.robot.time_s < began + 2.0:
            device.set_velocity(0.3, 0.2)
            for _ in range(2):
                found, status = source.poll(0.02)
                samples += found
                statuses += status is not None
        took = chain.robot.time_s - began
        source.close()
        assert source.lost == 0
        assert set(np.diff(np.round([1000 * sample.t_s for sample in samples]))) == {5}
        assert len(samples) == pytest.approx(200 * took, abs=20)
        assert statuses >= 20
        last = samples[-1]
        assert last.command_mps == pytest.approx((0.3, 0.2))
        assert last.speed_mps == pytest.approx((0.3, 0.2), abs=0.03)
        assert last.odometry.x_m > 0.2
        assert last.battery_v == pytest.approx(12.5, abs=0.5)
        device.stop()


@pytest.mark.usefixtures("native_library")
def test_a_pictures_rate_is_asked_as_status(image: Path) -> None:
    with Chain(image) as chain:
        source = open_source(chain.host())
        assert isinstance(source, StatusSource)
        found, status = source.poll(0.1)
        assert len(found) == 1
        assert status is not None
