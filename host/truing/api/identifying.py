"""`truing.identify` and `truing.fit`: gains and time constants, and models judged on runs left out."""

from __future__ import annotations

from truing.api.reading import Source, read
from truing.identify.identification import Identification, identify_set
from truing.identify.model_ladder import SetModels, fit_models
from truing.progress import Progress, ignore_progress


def identify(recordings: Source, *, progress: Progress = ignore_progress) -> Identification:
    """Find gain and time constant of both wheels, from each step and from all runs together.

    Parameters
    ----------
    recordings : what `read` returned, or what it takes. No baseline is needed; encoder counts need
        `counts_per_rev` and `wheel_radius_m` of `read`.
    progress : called with the share of the work done, 0 to 1.

    Returns
    -------
    Identification
        `whole_fits["left"]` has `gain` (m/s per unit of effort) and `time_constant` (s), each with `value`,
        `ci95` and, where it is unknown, `reason`; `runs` has the steps; `robot_model()` is a model and
        a baseline.

    Raises
    ------
    TruingError
        Efforts or speeds that no robot has; names the column and what to do.

    Examples
    --------
    >>> import truing
    >>> found = truing.identify("docs/example")
    >>> gain = found.whole_fits["left"].gain
    >>> print(f"{gain.value:.2f} {gain.unit}")
    1.19 m/s
    """
    return identify_set(read(recordings, spins=False), progress)


def fit(recordings: Source, *, more: bool = False, progress: Progress = ignore_progress) -> SetModels:
    """Fit models of both wheels by free-run simulation, and judge them on runs left out of the fit.

    Parameters
    ----------
    recordings : what `read` returned, or what it takes. No baseline is needed.
    more : also try breakaway friction, Stribeck friction, asymmetry, lags, filters, drag, supply.
    progress : called with the share of the work done, 0 to 1.

    Returns
    -------
    SetModels
        `wheels` has every model with its errors (m/s, per cent) and the chosen one; `robot_model()` is the
        chosen model of both wheels, for `simulate`, `export` and as a baseline.

    Raises
    ------
    TruingError
        Efforts that are none, speeds that no robot has, or no wheel that can be fitted.

    Examples
    --------
    >>> import truing
    >>> models = truing.fit(truing.read("docs/example"))
    >>> print(models.wheels[0].chosen.structure.name)
    friction
    """
    return fit_models(read(recordings, spins=False), richer=more, progress=progress)
