"""Which parameters of the wheel's physics a fit sets free, and between which bounds."""

from __future__ import annotations

from dataclasses import dataclass

from truing.errors import IdentifyError


@dataclass(frozen=True, slots=True)
class Freedom:
    """One free parameter: its box, a step for derivatives, and where searches start.

    Positive scales (`log`) are searched in their logarithm.
    """

    name: str
    lower: float
    upper: float
    step: float
    starts: tuple[float, ...]
    log: bool = False


FREEDOMS: dict[str, Freedom] = {
    item.name: item
    for item in (
        Freedom("gain_mps", -1e3, 1e3, 1e-6, (1.0,)),
        Freedom("time_constant_s", 1e-3, 30.0, 1e-6, (0.02, 0.05, 0.12, 0.3, 0.8), log=True),
        Freedom("delay_s", 0.0, 0.6, 1e-6, (0.0, 0.05, 0.12)),
        Freedom("friction", 0.0, 0.9, 1e-7, (0.0, 0.02, 0.06, 0.15)),
        # A log's effort moves in steps, and so does the moment of breaking away: only a secant shows a
        # slope, and a search by slopes needs the scan that `fit_nested` makes.
        Freedom("breakaway_excess", 0.0, 0.5, 2e-3, (0.0, 0.01, 0.03, 0.06, 0.12)),
        Freedom("stribeck_mps", 1e-3, 2.0, 1e-6, (0.03, 0.15), log=True),
        Freedom("drag", -0.2, 2.0, 1e-7, (0.0,)),
        Freedom("offset", -0.5, 0.5, 1e-7, (0.0,)),
        Freedom("reverse_gain", 0.2, 5.0, 1e-6, (1.0,), log=True),
        Freedom("reverse_time_constant", 0.2, 5.0, 1e-6, (1.0,), log=True),
        Freedom("reverse_friction", 0.05, 20.0, 1e-6, (1.0,), log=True),
        Freedom("reverse_excess", 0.05, 20.0, 1e-6, (1.0,), log=True),
        Freedom("lag_s", 1e-3, 0.5, 1e-6, (0.02,), log=True),
        Freedom("supply_share", -2.0, 2.0, 1e-6, (0.0,)),
        Freedom("recorder_lag_s", 1e-3, 0.5, 1e-6, (0.03,), log=True),
        Freedom("recorder_window_s", 2e-3, 0.5, 1e-6, (0.06,), log=True),
    )
}


@dataclass(frozen=True, slots=True)
class Structure:
    """A named choice of free parameters; the rest keep the values of the model the fit starts from."""

    name: str
    free: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in self.free:
            if name not in FREEDOMS:
                raise IdentifyError(f"{name!r} is not a parameter that a fit can set free")

    def plus(self, name: str, *more: str) -> Structure:
        """The same structure with more parameters free."""
        return Structure(name, (*self.free, *(item for item in more if item not in self.free)))


LINEAR = Structure("linear", ("gain_mps", "time_constant_s"))
FRICTION = LINEAR.plus("friction", "friction")
DELAY = FRICTION.plus("delay", "delay_s")
# Richer physics, each on top of friction and delay.
BREAKAWAY = DELAY.plus("breakaway", "breakaway_excess")
STRIBECK = DELAY.plus("stribeck", "breakaway_excess", "stribeck_mps")
ASYMMETRIC = DELAY.plus("asymmetric", "reverse_gain", "reverse_friction")
RECORDER_LAG = DELAY.plus("recorder_lag", "recorder_lag_s")
RECORDER_WINDOW = DELAY.plus("recorder_window", "recorder_window_s")
DRIVER_LAG = DELAY.plus("driver_lag", "lag_s")
DRAG = DELAY.plus("drag", "drag")
OFFSET = DELAY.plus("offset", "offset")
SUPPLY = DELAY.plus("supply", "supply_share")

STRUCTURES: dict[str, Structure] = {
    item.name: item
    for item in (
        LINEAR,
        FRICTION,
        DELAY,
        BREAKAWAY,
        STRIBECK,
        ASYMMETRIC,
        RECORDER_LAG,
        RECORDER_WINDOW,
        DRIVER_LAG,
        DRAG,
        OFFSET,
        SUPPLY,
    )
}


def structure(name: str) -> Structure:
    """The structure of this name."""
    try:
        return STRUCTURES[name]
    except KeyError:
        raise IdentifyError(
            f"there is no model structure {name!r}", f"There are: {', '.join(STRUCTURES)}"
        ) from None
