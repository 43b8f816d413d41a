"""A tuning leaves the board with its old parameters wherever it ends without a gain."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from truing.board.tuning import tune
from truing.plan import Kind, Plan, Segment

OLD = {"ff_kv": 1.0, "other": 7.0}
PROOF, LEARNING = (
    Plan(name, name, (Segment(Kind.EFFORT, 1.0, 0.0, 0.0),), 20) for name in ("proof", "learning")
)


@dataclass
class Error:
    both_mps: float


class Robot:
    """Follows with the error that belongs to its feedforward; one of its calls may fail."""

    def __init__(self, errors, fails_at="", failure=KeyboardInterrupt):
        self.errors = errors
        self.fails_at = fails_at
        self.failure = failure
        self.values = dict(OLD)
        self.labels = []

    def _now(self, what):
        if what == self.fails_at:
            raise self.failure

    def drive(self, plan, label):
        self.labels.append((plan.name, label))
        self._now(label)
        return self.values["ff_kv"]

    def learn(self, run):
        self._now("learn")
        return {"ff_kv": 2.0}

    def tracking(self, run, parameters):
        assert parameters == OLD
        self._now(f"tracking {run}")
        return Error(self.errors[run])

    def set_parameters(self, values):
        self.values |= values
        self._now("set")

    def restore_parameters(self, values):
        self.values |= values


def test_what_follows_better_is_kept():
    robot = Robot({1.0: 0.02, 2.0: 0.01})
    result = tune(robot, OLD, PROOF, LEARNING)
    assert result.is_better
    assert result.parameters == {"ff_kv": (1.0, 2.0)}
    assert robot.values == OLD | {"ff_kv": 2.0}
    assert robot.labels == [
        ("proof", "tune_before"),
        ("learning", "tune_learning"),
        ("proof", "tune_after"),
    ]


@pytest.mark.parametrize("after", [0.02, 0.03, float("nan")])
def test_what_follows_no_better_is_put_back(after):
    robot = Robot({1.0: 0.02, 2.0: after})
    assert not tune(robot, OLD, PROOF, LEARNING).is_better
    assert robot.values == OLD


@pytest.mark.parametrize(
    "where", ["tune_before", "tracking 1.0", "tune_learning", "learn", "set", "tune_after", "tracking 2.0"]
)
@pytest.mark.parametrize("failure", [KeyboardInterrupt, ValueError])
def test_whatever_ends_it_early_puts_the_old_parameters_back(where, failure):
    robot = Robot({1.0: 0.02, 2.0: 0.01}, where, failure)
    with pytest.raises(failure):
        tune(robot, OLD, PROOF, LEARNING)
    assert robot.values == OLD
