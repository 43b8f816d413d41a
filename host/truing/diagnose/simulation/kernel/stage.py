"""Stands for the stage functions, which `assemble.py` writes from the effects' hooks (`../stages.py`)."""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    raise AttributeError(f"{name}: stages are written for a catalogue")
