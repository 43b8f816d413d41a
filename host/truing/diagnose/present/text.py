"""A diagnosis in sentences, the same ones for the terminal and for the report."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from truing.diagnose.result import Diagnosis, EffectParameter, FitErrors, MismatchSpan, NamedEffect, Verdict
from truing.recording.axis import Axis

HEADINGS: dict[Verdict, str] = {
    "consistent": "No missing effect was detected",
    "parameters_only": "The parameters are wrong; no missing effect was detected",
    "missing_physics": "Physics is missing",
    "partly_explained": "Physics is missing, and part of the mismatch is not explained",
    "ambiguous": "Physics is missing; these recordings do not identify which",
    "unexplained": "Significant mismatch that no effect of the catalogue explains",
}
# Smaller units for values below one.
_SMALLER = {"s": ("ms", 1e3), "m/s": ("mm/s", 1e3), "m": ("mm", 1e3)}
_UNIT_TEXT = {"effort": "of full effort", "1": "", "fraction": "", "factor": "", "ratio": ""}
# Columns of a line, and places at which a mismatch is shown.
LINE_WIDTH, MAX_PLACES = 100, 4
# Sets of effects listed where something is unexplained.
MAX_CANDIDATES = 3
# A refitted error beyond this many times the noise floor is pointed out where no effect is named.
HIGH_REMAINING_ERROR = 1.5
# Errors on runs left out beyond this many times the noise floor are not called noise.
MANY_FLOORS = 3.0


@dataclass(frozen=True, slots=True)
class Section:
    """A heading and its sentences."""

    title: str
    lines: tuple[str, ...]


def effect_title(name: str) -> str:
    """The title of an effect, from its file."""
    from truing.diagnose.catalogue import CATALOGUE

    effect = CATALOGUE.get(name)
    return name.replace("_", " ") if effect is None else effect.title


def sections(
    diagnosis: Diagnosis, *, board: bool | None = None, axis: Axis | None = None
) -> tuple[Section, ...]:
    """The whole result as text, its first three lines in front.

    Parameters
    ----------
    board : the user has a board of ours, so that advice about it is of use; None: if it made the runs.
    axis : the recordings are of this single axis; None: as the diagnosis' own recordings say.
    """
    from truing.diagnose.present.first_screen import first_screen

    if axis is None and diagnosis.recordings is not None:
        axis = diagnosis.recordings.axis
    if axis is not None:
        diagnosis = of_axis(diagnosis)
    if board is None:
        board = diagnosis.recordings is not None and diagnosis.recordings.is_from_board
    found: tuple[Section, ...] = (
        Section("Verdict", first_screen(diagnosis, board=board)),
        Section("Error of the simulation", (*error_lines(diagnosis), *not_detectable_lines(diagnosis))),
        Section("What is missing", tuple(effect_lines(diagnosis))),
        Section("What is learned", tuple(learned_lines(diagnosis))),
        Section("Parameters", (*number_lines(diagnosis), *baseline_effect_lines(diagnosis))),
        Section("Where it differs", tuple(place_lines(diagnosis))),
        Section("Recorder", tuple(recorder_lines(diagnosis))),
        Section("Confidence and limitations", tuple(uncertainty_lines(diagnosis))),
        Section("What to do next", tuple(next_lines(diagnosis, board=board))),
    )
    if axis is not None:
        found = tuple(Section(part.title, tuple(map(axis.text, part.lines))) for part in found)
    return tuple(section for section in found if section.lines)


def of_axis(diagnosis: Diagnosis) -> Diagnosis:
    """The diagnosis of a single axis without what needs a second wheel or a floor."""
    from truing.diagnose.applicable import beyond_an_axis

    beyond = beyond_an_axis()

    def kept(names: Iterable[str]) -> tuple[str, ...]:
        return tuple(name for name in names if name not in beyond)

    return replace(
        diagnosis,
        not_exercised=kept(diagnosis.not_exercised),
        weakly_exercised=kept(diagnosis.weakly_exercised),
        checks=tuple(check for check in diagnosis.checks if not set(check.blocks) & beyond),
        numbers=tuple(entry for entry in diagnosis.numbers if entry.wheel == "left"),
        pose_fit=None,
    )


def first_sections(diagnosis: Diagnosis) -> tuple[Section, ...]:
    """The verdict, what is missing and what to do next: what a result prints of itself."""
    shown = (
        "Verdict", "Error of the simulation", "What is missing", "What is learned", "What to do next"
    )  # fmt: skip
    return tuple(section for section in sections(diagnosis) if section.title in shown)


def wrapped(sections: Iterable[Section]) -> Iterator[str]:
    """The lines of sections at one width, an empty one behind each section."""
    for section in sections:
        yield section.title
        for line in section.lines:
            yield from textwrap.wrap(line, LINE_WIDTH, initial_indent="  ", subsequent_indent="    ")
        yield ""


def headline(diagnosis: Diagnosis) -> str:
    """The verdict in one sentence."""
    verdict, lacking = diagnosis.verdict, f"Missing from {_simulation(diagnosis)}"
    if verdict == "consistent" and not diagnosis.has_given:
        return "No missing effect was detected: gain and time constant explain the recordings."
    if verdict == "consistent":
        return "No missing effect was detected: the simulation explains the recordings down to their noise."
    if verdict == "parameters_only":
        return "The parameters of your simulation are wrong; no missing effect was detected."
    if verdict == "missing_physics":
        titles = joined([effect_title(effect.name) for effect in diagnosis.effects])
        where = _wheel_text(diagnosis.effects[0].scope) if len(diagnosis.effects) == 1 else ""
        return f"{lacking}{where}: {titles}{_sure(diagnosis.confidence)}."
    if verdict == "partly_explained":
        titles = joined([effect_title(one.name) for one in diagnosis.effects if one.explanation == 0])
        share = f"{100.0 * diagnosis.left_over_share:.0f} % of its energy"
        return f"{lacking}: {titles}. Part of the mismatch ({share}) remains unexplained."
    if verdict == "ambiguous" and (second := uncertain_second_effect(diagnosis)):
        first, others = effect_title(second[0]), joined([effect_title(name) for name in second[1]], "or")
        return f"{lacking}: {first}; perhaps also {others}, which may only compensate its equation's error."
    if verdict == "ambiguous":
        options = [" with ".join(map(effect_title, names)) for names in alternatives(diagnosis)]
        mark = ";" if any(" with " in option for option in options) else ","
        return f"Physics is missing; these recordings do not identify which: {joined(options, 'or', mark)}."
    if _says_no_speed(diagnosis):
        sentence = "The efforts do not distinguish slow from fast motion"
        return f"{sentence}: no simulation that they drive can follow it."
    return "There is a significant mismatch, and nothing in the catalogue explains it."


def _says_no_speed(diagnosis: Diagnosis) -> bool:
    """Whether the efforts of slow and fast motion are alike (`recording/inverse_dynamics.py`)."""
    return any(check.topic == "scatter" for check in diagnosis.checks)


def _simulation(diagnosis: Diagnosis) -> str:
    return "the simulation" if diagnosis.has_given else "gain and time constant alone"


def alternatives(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """The explanations under `ambiguous`, each as its effects."""
    if len(diagnosis.explanations) > 1:
        return [one.effects for one in diagnosis.explanations]
    groups: dict[int, list[str]] = {}
    for effect in diagnosis.effects:
        groups.setdefault(effect.explanation, []).append(effect.name)
    if len(groups) < 2:
        return [(effect.name,) for effect in diagnosis.effects]
    return [tuple(names) for names in groups.values()]


def uncertain_second_effect(diagnosis: Diagnosis) -> tuple[str, list[str]] | None:
    """The effect that all explanations contain and one consists of, and the possible second effects."""
    options = alternatives(diagnosis)
    alone = [names[0] for names in options if len(names) == 1]
    if len(alone) != 1 or any(alone[0] not in names for names in options):
        return None
    return alone[0], [name for names in options for name in names if name != alone[0]]


def rivals_text(effect: NamedEffect, diagnosis: Diagnosis) -> str:
    """What explains the recordings as well as an effect does."""
    rivals = joined([effect_title(name) for name in effect.indistinguishable_from], "or")
    second = uncertain_second_effect(diagnosis)
    if second and effect.name in second[1]:
        return f"perhaps absent: without it, {rivals} explains the recordings about as well"
    return f"not distinguishable from {rivals} in these recordings"


def effect_lines(diagnosis: Diagnosis) -> list[str]:
    """Each effect with its parameters and the error on runs left out of the fit."""
    lines = []
    for effect in diagnosis.effects:
        title, where = effect_title(effect.name), _one_wheel_text(effect)
        # Effects of other explanations are alternatives to those of the first, not needed beside them.
        shown = f"Or instead {title}" if effect.explanation else capital(title)
        lines.append(f"{shown}{where}: {parameters_text(effect)}.")
        lines.append(_before_after(effect, diagnosis))
        if effect.note:
            lines.append(sentence(effect.note))
    return lines


def learned_lines(diagnosis: Diagnosis) -> list[str]:
    """What a learned correction does, and what it brings on runs left out."""
    learned = diagnosis.learned
    if learned is None:
        return []
    if learned.correction is None:
        nothing = (
            f"Nothing: no shape of effort, speed, place, time or short memory lowers the error on runs left "
            f"out ({amount(learned.heldout_before, 'm/s')})"
        )
        floor = diagnosis.fit.noise_floor
        if learned.heldout_before > MANY_FLOORS * floor:
            floor_text = amount(floor, "m/s")
            return [
                f"{nothing}. The noise floor is {floor_text}: what is left is no noise, but not repeatable."
            ]
        return [f"{nothing}: what is left is noise, as far as these show."]
    before, after = two_amounts(learned.heldout_before, learned.heldout_after, "m/s")
    lines = []
    named = [one.name for one in diagnosis.effects if one.explanation == 0]
    if named and not learned.effects:
        titles = joined([effect_title(name) for name in named])
        lines.append(
            f"Instead of {titles}, which may only imitate it: beside gain and time constant alone the "
            "correction lowers the error further."
        )
    for one in learned.terms:
        lines.append(one.sentence)
        known = [f"{each.physics or each.shape} ({100.0 * each.share:.0f} %)" for each in one.resembles]
        if known:
            lines.append(f"Its shape resembles {joined(known, 'or')}.")
    lines.append(
        f"On runs left out of fit, choice and values the free-run error falls from {before} to {after}. "
        "These are learned shapes, not named physics."
    )
    return lines


def parameters_text(effect: NamedEffect) -> str:
    """Every parameter with its interval."""
    parts = []
    for name, parameter in effect.parameters.items():
        label = {"difference": "right less left"}.get(name, name.replace("_", " "))
        shown = value_text(parameter)
        parts.append(shown if len(effect.parameters) == 1 and name != "scrub" else f"{label} {shown}")
    return ", ".join(parts)


def value_text(parameter: EffectParameter) -> str:
    """A value with its unit and interval, rounded to the width of the interval."""
    unit, scale = _shown_unit(parameter)
    low, high = (scale * end for end in parameter.ci95)
    value = scale * parameter.value
    digits = _digits(high - low, value)
    label = _UNIT_TEXT.get(unit, unit)
    spaced = f" {label}" if label else ""
    if not (math.isfinite(low) and math.isfinite(high)):
        return f"{_fixed(value, digits)}{spaced}"
    return f"{_fixed(value, digits)}{spaced} ({_fixed(low, digits)} to {_fixed(high, digits)})"


def _before_after(effect: NamedEffect, diagnosis: Diagnosis) -> str:
    before, after = effect.heldout_rmse_before, effect.heldout_rmse_after
    if not (math.isfinite(before) and math.isfinite(after)):
        return "There are too few runs for a cross-validation."
    fit = diagnosis.pose_fit if effect.domain == "pose" and diagnosis.pose_fit else diagnosis.fit
    floor = f"; the noise floor is {amount(fit.noise_floor, fit.unit)}" if fit.unit == effect.unit else ""
    change = "falls" if after < before else "goes"
    start, end = two_amounts(before, after, effect.unit)
    return f"With it, the error on runs left out of the fit {change} from {start} to {end}{floor}."


def error_lines(diagnosis: Diagnosis) -> list[str]:
    """The free-run errors beside the noise floor."""
    lines = []
    if diagnosis.fit.unit == "m/s":  # else a command was held against the pose, and no wheel was judged
        lines.append(_errors(diagnosis.fit, "Free-run error of the wheels' speeds", diagnosis))
    if diagnosis.pose_fit is not None:
        lines.append(_errors(diagnosis.pose_fit, "Error of the pose over short windows", diagnosis))
    return lines


def _errors(fit: FitErrors, what: str, diagnosis: Diagnosis) -> str:
    parts = [f"{amount(fit.refit_rmse, fit.unit)} {refitted_text(diagnosis)}"]
    if diagnosis.has_given:
        parts.insert(0, f"{amount(fit.baseline_rmse, fit.unit)} as given")
    if diagnosis.effects:
        parts.append(f"{amount(fit.model_rmse, fit.unit)} with the named effects")
    return f"{what}: {', '.join(parts)}; noise floor {amount(fit.noise_floor, fit.unit)}."


def refitted_text(diagnosis: Diagnosis) -> str:
    """What an error without effects is of."""
    return "with refitted parameters" if diagnosis.has_given else "with gain and time constant alone"


def number_lines(diagnosis: Diagnosis) -> list[str]:
    """The baseline's parameters that should change; all of them where nobody gave any."""
    lines = []
    for entry in diagnosis.numbers:
        low, high = entry.with_effects.ci95
        name = {"gain_mps": "gain", "time_constant_s": "time constant"}.get(entry.name, entry.name)
        if not diagnosis.has_given:
            lines.append(f"{capital(entry.wheel)} {name}: {value_text(entry.with_effects)}.")
            continue
        if diagnosis.verdict == "consistent" or low <= entry.given <= high:
            continue
        change = 100.0 * (entry.with_effects.value / entry.given - 1.0) if entry.given else math.nan
        lines.append(
            f"{capital(entry.wheel)} {name}: {value_text(entry.with_effects)} instead of "
            f"{entry.given:.4g} {entry.unit} ({change:+.1f} %)."
        )
    return lines


