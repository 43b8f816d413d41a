"""Selection of the speed signal to diagnose: from counts, or the recorder's own speed where that lags them.

Counts give the wheel's speed without a filter, so they are used where they are logged. Where the recorder's
speed column lags them, that column is what a simulation is compared with in practice, and the filter can
only be estimated there.
"""

from __future__ import annotations

from dataclasses import replace

from truing.diagnose.data.set_data import SetData
from truing.diagnose.effects.speed_filter import lag_is_significant


def with_selected_signal(data: SetData) -> SetData:
    """The set with the recorder's speeds where these lag its counts significantly."""
    if data.source == "vel" or not lag_is_significant(data):
        return data
    return with_recorder_speeds(data)


def with_recorder_speeds(data: SetData) -> SetData:
    """The set with the recorder's own speeds where it has any."""
    if data.recorded_vel_mps is None:
        return data
    return replace(data, speed_mps=data.recorded_vel_mps, source="vel")
