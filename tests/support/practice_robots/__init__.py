"""A second family of robots, independent of the plant: recording sets with an effect concealed in them.

It shares nothing with `truing.trial`, on purpose. There the plant of `hil_sim` is driven and the diagnosis'
own simulator scores, so that an error common to plant, diagnosis and scorer would cancel. Here physics,
sensors, strengths and scores are written anew, and a verdict is judged from its JSON alone: with a second,
independent model on the other side of the wall, such an error shows. `README.md` has the details.
"""

from __future__ import annotations

import os
from pathlib import Path

os.environ.setdefault("NUMBA_CACHE_DIR", str(Path(__file__).resolve().parents[3] / ".cache" / "numba"))

from support.practice_robots.score import judge
from support.practice_robots.trial import Answer, HiddenEffect, NotReachable, make_trial

__all__ = ["Answer", "HiddenEffect", "NotReachable", "judge", "make_trial"]
