"""What a model consists of beyond gain and time constant, and which of it a format cannot hold."""

from __future__ import annotations

from dataclasses import dataclass

from truing.errors import TruingError
from truing.model.robot_model import RobotModel
from truing.model.wheel import WheelPhysics

# Full effort, V, where a format wants volts.
NOMINAL_VOLTAGE_V = 12.0
# Mass that makes the default inertia of the joint formats, kg; see `joint`.
REFERENCE_MASS_KG = 5.0

# Term: the fields of a wheel's physics that make it, each with its unit. The recorder's lag and window
# are left aside: they belong to the recording, not to the robot.
TERMS: dict[str, dict[str, str]] = {
    "friction": {"friction": "effort"},
    "delay": {"delay_s": "s"},
    "breakaway": {"breakaway_excess": "effort", "stribeck_mps": "m/s"},
    "drag": {"drag": "effort/(m/s)^2"},
    "offset": {"offset": "effort"},
    "lag": {"lag_s": "s"},
    "deadband": {"deadband": "effort"},
    "direction": {
        "reverse_gain": "reverse over forward",
        "reverse_time_constant": "reverse over forward",
        "reverse_friction": "reverse over forward",
        "reverse_excess": "reverse over forward",
    },
    "supply": {"supply_share": "of the supply's change"},
}
# What `HOLDS` says where a format carries learned lookups (`RobotModel.correction`).
CORRECTION = "correction"
EVERYTHING = frozenset((*TERMS, CORRECTION))
# The fields whose default alone says that a term is absent.
_MARKS = {"breakaway": ("breakaway_excess",)}


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What a model does not say and some formats need.

    Parameters
    ----------
    nominal_voltage_v : full effort, V.
    inertia_kgm2 : inertia of each wheel's axle with everything it accelerates; None: see `joint`.
    wheel_radius_m, wheelbase_m : stand in for the model's geometry where it has none.
    period_s : sampling interval of discrete models; None: the model's own rate, else 0.05 s.
    """

    nominal_voltage_v: float = NOMINAL_VOLTAGE_V
    inertia_kgm2: float | None = None
    wheel_radius_m: float | None = None
    wheelbase_m: float | None = None
    period_s: float | None = None

    def radius(self, model: RobotModel) -> float:
        """Wheel radius, m."""
        value = model.robot.wheel_radius_m or self.wheel_radius_m
        if value is None:
            raise TruingError(
                "the model has no wheel radius, and this format needs one",
                "Give --wheel-radius, or wheel_radius_m under [robot] in the model",
            )
        return value

    def wheelbase(self, model: RobotModel) -> float:
        """Distance between the wheels, m."""
        value = model.robot.wheelbase_m or self.wheelbase_m
        if value is None:
            raise TruingError(
                "the model has no wheelbase, and this format needs one",
                "Give --wheelbase, or wheelbase_m under [robot] in the model",
            )
        return value

    def period(self, model: RobotModel) -> float:
        """Sampling interval, s."""
        return self.period_s or (1.0 / model.rate_hz if model.rate_hz else 0.05)


DEFAULTS = ExportOptions()


def wheels(model: RobotModel) -> tuple[tuple[str, WheelPhysics], tuple[str, WheelPhysics]]:
    """Both wheels with their names."""
    return ("left", model.left), ("right", model.right)


def present(model: RobotModel) -> frozenset[str]:
    """The terms that this model has."""
    plain = WheelPhysics(1.0, 1.0)
    return frozenset(
        term
        for term, fields in TERMS.items()
        if any(
            getattr(wheel, name) != getattr(plain, name)
            for _, wheel in wheels(model)
            for name in _MARKS.get(term, tuple(fields))
        )
    )


def without(model: RobotModel, holds: frozenset[str]) -> RobotModel:
    """The model as a format that holds only these terms can show it, without the recorder's own."""

    def reduced(wheel: WheelPhysics) -> WheelPhysics:
        table = wheel.to_table()
        dropped = {name for term, fields in TERMS.items() if term not in holds for name in fields}
        dropped |= {"recorder_lag_s", "recorder_window_s"}
        if "breakaway" not in holds:
            dropped.add("stribeck_shape")
        return WheelPhysics(**{name: value for name, value in table.items() if name not in dropped})

    correction = model.correction if CORRECTION in holds else None
    left, right = reduced(model.left), reduced(model.right)
    return RobotModel(left, right, model.robot, model.rate_hz, model.source, correction)


def left_out(model: RobotModel, holds: frozenset[str]) -> tuple[str, ...]:
    """One sentence for each term of the model that a format has no place for."""
    plain = WheelPhysics(1.0, 1.0)
    sentences = []
    for term, fields in TERMS.items():
        if term not in present(model) - holds:
            continue
        values = []
        for name, unit in fields.items():
            left, right = (getattr(wheel, name) for _, wheel in wheels(model))
            if getattr(plain, name) != left or getattr(plain, name) != right:
                values.append(f"{name} {left:.4g} left, {right:.4g} right ({unit})")
        sentences.append(f"{term} is left out, this format has no place for it: {'; '.join(values)}")
    if model.correction is not None and CORRECTION not in holds:
        what = ", ".join(term.variable.replace("_", " ") for term in model.correction.terms)
        sentences.append(f"the learned correction ({what}) is left out, this format has no place for it")
    return tuple(sentences)


def headline(model: RobotModel) -> str:
    """Where the model comes from, one line for a file's head."""
    source = "; ".join(f"{key}: {value}" for key, value in model.source.items())
    name = model.robot.name or "a two-wheel robot"
    # One line, whatever a name holds: it ends comments of many languages.
    return " ".join((f"{name}, written by truing" + (f" ({source})" if source else "")).split())
