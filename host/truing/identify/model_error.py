"""The two errors of a model, as two types, so that one is never taken for the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from truing.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class FreeRunError:
    """Error of a simulation that sees the efforts and where it starts, never a measured speed after it.

    Attributes
    ----------
    rms_mps : over all runs, every run with the same weight, m/s.
    by_run_mps : run name to its own RMS, m/s.
    scale_mps : the 98th percentile of |speed| over the set, m/s: what `percent` refers to.
    held_out : whether each run was judged by a model that had not seen it.
    """

    rms_mps: float
    by_run_mps: dict[str, float]
    scale_mps: float
    held_out: bool

    @property
    def percent(self) -> float:
        """RMS in per cent of the scale."""
        return 100.0 * self.rms_mps / self.scale_mps if self.scale_mps > 0.0 else float("nan")

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "kind": "free_run_held_out" if self.held_out else "free_run",
            "rms_mps": self.rms_mps,
            "percent": self.percent,
            "p98_speed_mps": self.scale_mps,
            "by_run_mps": dict(self.by_run_mps),
        }


@dataclass(frozen=True, slots=True)
class OneStepError:
    """Error of a prediction of the next sample from the measured samples before it.

    It is small for any smooth signal, even from a model that cannot simulate; judge a simulator by
    `FreeRunError`.

    Attributes
    ----------
    rms_mps : over all runs, every run with the same weight, m/s.
    by_run_mps : run name to its own RMS, m/s.
    held_out : whether each run was judged by a model that had not seen it.
    """

    rms_mps: float
    by_run_mps: dict[str, float]
    held_out: bool

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "kind": "one_step_held_out" if self.held_out else "one_step",
            "rms_mps": self.rms_mps,
            "by_run_mps": dict(self.by_run_mps),
        }


def free_run_error(
    names: tuple[str, ...], by_run: FloatArray, scale_mps: float, *, held_out: bool = False
) -> FreeRunError:
    """From the RMS of each run, shape (runs,), m/s."""
    table = {name: float(value) for name, value in zip(names, by_run, strict=True)}
    return FreeRunError(float(np.sqrt(np.mean(by_run**2))), table, scale_mps, held_out)


def one_step_error(names: tuple[str, ...], by_run: FloatArray, *, held_out: bool = False) -> OneStepError:
    """From the RMS of each run, shape (runs,), m/s."""
    table = {name: float(value) for name, value in zip(names, by_run, strict=True)}
    return OneStepError(float(np.sqrt(np.mean(by_run**2))), table, held_out)
