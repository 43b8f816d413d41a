"""What every simulated robot has in common: virtual time, and an end."""

from __future__ import annotations

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self


class Simulated(ABC):
    """A simulation in the native library, closed at the end of a `with` block at the latest."""

    @abstractmethod
    def close(self) -> None:
        """Free the simulation; nothing may be called afterwards."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    @property
    @abstractmethod
    def time_us(self) -> int:
        """Virtual time since creation, microseconds."""

    @property
    def time_s(self) -> float:
        """Virtual time since creation, seconds."""
        return self.time_us * 1e-6