def baseline_effect_lines(diagnosis: Diagnosis) -> list[str]:
    """Effects that the baseline already holds, with their refitted parameters."""
    if diagnosis.verdict == "consistent":
        return []
    lines = []
    for name, parameters in diagnosis.baseline_effects.items():
        values = ", ".join(f"{key.replace('_', ' ')} {value_text(item)}" for key, item in parameters.items())
        lines.append(f"{capital(effect_title(name))}, as the baseline has it, refitted: {values}.")
    return lines


def place_lines(diagnosis: Diagnosis) -> list[str]:
    """Where the refitted baseline differs, grouped by signal and regime, largest share first."""
    groups: dict[tuple[str, str], list[MismatchSpan]] = {}
    for span in diagnosis.mismatch:
        groups.setdefault((span.signal, span.regime), []).append(span)
    # Where several effects have each their own places, the shares of each of them sum to one.
    whole = max(sum(span.share for span in diagnosis.mismatch), 1.0)
    ordered = sorted(groups.values(), key=lambda spans: -sum(span.share for span in spans))
    lines = []
    for spans in ordered[:MAX_PLACES]:
        first = max(spans, key=lambda span: span.share)
        share = sum(span.share for span in spans) / whole
        worst = max((span.times_noise or 0.0 for span in spans), default=0.0)
        times = f", up to {_fixed(worst, 1)} times the noise" if worst >= 1.0 else ""
        others = f" and {len(spans) - 1} like it" if len(spans) > 1 else ""
        signal = capital(signal_text(first.signal))
        lines.append(
            f"{signal}, {first.regime}: {100.0 * share:.0f} % of the mismatch{times} "
            f"({first.run}, {first.t_start_s:.2f} to {first.t_end_s:.2f} s{others})."
        )
    left = len(ordered) - MAX_PLACES
    if left > 0:
        rest = sum(span.share for spans in ordered[MAX_PLACES:] for span in spans) / whole
        kinds = "kind" if left == 1 else "kinds"
        lines.append(f"{left} more {kinds} of regime hold the other {100.0 * rest:.0f} %.")
    return lines


