"""Undo and redo: states that were left, and those that an undo has left."""

from __future__ import annotations

from typing import Generic, TypeVar

State = TypeVar("State")

# A state of the world is 3 kB, of a path a few hundred bytes.
_MAX_STEPS = 100


class History(Generic[State]):
    """Steps back and forth between states, which must not change."""

    def __init__(self) -> None:
        self._past: list[State] = []
        self._future: list[State] = []

    def leave(self, state: State) -> None:
        """Before a change: the state that it leaves. What was undone can no longer be redone."""
        if self._past and self._past[-1] == state:
            return
        self._past = [*self._past, state][-_MAX_STEPS:]
        self._future.clear()

    def undo(self, present: State) -> State | None:
        """The state before the last change; None if there is none."""
        return _step(self._past, self._future, present)

    def redo(self, present: State) -> State | None:
        """The state that the last undo has left; None if there is none."""
        return _step(self._future, self._past, present)


def _step(source: list[State], target: list[State], present: State) -> State | None:
    while source:
        state = source.pop()
        if state != present:
            target.append(present)
            return state
    return None
