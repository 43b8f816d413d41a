"""The order of an engine's campaign: any beginning has each kind in its share, each mode and rate in turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from truing.trial.engines.driving import Mode
from truing.trial.engines.engine import Engine
from truing.trial.engines.spec import MODES, RATES_HZ
from truing.trial.order import Task, shared_out

# Of 300 trials: single effects in rounds, pairs, healthy robots, changes that the baseline's form can follow,
# and what is outside the catalogue.
SHARES = {"random": 160, "pair": 40, "none": 40, "form": 20, "outside": 40}
_PER_CAMPAIGN = 1_000_000


@dataclass(frozen=True)
class EngineTask(Task):
    """One trial of an engine's campaign."""

    engine: str
    mode: Mode
    rate_hz: int


def engine_tasks(engine: Engine[Any], trials: int, seed: int) -> list[EngineTask]:
    """Return the first trials of a campaign."""
    rng = np.random.default_rng([seed, 0x656E67, 0x6F72])
    pools = {
        kind: sorted(each.name for each in engine.effects.values() if each.kind == pool)
        for kind, pool in (("random", "catalogue"), ("form", "form"), ("outside", "outside"))
    }
    for pool in pools.values():
        rng.shuffle(pool)
    ways = [(mode, rate) for mode in MODES for rate in RATES_HZ]
    counts = dict.fromkeys(SHARES, 0)
    out = []
    for number, kind in enumerate(shared_out(SHARES, trials)):
        at = counts[kind]
        counts[kind] += 1
        effect, weak = kind, None
        if kind in pools:
            turn, place = divmod(at, len(pools[kind]))
            effect = pools[kind][place]
            weak = (turn + place) % 2 == 1 if kind == "random" else None
        # Each kind goes through all ways to drive and record, and from round to round an effect does.
        mode, rate = ways[(4 * at + at // len(ways)) % len(ways)]
        out.append(
            EngineTask(number, effect, seed * _PER_CAMPAIGN + number, weak, False, engine.name, mode, rate)
        )
    return out