def recorder_lines(diagnosis: Diagnosis) -> list[str]:
    """How the speeds were recorded, and where the noise floor comes from."""
    lines = []
    for name, signal in diagnosis.recorder.items():
        parts = [f"measured every {1e3 * signal.updated_every_s:.3g} ms"]
        if signal.instant:
            parts.append("read at the rows' times, not averaged over them")
        if math.isfinite(signal.late_s) and signal.late_s > 0.0:
            parts.append(f"{1e3 * signal.late_s:.0f} ms later than its own positions")
        if math.isfinite(signal.filter_s) and signal.filter_s > 0.0:
            parts.append(f"or as through a filter of {1e3 * signal.filter_s:.0f} ms")
        if signal.resolution > 0.1 * diagnosis.fit.noise_floor:
            parts.append(f"in steps of {amount(signal.resolution, signal.unit)}")
        lines.append(f"{capital(name.replace('_', ' of the '))} wheel: {', '.join(parts)}.")
    if lines:
        lines.append(
            "The noise floor is twice what second differences of the measured speeds show (or their "
            "resolution, where that is more); no model of the robot enters it."
        )
    return lines


def uncertainty_lines(diagnosis: Diagnosis) -> list[str]:
    """Limitations of the verdict, and warnings about the data."""
    lines = list(map(sentence, diagnosis.notes))
    lines += best_candidate_lines(diagnosis)
    fit, no_effect = diagnosis.fit, diagnosis.verdict in ("consistent", "parameters_only")
    if no_effect and fit.refit_rmse > HIGH_REMAINING_ERROR * fit.noise_floor:
        lines.append(
            f"The refitted error is still {fit.refit_rmse / fit.noise_floor:.1f} times the noise floor, "
            "and no effect lowers it significantly: the verdict is uncertain."
        )
    lines += [sentence(str(check)) for check in diagnosis.checks if check.severity == "warning"]
    if not no_effect:
        lines += not_detectable_lines(diagnosis, always=True)
    if diagnosis.weakly_exercised:
        titles = sorted(effect_title(name) for name in diagnosis.weakly_exercised)
        lines.append(f"Detectable only if strong: {', '.join(titles)}.")
    return lines


