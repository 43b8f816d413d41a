"""The comparison with the peers as tables, and in words where a peer is better."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from truing.identify.tables import PlainTable
from truing.studies.real.comparison import OURS, SetComparison
from truing.studies.real.left_out import Score
from truing.studies.real.peers.catalogue import LADDER, PEERS

NONE = "–"
# A method is better where its error is lower by more than this share.
MARGIN = 0.05
BEST_RUNG = "best rung"

Errors = Callable[[Score], float]


def comparison_tables(sets: Sequence[SetComparison]) -> list[PlainTable]:
    """Summary and one row per set; none without a set that could be compared."""
    done = [one for one in sets if not one.why]
    return [_summary(done, len(sets)), _by_set(sets)] if done else []


def where_peers_are_better(sets: Sequence[SetComparison]) -> list[str]:
    """For each peer, the sets on which it is better, on the runs that were fitted or on those left out."""
    lines = []
    done = [one for one in sets if not one.why]
    for name, title in _methods():
        for what, error in (("the fitted runs", _fitted), ("left-out runs", _left_out)):
            worse = [
                (one, ours, theirs)
                for one in done
                for ours, theirs in [(error(one.scores[OURS]), error(_score(one, name, error)))]
                if theirs < (1.0 - MARGIN) * ours
            ]
            if worse:
                worse.sort(key=lambda entry: entry[2] / entry[1])
                cells = ", ".join(f"{_short(one.name)} ({b:.2f}, ours {a:.2f} %)" for one, a, b in worse)
                lines.append(f"{title}, on {what}: better on {len(worse)} of {len(done)} sets: {cells}.")
    return lines


def _fitted(score: Score) -> float:
    return score.fitted


def _left_out(score: Score) -> float:
    return score.left_out


def _methods() -> list[tuple[str, str]]:
    """Names and titles: the ladder's rungs, its best, the other peers."""
    titled = [(peer.name, peer.title) for peer in PEERS]
    count = len(LADDER)
    return [*titled[:count], (BEST_RUNG, "best rung of the ladder"), *titled[count:]]


def _score(one: SetComparison, name: str, error: Errors, *, every_row: bool = False) -> Score:
    """A method's score; of the best rung, the one whose error is lowest."""
    scores = one.every_row if every_row else one.scores
    if name != BEST_RUNG:
        return scores[name]
    rungs = [scores[rung] for rung in LADDER if not math.isnan(error(scores[rung]))]
    return min(rungs, key=error) if rungs else scores[LADDER[0]]


def _summary(done: Sequence[SetComparison], total: int) -> PlainTable:
    table = PlainTable(
        "Beside other methods, over all sets",
        [
            "Method",
            "Error, %",
            "left out, %",
            "Ours over it",
            "left out",
            "At most 1.05",
            "left out",
            "Better than ours",
            "left out",
            "Fails",
            "Seconds",
        ],
        [False, *[True] * 10],
        group=0,
    )
    table.rows.append(_summary_row("truing diagnose", OURS, done))
    table.rows += [_summary_row(title, name, done) for name, title in _methods()]
    ratios = [
        one.every_row[OURS].fitted / _score(one, BEST_RUNG, _fitted, every_row=True).fitted for one in done
    ]
    table.remarks += [
        f"{len(done)} of {total} sets. Error: free run from each run's first speed by its efforts alone, RMS "
        "over both wheels, per cent of the 98th percentile of |speed|; median over the sets. Left out: each "
        "part of the runs by the fit to the others, in the diagnosis's own division. Seconds: processor time "
        "of one fit to all runs, median (ours: a whole diagnosis).",
        "All methods are fitted to and judged on the rows that the diagnosis judges: those at which a "
        "measurement is new, each weighted by how long it stands. "
        "Ours over it: median ratio. At most 1.05: share of the sets on which ours is at "
        "most 1.05 times it. Better than ours: sets on which it is lower by more than 5 %.",
        "Every row of the files, repeated ones included, each method fitted to them and ours held as the "
        f"recorder holds: ours over the best rung has a median of {np.median(ratios):.2f}, and is at most "
        f"1.05 on {_share(ratios)} of the sets.",
        "Best rung: of the ladder, by the error in question, chosen in hindsight for each set.",
    ]
    return table


def _summary_row(title: str, name: str, done: Sequence[SetComparison]) -> list[str]:
    medians, ratios, within, better = [], [], [], []
    for error in (_fitted, _left_out):
        theirs = np.array([error(_score(one, name, error)) for one in done])
        ours = np.array([error(one.scores[OURS]) for one in done])
        known = np.isfinite(theirs) & np.isfinite(ours)
        quotients = (ours[known] / theirs[known]).tolist()
        medians.append(_number(np.median(theirs[known])) if known.any() else NONE)
        ratios.append(_number(np.median(quotients)) if known.any() else NONE)
        within.append(_share(quotients) if known.any() else NONE)
        better.append(str(int(np.sum(theirs[known] < (1.0 - MARGIN) * ours[known]))))
    picked = [_score(one, name, _fitted) for one in done]
    seconds = f"{np.median([score.seconds for score in picked]):.2g}"
    fails = sum(bool(score.why) for score in picked)
    if name == OURS:
        return [title, *medians, *[NONE] * 7, seconds]
    return [title, *medians, *ratios, *within, *better, str(fails), seconds]


def _by_set(sets: Sequence[SetComparison]) -> PlainTable:
    table = PlainTable(
        "Beside other methods, set by set: error on the runs that were fitted / on runs left out, %",
        ["Set", "Verdict", "Named", "Ours", *(peer.title for peer in PEERS), "Ours, s"],
        [False, False, False, *[True] * (len(PEERS) + 2)],
        group=0,
    )
    for one in sets:
        if one.why:
            cells = [NONE] * (len(PEERS) + 2)
            table.rows.append([_short(one.name), table.note(one.why), NONE, *cells])
            continue
        named = " + ".join(one.named) or NONE
        ours = one.scores[OURS]
        cells = [_cell(one.scores[name]) for name in (OURS, *(peer.name for peer in PEERS))]
        row = [_short(one.name), one.verdict.replace("_", " "), named, *cells, f"{ours.seconds:.1f}"]
        table.rows.append(row)
    reasons = sorted({score.why for one in sets for score in one.scores.values() if score.why})
    table.remarks += [f"{NONE}: the method gives no model: {'; '.join(reasons)}."] if reasons else []
    table.remarks += [f"[{number}] {text}." for number, text in enumerate(table.notes, start=1)]
    return table


def _cell(score: Score) -> str:
    if score.why:
        return NONE
    return f"{_number(score.fitted)} / {_number(score.left_out)}"


def _number(value: float) -> str:
    return NONE if math.isnan(value) else f"{value:.2f}" if value < 99.95 else f"{value:.0f}"


def _share(ratios: Sequence[float]) -> str:
    return f"{100.0 * np.mean(np.array(ratios) <= 1.0 + MARGIN):.0f} %"


def _short(name: str) -> str:
    return name.removeprefix("frc_").replace("__", " ")
