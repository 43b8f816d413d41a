"""Each effect follows its equation: compared with a fine-stepped simulation that shares no code with it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from support.simulated_runs import GAIN, RADIUS, RICH, TAU, WHEELBASE, Force, fine, motor, recordings
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data.set_data import SetData
from truing.diagnose.simulation.simulator import SetSimulator

Array = NDArray[np.float64]
CLOSE_MPS = 2e-4
FRICTION = np.array([0.05, 0.08])


@cache
def still() -> SetData:
    return recordings()


def simulate(data: SetData, name: str, step_factor: float = 1.0, **values: float) -> Array:
    simulator = SetSimulator(data, step_factor=step_factor)
    return simulator.speeds(vector(simulator, name, **values), simulator.enabled([name]))


def vector(simulator: SetSimulator, name: str, **values: float) -> Array:
    theta = simulator.start()
    for key, value in values.items():
        index = simulator.layout.index(f"{name}.{key}")
        theta[index] = value / simulator.layout.scale[index]
    return theta


def rms(data: SetData, difference: Array) -> float:
    return float(np.sqrt(np.mean(difference[data.judged] ** 2)))


def plain(t: float, v: Array, u: Array) -> Array:
    return motor(v, u)


def sagging(t: float, v: Array, u: Array) -> Array:
    """The voltage that solves V = 1 - 0.15 sum(u (u V - v / gain)): currents lower it, and it lowers them."""
    voltage = (1.0 + 0.15 * float(np.sum(u * v / GAIN))) / (1.0 + 0.15 * float(np.sum(u * u)))
    return np.asarray(u * voltage - v / GAIN)


def scrubbed(t: float, v: Array, u: Array) -> Array:
    shear = float(np.clip((v[0] - v[1]) / 1e-4, -1.0, 1.0)) * 0.1
    return motor(v, u) - shear * np.array([1.0, -1.0])


def coupled(t: float, v: Array, u: Array) -> Array:
    slope = GAIN / TAU
    own = slope * motor(v, u)
    return np.asarray((own + 0.3 * own[::-1]) / slope)


def asymmetric(t: float, v: Array, u: Array) -> Array:
    ratio = np.where(np.where(v != 0.0, v, u) < 0.0, np.array([0.8, 1.2]), 1.0)
    return np.asarray(ratio * u - v / GAIN)


Dry = Callable[[Array], Array]
CASES: dict[str, tuple[Force, Dry | None, dict[str, float]]] = {
    "coulomb_friction": (plain, lambda v: FRICTION, {"left": 0.05, "right": 0.08}),
    "stribeck_friction": (
        plain,
        lambda v: FRICTION + np.array([0.08, 0.04]) * np.exp(-((v / 0.08) ** 2)),
        {"left": 0.05, "right": 0.08, "excess_left": 0.08, "excess_right": 0.04, "stribeck": 0.08},
    ),
    "quadratic_drag": (
        lambda t, v, u: motor(v, u) - np.array([0.1, 0.2]) * v * np.abs(v),
        None,
        {"left": 0.1, "right": 0.2},
    ),
    "driver_deadband": (
        lambda t, v, u: motor(v, np.sign(u) * np.maximum(np.abs(u) - 0.07, 0.0)),
        None,
        {"deadband": 0.07},
    ),
    "supply_sag": (sagging, None, {"drop_at_stall": 0.3}),
    "current_limit": (lambda t, v, u: np.clip(motor(v, u), -0.5, 0.5), None, {"limit": 0.5}),
    "direction_asymmetry": (asymmetric, None, {"left": 0.8, "right": 1.2}),
    "floor_slope": (
        lambda t, v, u: motor(v, u) - 9.80665 * 0.05 * TAU / GAIN,
        None,
        {"uphill_cosine": 0.05},
    ),
    "coast_decay": (
        lambda t, v, u: np.where(np.abs(u) < 1e-9, -0.6 * v / GAIN, motor(v, u)),
        None,
        {"release": 0.4},
    ),
    "turning_scrub": (scrubbed, None, {"scrub": 0.1}),
    "inertia_coupling": (coupled, None, {"coupling": 0.3}),
}
JUMPING = ("coulomb_friction", "stribeck_friction", "direction_asymmetry", "turning_scrub")


@pytest.mark.parametrize("name", CASES)
def test_an_effect_follows_its_equation(name: str) -> None:
    force, dry, values = CASES[name]
    data = still()
    # Where no force jumps at standstill, 0.5 ms and 0.1 ms are within 3e-7 m/s of each other; else 1e-4.
    step_s = 1e-4 if name in JUMPING else 5e-4
    reference = np.concatenate([fine(effort, force, dry, step_s=step_s) for effort in RICH])
    assert rms(data, simulate(data, name, **values) - reference) < CLOSE_MPS
    assert rms(data, reference - simulate(data, name)) > 50 * CLOSE_MPS


@pytest.mark.parametrize("shift", [0.0, 0.037, 0.12])
def test_a_delay_is_the_same_motion_later(shift: float) -> None:
    data = still()
    late = simulate(data, "input_delay", delay=shift)
    for run in range(data.runs):
        rows = data.rows_of(run)
        effort = np.repeat(data.effort[rows][1:], 500, axis=0)
        moved = np.concatenate((np.zeros((round(shift * 10_000), 2)), effort))[: len(effort)]
        v, travel = np.zeros(2), [np.zeros(2)]
        total = np.zeros(2)
        for k, u in enumerate(moved):
            after = GAIN * u + (v - GAIN * u) * np.exp(-1e-4 / TAU)
            total = total + GAIN * u * 1e-4 + (v - GAIN * u) * TAU * (1.0 - np.exp(-1e-4 / TAU))
            v = after
            if (k + 1) % 500 == 0:
                travel.append(total.copy())
        np.testing.assert_allclose(late[rows][1:], np.diff(travel, axis=0) * 20.0, atol=1e-9)


def test_a_lag_ahead_of_the_motor_gives_the_second_order_step() -> None:
    data = recordings((np.concatenate((np.zeros((11, 2)), np.full((60, 2), 0.5))),))
    speed = simulate(data, "driver_lag", time_constant=0.1)
    t = data.t_s - data.t_s[10]
    for w in range(2):
        gain, slow, fast = GAIN[w] * 0.5, TAU[w], 0.1
        after = np.maximum(t, 0.0)
        travel = gain * (
            after
            - (slow**2 * (1 - np.exp(-after / slow)) - fast**2 * (1 - np.exp(-after / fast))) / (slow - fast)
        )
        assert rms_rows(speed[1:, w] - np.diff(travel) * 20.0) < CLOSE_MPS


def test_a_filtered_speed_is_the_lagged_step_while_the_robot_is_not_delayed() -> None:
    data = recordings((np.concatenate((np.zeros((11, 2)), np.full((60, 2), 0.5))),), source="vel")
    filtered = simulate(data, "speed_filter", time_constant=0.1)
    lagged = simulate(data, "driver_lag", time_constant=0.1)
    assert rms_rows(filtered - lagged) < CLOSE_MPS  # two linear filters commute


@pytest.mark.parametrize(("name", "number"), [("input_delay", "delay"), ("speed_filter", "time_constant")])
def test_each_wheel_may_have_its_own_delay_or_filter(name: str, number: str) -> None:
    data = recordings(source="vel")
    both = simulate(data, name, **{number: 0.05, "difference": 0.06})
    for wheel, own in enumerate((0.02, 0.08)):
        alone = simulate(data, name, **{number: own})
        np.testing.assert_allclose(both[:, wheel], alone[:, wheel], atol=1e-9)
    # The left wheel's cannot be below zero.
    far = simulate(data, name, **{number: 0.05, "difference": 0.2})
    np.testing.assert_allclose(far[:, 0], simulate(data, name)[:, 0], atol=1e-9)


def test_a_speed_limit_is_flat_above_and_exact_below() -> None:
    data = still()
    limited, free = simulate(data, "speed_limit", limit=0.6), simulate(data, "speed_limit")
    assert np.abs(limited).max() <= 0.6 + 1e-12
    first = int(np.flatnonzero(np.abs(free) > 0.6)[0] // 2)
    np.testing.assert_array_equal(limited[: first - 1], free[: first - 1])
    assert (np.abs(limited) > 0.6 - 1e-9).sum() > 20


def test_sides_differ_by_the_ratio_and_keep_their_mean() -> None:
    data = recordings(equal=True)
    speed = simulate(data, "side_asymmetry", gain_ratio=1.21)
    free = simulate(data, "side_asymmetry")
    np.testing.assert_allclose(speed[:, 0], 1.1 * free[:, 0], atol=1e-9)
    np.testing.assert_allclose(speed[:, 1], free[:, 1] / 1.1, atol=1e-9)


def test_a_load_put_on_halfway_slows_what_comes_after() -> None:
    data = still()
    half = data.elapsed_s[data.rows_of(1)][0]
    loaded = simulate(data, "payload_change", time_constant_ratio=1.5, at=half)
    before = data.rows_of(0)
    free = simulate(data, "payload_change")
    np.testing.assert_array_equal(loaded[before], free[before])
    reference = fine(RICH[1], plain, slope=GAIN / (1.5 * TAU))
    assert rms_rows(loaded[~before] - reference) < CLOSE_MPS


def rms_rows(difference: Array) -> float:
    return float(np.sqrt(np.mean(difference**2)))


def test_heat_takes_its_share_of_the_gain_where_the_winding_is_warmest() -> None:
    busy = np.concatenate((np.zeros((11, 2)), np.tile([[0.6, 0.6]] * 20 + [[-0.6, -0.6]] * 20, (10, 1))))
    data = recordings((busy,))
    simulator = SetSimulator(data)
    on = simulator.enabled(["winding_heating"])
    warm = simulator.speeds(
        vector(simulator, "winding_heating", gain_drop=0.2, thermal_time_constant=1000.0), on
    )
    free = simulator.speeds(simulator.start(), on)
    ratio = np.abs(warm[:, 0]).reshape(-1)[30::40] / np.abs(free[:, 0])[30::40]
    assert np.all(np.diff(ratio) < 0.0)  # slower from cycle to cycle
    assert ratio[0] > 0.97
    assert ratio[-1] == pytest.approx(0.8, abs=0.02)


def test_charge_drawn_lowers_the_supply_from_the_first_moment_to_the_last() -> None:
    cycles = np.tile([[0.6, 0.6]] * 20 + [[-0.6, -0.6]] * 20, (10, 1))
    data = recordings((np.concatenate((np.zeros((11, 2)), cycles)),))
    sagged = simulate(data, "supply_sag", drop_over_set=0.2)
    free = simulate(data, "supply_sag")
    assert abs(sagged[14, 0]) == pytest.approx(abs(free[14, 0]), rel=0.02)
    assert abs(sagged[-1, 0]) == pytest.approx(0.8 * abs(free[-1, 0]), rel=0.01)


def turning_wheel(speed: float = 0.25, seconds: float = 8.0) -> SetData:
    """Both wheels creep: 0.25 m/s is 0.63 turns a second."""
    effort = np.concatenate((np.zeros((11, 2)), np.full((round(20 * seconds), 2), speed) / GAIN))
    free = SetSimulator(recordings((effort,)))
    return recordings((effort,), (free.speeds(free.start(), free.enabled([])),))


def test_ripple_pushes_with_the_measured_angle() -> None:
    data = turning_wheel()
    assert data.angle_rad is not None
    speed = simulate(data, "torque_ripple", sine_left=0.05, cosine_right=0.05, per_revolution=3.0)
    grid = np.arange(0.0, data.t_s[-1], 1e-3)
    angle = np.stack([np.interp(grid, data.t_s, data.angle_rad[:, w]) for w in range(2)], axis=1)
    push = 0.05 * np.stack([np.sin(3.0 * angle[:, 0]), np.cos(3.0 * angle[:, 1])], axis=1)

    def force(t: float, v: Array, u: Array) -> Array:
        return motor(v, u) + push[min(round(t * 1e3), len(push) - 1)]

    reference = fine(data.effort, force, step_s=1e-3)
    free = simulate(data, "torque_ripple")
    assert rms(data, speed - reference) < 0.03 * rms(data, reference - free)


def test_an_eccentric_disc_adds_the_change_of_its_error() -> None:
    data = turning_wheel()
    assert data.angle_rad is not None
    speed = simulate(data, "encoder_eccentricity", sine_left=0.03)
    error = RADIUS * 0.03 * np.diff(np.sin(data.angle_rad[:, 0])) * 20.0
    np.testing.assert_allclose(
        speed[1:, 0], simulate(data, "encoder_eccentricity")[1:, 0] + error, atol=1e-12
    )


def test_lost_counts_grow_with_speed_and_are_given_back_on_the_ground() -> None:
    data = still()
    lost = simulate(data, "encoder_dropout", left=0.2)
    free = simulate(data, "encoder_dropout")
    np.testing.assert_allclose(
        lost[:, 0], free[:, 0] * (1.0 - 0.2 * np.abs(free[:, 0]) / GAIN[0]), atol=1e-12
    )
    seen = recordings(RICH, tuple(lost[data.rows_of(k)] for k in range(data.runs)))
    simulator = SetSimulator(seen)
    motion = simulator.ground(
        vector(simulator, "encoder_dropout", left=0.2), simulator.enabled(["encoder_dropout"])
    )
    np.testing.assert_allclose(motion[seen.judged, 0], 0.05 * free[seen.judged].mean(axis=1), atol=2e-6)


def test_backlash_lets_the_encoder_leap_by_the_gap_and_then_wait_for_the_wheel() -> None:
    effort = np.concatenate((np.zeros((11, 2)), np.full((40, 2), 0.5), np.full((40, 2), -0.5)))
    data = recordings((effort,))
    gap = 0.1
    loose = simulate(data, "gear_backlash", left=gap, right=gap, motor_share=0.2)
    free = simulate(data, "gear_backlash")
    ahead = np.cumsum(loose - free, axis=0)[:, 0] / 20.0
    assert 0.25 < ahead[11] / (gap * RADIUS) < 0.5  # from the middle of the gap
    assert -1.0 < ahead[51] / (gap * RADIUS) < -0.6  # across all of it
    np.testing.assert_allclose(loose[-1], free[-1], atol=1e-3)


def test_backlash_matches_two_masses_in_tiny_steps() -> None:
    effort = np.concatenate((np.zeros((11, 2)), np.full((20, 2), 0.5), np.full((20, 2), -0.5)))
    data = recordings((effort,))
    share, width = 0.2, 0.1 * RADIUS
    slope = float(GAIN[0] / TAU[0])
    fast = slow = 0.0
    place, h = 0.5 * width, 2e-5
    travel, out, touching = 0.0, [0.0], 0
    for u in effort[1:, 0]:
        start = travel
        for _ in range(2500):
            pull = u - fast / GAIN[0]
            if touching and touching * pull < 0.0:
                touching = 0
            if touching:
                fast += h * slope * pull
                slow = fast
            else:
                fast += h * slope / share * pull
                place += h * (fast - slow)
                if not 0.0 < place < width:
                    touching = 1 if place >= width else -1
                    place = min(max(place, 0.0), width)
                    fast = slow = share * fast + (1.0 - share) * slow
            travel += h * fast
        out.append((travel - start) * 20.0)
    speed = simulate(data, "gear_backlash", left=0.1, right=0.1, motor_share=0.2)[:, 0]
    assert rms_rows(speed - np.array(out)) < 2e-3
    assert rms_rows(np.array(out) - simulate(data, "gear_backlash")[:, 0]) > 1e-2


def test_a_slipping_robot_gains_speed_no_faster_than_its_grip() -> None:
    effort = np.concatenate((np.zeros((11, 2)), np.full((40, 2), 0.9)))
    data = recordings((effort,))
    simulator = SetSimulator(data)
    theta = vector(simulator, "wheel_slip", grip=0.15, spin_share=0.2)
    on = simulator.enabled(["wheel_slip"])
    wheel = simulator.speeds(theta, on)
    # The encoders of this log stand still, so that what the ground loses to slip is all that is left.
    robot = wheel.mean(axis=1) + 20.0 * simulator.ground(theta, on)[:, 0]
    limit = 0.15 * 9.80665
    assert np.diff(robot).max() * 20.0 <= limit + 1e-6
    free = simulator.speeds(simulator.start(), on)
    assert (wheel - free)[11:16].min() > 0.05  # the wheel shoots ahead
    # Tiny steps of the same two bodies.
    slope = float(GAIN[0] / TAU[0])
    v = g = travel = 0.0
    out, h = [0.0], 2e-5
    for u in effort[1:, 0]:
        start = travel
        for _ in range(2500):
            whole = slope * (u - v / GAIN[0])
            if v <= g + 1e-9 and abs(whole) <= limit:
                v = g = g + h * whole
            else:
                v += h * (whole - 0.8 * limit) / 0.2
                g += h * limit
                v = max(v, g)
            travel += h * v
        out.append((travel - start) * 20.0)
    assert rms_rows(wheel[:, 0] - np.array(out)) < 1e-3


def test_a_wheel_pushed_less_than_its_friction_stays_exactly_at_rest() -> None:
    data = recordings((np.full((40, 2), 0.04),))
    assert not simulate(data, "coulomb_friction", left=0.05, right=0.05).any()


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_half_the_substep_changes_nothing_that_a_log_could_show(name: str) -> None:
    data = turning_wheel() if name in ("torque_ripple", "encoder_eccentricity") else still()
    effect = CATALOGUE[name]
    values = {
        item.name: (item.starts[-1] if item.starts else item.off)
        * SetSimulator(data).layout.scale[SetSimulator(data).layout.index(f"{name}.{item.name}")]
        for item in effect.parameters
    }
    coarse, fine_ = simulate(data, name, **values), simulate(data, name, 0.5, **values)
    assert rms(data, coarse - fine_) < 1e-4


def test_pose_effects_scale_distance_turn_and_drift() -> None:
    effort = np.concatenate((np.zeros((11, 2)), np.tile([[0.3, 0.4]], (60, 1))))
    free = SetSimulator(recordings((effort,)))
    data = recordings((effort,), (free.speeds(free.start(), free.enabled([])),))
    simulator = SetSimulator(data)
    wheels = np.diff(data.travel_m, axis=0)

    def ground(name: str, **values: float) -> Array:
        return simulator.ground(vector(simulator, name, **values), simulator.enabled([name]))[1:]

    turn = (wheels[:, 1] - wheels[:, 0]) / WHEELBASE
    np.testing.assert_allclose(ground("wheelbase_error", factor=1.25)[:, 1], turn / 1.25, atol=1e-12)
    np.testing.assert_allclose(
        ground("wheel_radius_error", left=1.1, right=1.1)[:, 0], 1.1 * wheels.mean(axis=1), atol=1e-12
    )
    drifted = ground("heading_drift", drift=-0.3, distance_scale=0.07)
    np.testing.assert_allclose(drifted[:, 1], turn - 0.3 * wheels.mean(axis=1), atol=1e-12)
    np.testing.assert_allclose(drifted[:, 0], 1.07 * wheels.mean(axis=1), atol=1e-12)
    scaled = ground("encoder_scale", left=0.5, right=1.0)
    np.testing.assert_allclose(scaled[:, 0], wheels[:, 0] + 0.5 * wheels[:, 1], atol=1e-12)
    assert math.isclose(drifted[:, 2].sum(), 0.0)
