"""Exponentials that are remembered: consecutive substeps mostly ask for the same rate and span."""

from __future__ import annotations

from truing.diagnose.simulation.state import Record
from truing.model.compiled import part
from truing.model.kernel import decay_integral

from .tolerances import SAME_S


@part
def forget(memory: Record) -> None:
    """Make the next `remember` compute."""
    memory.rate = -1.0
    memory.span = -1.0


@part
def remember(memory: Record, rate: float, h: float) -> None:
    """Have (1 - exp(-rate h)) / rate and exp(-rate h) in the memory."""
    if memory.rate != rate or abs(memory.span - h) > SAME_S:
        memory.rate = rate
        memory.span = h
        memory.integral = decay_integral(rate, h)
        memory.keep = 1.0 - rate * memory.integral
