"""A second family of robots, independent of the plant: recording sets with something hidden in them."""

from __future__ import annotations

import os
from pathlib import Path

os.environ.setdefault("NUMBA_CACHE_DIR", str(Path(__file__).resolve().parents[3] / ".cache" / "numba"))

from support.practice_robots.score import judge
from support.practice_robots.trial import Answer, HiddenEffect, NotReachable, make_trial

__all__ = ["Answer", "HiddenEffect", "NotReachable", "judge", "make_trial"]