def best_candidate_lines(diagnosis: Diagnosis) -> list[str]:
    """The best sets of effects where part of the mismatch or all of it is unexplained."""
    if diagnosis.verdict not in ("unexplained", "partly_explained"):
        return []
    known = [entry for entry in diagnosis.ranking if math.isfinite(entry.heldout_rmse)]
    best = sorted(known, key=lambda entry: entry.heldout_rmse)[:MAX_CANDIDATES]
    return [
        f"Candidate: {joined([effect_title(name) for name in entry.names])}; error on runs left out "
        f"{amount(entry.heldout_rmse, entry.unit)}."
        for entry in best
    ]


def not_detectable_lines(diagnosis: Diagnosis, *, always: bool = False) -> list[str]:
    """Effects that these recordings could not have shown, beside a verdict that names none."""
    no_effect = diagnosis.verdict in ("consistent", "parameters_only")
    if not diagnosis.not_exercised or not (no_effect or always):
        return []
    titles = sorted(effect_title(name) for name in diagnosis.not_exercised)
    return [f"These recordings could not have shown: {', '.join(titles)}."]


def next_lines(diagnosis: Diagnosis, *, board: bool) -> list[str]:
    """What a user can do now; what a board of ours can do only where there is one (`board`)."""
    lines = []
    experiment = diagnosis.next_experiment
    if experiment is not None:
        seconds, title = experiment.plan.duration_s, sentence(experiment.plan.title)
        lines.append(f"Drive this {seconds:.0f}-second run (--next-run FILE writes it): {title}")
        lines.append(sentence(experiment.why))
    if diagnosis.verdict in ("missing_physics", "partly_explained", "parameters_only"):
        corrected = "corrected model" if diagnosis.has_given else "model"
        lines.append(f"Write the {corrected} with --export, for example --export toml:model.toml.")
    if board and diagnosis.compensation is not None and diagnosis.compensation.parameters:
        every = list(diagnosis.compensation.parameters)
        names = ", ".join(every) if len(every) <= 4 else f"{every[0]} and {len(every) - 1} more"
        lines.append(
            f"The board can compensate it ({names}): --export params:board.toml, then "
            "`truing params load --file board.toml`."
        )
    if diagnosis.verdict in ("unexplained", "partly_explained") and not _says_no_speed(diagnosis):
        lines.append("Inspect the places listed: the robot's motion there, and the recorder.")
    steps = dict.fromkeys(check.next_step for check in diagnosis.checks if check.severity == "warning")
    lines += [sentence(step) for step in steps if step]
    return lines


