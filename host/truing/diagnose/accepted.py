"""A set of effects that the user accepts in place of the verdict's own choice (`--accept`).

Under `unexplained` and `partly_explained` the report lists the best sets of effects with their errors on
runs left out. One of them may be good enough for the user's simulation; it is then fitted, reported and
exported as the model, and the result says whose choice it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from truing.diagnose.fit import Fit
from truing.diagnose.ordered_errors import with_ordered_errors
from truing.diagnose.result import Verdict
from truing.diagnose.search import Search, effect_set
from truing.diagnose.verdict import Reasoning, leaves_something
from truing.errors import IdentifyError


def with_accepted(reasoning: Reasoning, wanted: Sequence[str]) -> Reasoning:
    """The reasoning with these effects as its model.

    Parameters
    ----------
    wanted : names of the catalogue, or parts of them.

    Raises
    ------
    IdentifyError
        A name fits no effect that these recordings can show, or several.
    """
    search = reasoning.search
    names = _names(search, wanted)
    best = _fitted(search, names)
    verdict: Verdict = "partly_explained" if leaves_something(search, best) else "missing_physics"
    return with_ordered_errors(replace(reasoning, best=best, rivals=(), verdict=verdict, accepted=True))


def _names(search: Search, wanted: Sequence[str]) -> tuple[str, ...]:
    """Full names. A part of a name stands for the effect of the best fitted set that matches them all."""
    known = tuple(search.probes)
    choices = [[name] if name in known else [one for one in known if name in one] for name in wanted]
    for name, fitting in zip(wanted, choices, strict=True):
        if not fitting:
            raise IdentifyError(
                f"--accept: {name} is no effect that these recordings can show",
                f"Take some of: {', '.join(known)}",
            )
    sizes = [one for names, one in search.fits.items() if len(names) == len(wanted)]
    for one in sorted(sizes, key=lambda each: -search.compare(each, search.fits[()]).gain):
        found = [[name for name in fitting if name in one.effects] for fitting in choices]
        if all(len(each) == 1 for each in found) and len({each[0] for each in found}) == len(wanted):
            return tuple(each[0] for each in found)
    for name, fitting in zip(wanted, choices, strict=True):
        if len(fitting) > 1:
            raise IdentifyError(
                f"--accept: {name} may be {' or '.join(fitting)}", "Give the whole name of the one you mean"
            )
    return tuple(fitting[0] for fitting in choices)


def _fitted(search: Search, names: tuple[str, ...]) -> Fit:
    """The fit of these effects, added one after the other where it was not made before."""
    done = search.fits[()]
    for count in range(1, len(names) + 1):
        some = effect_set(*names[:count])
        if some not in search.fits:
            search.fits[some] = search.with_effect(done, names[count - 1])
        done = search.fits[some]
    return done
