"""The board's two slots for an image of the firmware."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from truing_protocol import ImageState, UpdateStateReply


@dataclass(frozen=True, slots=True)
class ImageSlot:
    """One of the two slots for an image of the firmware, as the board reports it."""

    state: ImageState
    sequence: int
    name: str
    runs: bool

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self) | {"state": self.state.name.lower()}

    def text(self) -> str:
        """For a person."""
        if self.state is ImageState.NONE:
            return "no image"
        runs = ", runs" if self.runs else ""
        return f"{self.name}, {self.state.name.lower()}, number {self.sequence}{runs}"


def slots_of(state: UpdateStateReply) -> tuple[ImageSlot, ...]:
    """Both slots."""
    return tuple(
        ImageSlot(ImageState(state.states[i]), state.sequences[i], name, state.running == i)
        for i, name in enumerate((state.name_0, state.name_1))
    )
