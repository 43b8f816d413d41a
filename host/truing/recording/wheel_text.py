"""Numbers of wheels in a sentence: one where all have the same, else `1.36 / 1.38 m/s (left / right)`."""

from __future__ import annotations

from collections.abc import Mapping

# Seconds below this are said in milliseconds.
SHORT_S = 1.0


def wheels_text(values: Mapping[str, float], unit: str, digits: int = 3, *, sides: bool = False) -> str:
    """The values with their unit, in the order given.

    Parameters
    ----------
    values : by wheel.
    sides : also say which number is which wheel's, once in a sentence.
    """
    if unit == "s" and values and max(abs(value) for value in values.values()) < SHORT_S:
        values, unit = {side: 1e3 * value for side, value in values.items()}, "ms"
    shown = [f"{value:.{digits}g}" for value in values.values()]
    if len(set(shown)) == 1:
        one_side = f" ({next(iter(values))} wheel)" if sides and len(values) == 1 else ""
        return f"{shown[0]} {unit}{one_side}"
    named = f" ({' / '.join(values)})" if sides else ""
    return f"{' / '.join(shown)} {unit}{named}"


def response_text(gains_mps: Mapping[str, float], time_constants_s: Mapping[str, float]) -> str:
    """How the robot answers an effort, from gains and time constants by wheel."""
    gain, lag = "its gain is not known", "unknown"
    if gains_mps:
        gain = f"{wheels_text(gains_mps, 'm/s', sides=True)} at full effort"
    if time_constants_s:
        lag = wheels_text(time_constants_s, "s")
    return f"{gain}, time constant {lag}"
