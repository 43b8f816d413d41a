"""What a run's metadata says of the board's clock: device time as this computer's."""

from __future__ import annotations

import datetime
from typing import Any

from truing.clock.probe import ClockProbe
from truing.clock.relation import relate
from truing.errors import ClockError
from truing.link.stream import Stream

# Asked before a download and after it: the download lies between, and so the drift is known too.
STAMP_S = 0.25


def host_utc(stream: Stream, host_s: float) -> str | None:
    """A moment of the stream's clock as UTC by this computer; None for virtual time."""
    if stream.virtual:
        return None
    now = datetime.datetime.now(datetime.UTC)
    return (now - datetime.timedelta(seconds=stream.now_s() - host_s)).isoformat(timespec="microseconds")


def clock_stamp(stream: Stream, probe: ClockProbe) -> dict[str, Any] | None:
    """For a run's metadata; None where too few answers came, or a clock jumped."""
    try:
        relation = relate(probe.trips)
    except ClockError:
        return None
    return {
        "device_s": round(relation.host_s + relation.offset_s, 6),
        "host_s": round(relation.host_s, 6),
        "host_utc": host_utc(stream, relation.host_s),
        "uncertainty_s": round(relation.uncertainty_s(relation.host_s), 6),
        "drift_ppm": round(relation.drift_ppm, 3),
        "drift_ci95_ppm": [round(limit, 3) for limit in relation.drift_ci95_ppm],
        "round_trips": relation.round_trips,
    }