def signal_text(signal: str) -> str:
    """A column in plain words."""
    label = {
        "vel_left_mps": "left wheel",
        "vel_right_mps": "right wheel",
        "truth_x_m": "position",
        "truth_y_m": "position",
        "truth_theta_rad": "heading",
        "gyro_z_radps": "yaw rate",
    }
    return label.get(signal, signal)


def amount(value: float, unit: str) -> str:
    """An error with its unit, small ones in thousandths."""
    if not math.isfinite(value):
        return "unknown"
    if unit in _SMALLER and abs(value) < 1.0:
        unit, scale = _SMALLER[unit]
        value *= scale
    return f"{value:.3g} {unit}"


def two_amounts(first: float, second: float, unit: str) -> tuple[str, str]:
    """Two errors in one unit, in enough digits to show their difference."""
    if unit in _SMALLER and max(abs(first), abs(second)) < 1.0:
        unit, scale = _SMALLER[unit]
        first, second = scale * first, scale * second
    digits = max(2, min(4, 1 - math.floor(math.log10(max(abs(first - second) / max(first, 1e-12), 1e-3)))))
    return f"{first:.{digits}g}", f"{second:.{digits}g} {unit}"


def joined(items: Sequence[str], word: str = "and", mark: str = ",") -> str:
    """Items joined for a sentence; a mark other than a comma is also put before the last word."""
    if len(items) < 2:
        return "".join(items)
    last = mark if mark != "," else ""
    return f"{f'{mark} '.join(items[:-1])}{last} {word} {items[-1]}"


