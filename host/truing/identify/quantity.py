"""An identified number with its unit and interval, or the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Quantity:
    """A value, or the reason why it cannot be determined.

    Attributes
    ----------
    ci95 : 95 % confidence interval in the same unit, where one is known.
    reason : why `value` is None; None when there is a value.
    """

    value: float | None
    unit: str
    ci95: tuple[float, float] | None = None
    reason: str | None = None

    @classmethod
    def unknown(cls, unit: str, reason: str) -> Quantity:
        """A quantity that these recordings cannot tell, and why."""
        return cls(None, unit, None, reason)

    def to_json(self) -> dict[str, Any]:
        """For `--json`: value and ci95 are null where they are unknown."""
        tree: dict[str, Any] = {
            "value": self.value,
            "unit": self.unit,
            "ci95": None if self.ci95 is None else list(self.ci95),
        }
        if self.reason is not None:
            tree["reason"] = self.reason
        return tree
