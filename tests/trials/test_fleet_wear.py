"""A small fleet of the plant's robots: the one whose friction grows by 1 % a week is found, and no other."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.fleet_robots import Fleet, record_fleet
from support.fleet_sets import cluster_in_this_process


@pytest.mark.slow
def test_friction_that_grows_by_one_per_cent_a_week_is_found_and_nothing_else(
    native_library: Path, tmp_path: Path
) -> None:
    """As `./run bench fleet`, whose year has 50 robots and 27 recordings of each."""
    from truing.fleet.analysis import analyse
    from truing.fleet.catalogue import read_catalogue
    from truing.fleet.run import existing_parts, jobs_of, run_fleet
    from truing.fleet.storage import Place
    from truing.fleet.tables import gather

    fleet = Fleet(robots=7, weeks=(0.0, 8.0, 16.0, 24.0, 33.0, 42.0, 52.0), worn=5)
    record_fleet(fleet, tmp_path / "recordings")
    place = Place(str(tmp_path / "out"))
    jobs = jobs_of(read_catalogue([str(tmp_path / "recordings")]).sets, place.url, diagnose=False)
    with cluster_in_this_process() as engine:
        ran = run_fleet(jobs, place, engine)
    assert not ran.failed
    analysis = analyse(gather(place, ran.parts, existing_parts(place)))
    found = {(one.series.robot, one.series.parameter, one.series.wheel): one for one in analysis.drifting}
    assert set(found) == {("rover-005", "friction", "left"), ("rover-005", "friction", "right")}
    for one in found.values():
        assert one.form == "line"
        assert one.relative == pytest.approx(0.52, abs=0.08)
        assert one.ci95[0] < 0.01 * one.level * 365.25 / 7.0 < one.ci95[1]
