"""Notes by which a view finds the virtual robot behind the port of a `truing board` on this machine."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from truing.recording.writer import replace_file
from truing.workspace import out_folder


@dataclass(frozen=True, slots=True)
class BoardNote:
    """A served virtual board.

    Attributes
    ----------
    ports : of its link.
    world : host and number of the port of its robot's world.
    """

    ports: list[str]
    world: tuple[str, int]
    seed: int


def leave_note(note: BoardNote) -> Path:
    """Write a note, which the board removes when it ends."""
    path = _folder() / f"{note.world[1]}.json"
    replace_file(path, json.dumps(asdict(note)).encode())
    return path


def notes_of(port: str) -> Iterator[BoardNote]:
    """The notes that name this port; that of a board that was killed may still lie there."""
    for path in sorted(_folder().glob("*.json")):
        try:
            content = json.loads(path.read_bytes())
            host, number = content["world"]
            note = BoardNote(list(content["ports"]), (str(host), int(number)), int(content["seed"]))
        except (OSError, ValueError, KeyError, TypeError):
            continue
        # A board on a bus is named by the bus and its number there.
        if any(port == one or port.startswith(f"{one}/") for one in note.ports):
            yield note


def _folder() -> Path:
    return out_folder() / "boards"
