"""The odometry error model of the MOM Simulator View paper against its own Table 2."""

from __future__ import annotations

import math

import numpy as np
import pytest

from truing.studies.mom_odometry import (
    DESIRED,
    PAPER_MODEL,
    PRINTED_MODEL,
    REAL,
    START,
    ErrorModel,
    advance,
    fit_line,
    replay,
    straight_line,
    study_mom,
)


def test_the_papers_own_constants_do_not_end_where_its_table_says() -> None:
    end = study_mom().paper.end
    assert (end.x_m, end.y_m, end.theta_deg) == pytest.approx((3.156, 1.680, 2.9), abs=0.03)
    assert (end.x_m, end.y_m) == pytest.approx((3.156, 1.680), abs=0.001)
    assert end.distance_m(PRINTED_MODEL) > 0.4
    assert end.turn_deg(PRINTED_MODEL) == pytest.approx(13.27, abs=0.01)


def test_the_real_end_asks_for_a_stronger_drift_and_then_lies_within_a_centimetre() -> None:
    fitted = study_mom().fitted
    assert fitted.model.scale == pytest.approx(0.067, abs=0.0005)
    assert fitted.model.straight == pytest.approx(-0.315, abs=0.0006)
    assert fitted.end.distance_m(REAL) < 0.010
    assert abs(fitted.end.turn_deg(REAL)) < 0.01


def test_the_printed_simulated_end_has_no_distance_scale_in_it() -> None:
    implied = study_mom().implied
    assert implied.model.scale == pytest.approx(0.0, abs=0.001)
    assert implied.model.straight == pytest.approx(-0.3465, abs=0.0005)


@pytest.mark.parametrize(("scale", "drift"), [(0.05, -0.2), (-0.03, 0.4), (0.0, 1e-6)])
def test_a_lines_end_gives_back_the_model_that_made_it(scale: float, drift: float) -> None:
    path = replay(ErrorModel(scale, drift), START, *straight_line())
    x, y, theta = path[-1].tolist()
    found = fit_line(type(START)(x, y, math.degrees(theta)))
    assert (found.scale, found.straight) == pytest.approx((scale, drift), abs=1e-9)


def test_short_steps_end_on_the_arc_that_the_equations_tend_to() -> None:
    length = START.distance_m(DESIRED)
    turned = PAPER_MODEL.straight * length
    chord = length * (1 + PAPER_MODEL.scale) * math.sin(turned / 2) / (turned / 2)
    along = math.radians(45.0) + turned / 2
    end = replay(PAPER_MODEL, START, *straight_line(1e-4))[-1]
    assert end[0] == pytest.approx(START.x_m + chord * math.cos(along), abs=1e-4)
    assert end[1] == pytest.approx(START.y_m + chord * math.sin(along), abs=1e-4)


def test_a_turn_drifts_a_tenth_as_much_and_with_its_own_sense() -> None:
    turns = np.array([0.1, -0.1, 0.0])
    path = replay(PAPER_MODEL, START, np.full(3, 0.02), turns)
    drifts = np.diff(path[:, 2]) - turns
    assert drifts == pytest.approx([0.02 * 0.02635, -0.02 * 0.02635, -0.02 * 0.2635])


def test_equal_wheels_drive_ahead_though_equation_four_prints_a_difference() -> None:
    ahead, turn = advance((0.3, 0.3), 0.3, 0.1)
    assert (ahead, turn) == pytest.approx((0.03, 0.0))
