"""The six verbs of `import truing`, one module each; every result prints what the command line says."""

from __future__ import annotations

from truing.api.diagnosing import diagnose
from truing.api.exporting import export
from truing.api.identifying import fit, identify
from truing.api.reading import read
from truing.api.simulating import simulate

__all__ = ["diagnose", "export", "fit", "identify", "read", "simulate"]