def sentence(text: str) -> str:
    """With a capital and a full stop."""
    text = text.strip()
    return capital(text if text.endswith((".", "!", "?")) or not text else f"{text}.")


def capital(text: str) -> str:
    """The first letter large, unless the word is a name with digits or underscores."""
    first = text.split(" ", 1)[0] if text else ""
    return text if "_" in first or any(c.isdigit() for c in first) else text[:1].upper() + text[1:]


def plain(lines: Iterable[str]) -> str:
    """Lines as one paragraph."""
    return " ".join(lines)


def _wheel_text(scope: str) -> str:
    if scope in ("left", "right"):
        return f" on the {scope} wheel"
    return " on both wheels" if scope == "both" else ""


def _one_wheel_text(effect: NamedEffect) -> str:
    """The wheel of an effect whose parameters do not say it."""
    sides = {"left", "right"}
    said = any(sides & set(name.split("_")) for name in effect.parameters)
    if effect.scope not in sides or (said and len(effect.parameters) > 1):
        return ""
    return _wheel_text(effect.scope)


def _sure(confidence: float) -> str:
    return f" ({100.0 * min(confidence, 0.999):.3g} % sure)" if math.isfinite(confidence) else ""


def _shown_unit(parameter: EffectParameter) -> tuple[str, float]:
    if parameter.unit == "s" and abs(parameter.value) < 1.0:
        return "ms", 1e3
    if parameter.unit == "fraction" and abs(parameter.value) < 1.0:
        return "%", 100.0
    return parameter.unit, 1.0


def _digits(width: float, value: float) -> int:
    """Decimals that show half the interval's width, within reason."""
    size = 0.5 * width if math.isfinite(width) and width > 0.0 else 0.01 * abs(value)
    if size <= 0.0 or not math.isfinite(size):
        return 3
    return max(0, min(6, -math.floor(math.log10(size))))


def _fixed(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text[1:] if text.startswith("-") and not text.strip("-0.") else text
