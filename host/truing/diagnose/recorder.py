"""Which of a recorder's signals is judged: its counts, unless its own speeds lag them.

Counts tell the wheel's speed without a filter between, so they are judged where they are logged. Where the
recorder's speed column lags them, that column is what a simulation is held against in practice, and what
its filter adds can only be seen there.
"""

from __future__ import annotations

from dataclasses import replace

from truing.diagnose.data import SetData
from truing.diagnose.effects.speed_filter import told_apart


def with_judged_signal(data: SetData) -> SetData:
    """The set, its speeds those of the recorder where they lag its own counts."""
    if data.source == "vel" or not told_apart(data):
        return data
    return in_recorders_speeds(data)


def in_recorders_speeds(data: SetData) -> SetData:
    """The set, its speeds those of the recorder where it has any."""
    if data.recorded_vel_mps is None:
        return data
    return replace(data, speed_mps=data.recorded_vel_mps, source="vel")
