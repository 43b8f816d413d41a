"""One page for each effect of the catalogue, from its file."""

from __future__ import annotations

import re
import sys
import textwrap
from dataclasses import dataclass
from pathlib import Path

from site_pages.markdown import block, code, escaped, page, sentence, table
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.effect import Effect, Parameter

FOLDER = "reference/effects"
FORMATS = Path(__file__).parents[2] / "DATA_FORMAT.md"
SEEN_IN = {"wheel": "the wheels' speeds", "pose": "the pose", "both": "the wheels' speeds and the pose"}
NEEDS = {
    "pose": "a pose or yaw rate from outside the robot",
    "heading": "a heading",
    "geometry": "the wheelbase in the baseline",
    "angle": "the wheels' angles (counts, or the wheel radius)",
    "vel": "the recorder's own speed column as the judged signal",
    "equal_wheels": "a baseline with both wheels equal",
}
SCALES = {
    "one": "",
    "speed": " × full-effort speed",
    "per_speed_squared": " / (full-effort speed)²",
    "duration": " × length of the set",
    "time_constant": " × time constant",
    "acceleration": " × acceleration at full effort from rest, over that of gravity",
}
_DATA, _CONFUSED = "In data:", "Confused with:"


@dataclass(frozen=True, slots=True)
class Description:
    """What the docstring of an effect's file holds, part by part."""

    summary: str
    equation: str
    origin: str
    looks: str
    confused: str


def described(name: str) -> Description:
    """The parts of the docstring of an effect's file."""
    text = sys.modules[CATALOGUE.entries[name].module].__doc__ or ""
    summary, *paragraphs = text.strip().split("\n\n")
    equations = [part for part in paragraphs if part.startswith("    ")]
    looks = next(part for part in paragraphs if part.startswith(_DATA))
    confused = next(part for part in paragraphs if part.startswith(_CONFUSED))
    origin = [part for part in paragraphs if part not in (*equations, looks, confused)]
    return Description(
        summary,
        textwrap.dedent("\n".join(equations)),
        "\n\n".join(escaped(part) for part in origin),
        looks.removeprefix(_DATA),
        confused.removeprefix(_CONFUSED),
    )


def pages() -> dict[str, str]:
    """The overview, and a page for every effect."""
    meanings = parameter_meanings()
    made = {f"{FOLDER}/index.md": _overview()}
    return made | {f"{FOLDER}/{name}.md": _page(effect, meanings) for name, effect in CATALOGUE.items()}


def navigation() -> list[object]:
    """The effects in the order of their names."""
    return [f"{FOLDER}/index.md", *({_title(one): f"{FOLDER}/{name}.md"} for name, one in CATALOGUE.items())]


def parameter_meanings() -> dict[tuple[str, str], str]:
    """The meaning of each reported parameter, from the table of docs/DATA_FORMAT.md, section 5."""
    rows = re.findall(
        r"^\| `(\w+)` \| `(\w+)` \| [^|]+ \| ([^|]+) \|$", FORMATS.read_text(encoding="utf-8"), re.MULTILINE
    )
    return {(effect, parameter): meaning for effect, parameter, meaning in rows}


def _title(effect: Effect) -> str:
    return effect.title[:1].upper() + effect.title[1:]


def _overview() -> str:
    rows = [
        (f"[`{name}`]({name}.md)", escaped(effect.title), escaped(effect.signature), SEEN_IN[effect.domain])
        for name, effect in CATALOGUE.items()
    ]
    return page(
        "# Effects",
        f"The {len(CATALOGUE)} effects that `truing diagnose` can find missing from a simulation. These "
        "pages are made from the catalogue, `host/truing/diagnose/effects/`.",
        table(("name", "effect", "in a recording", "seen in"), rows),
        "In the equations `T` is the wheel's time constant (s), `g` its gain (the steady speed at full "
        "effort, m/s), `u` the effort as a fraction of the supply (-1 to 1), `v` the wheel's speed (m/s), "
        "and `s` the sign of `v`.",
    )


def _page(effect: Effect, meanings: dict[tuple[str, str], str]) -> str:
    text = described(effect.name)
    needs = " and ".join(NEEDS[need] for need in effect.needs)
    return page(
        f"# {_title(effect)}",
        escaped(text.summary),
        f"- Name in verdicts and baselines: `{effect.name}`\n- Seen in {SEEN_IN[effect.domain]}"
        + (f"\n- Needs {needs}" if needs else "")
        + (f"\n- Extends [`{effect.extends}`]({effect.extends}.md)" if effect.extends else ""),
        "## Equation",
        block(text.equation),
        text.origin,
        f"Source: {escaped(effect.source)}.",
        "## Parameters",
        _parameters(effect, meanings),
        _nuisances(effect),
        "## How it looks in a recording",
        escaped(sentence(text.looks)),
        "## What it is confused with",
        escaped(sentence(text.confused)),
        _separated(effect),
        "## How to excite it",
        escaped(effect.excited_by),
    )


def _separated(effect: Effect) -> str:
    rows = [(f"[`{other}`]({other}.md)", escaped(run)) for other, run in effect.separated_by.items()]
    return table(("distinguished from", "by"), rows) if rows else ""


def _parameters(effect: Effect, meanings: dict[tuple[str, str], str]) -> str:
    """The reported parameters: name, unit, meaning, range of the search, and the value without the effect."""
    own = {item.name: item for item in effect.parameters}
    rows = []
    for name in reported_names(effect):
        unit = effect.units.get(name) or own[name].unit
        if name in own:
            limits, off = _range(own[name]), _scaled(own[name].off, own[name])
        else:
            limits, off = ("0 or more" if name in effect.non_negative else "not limited"), "0"
        rows.append((code(name), unit, meanings[effect.name, name], limits, off))
    return table(("parameter", "unit", "meaning", "range", "when off"), rows)


def reported_names(effect: Effect) -> list[str]:
    """Names of the parameters that a verdict reports."""
    values = {item.name: item.starts[0] for item in effect.parameters}
    baseline = {"gain_left": 1.0, "gain_right": 1.0, "tau_left": 0.3, "tau_right": 0.3}
    return [name for name in effect.reported(values | baseline) if name not in baseline]


def _nuisances(effect: Effect) -> str:
    names = [code(item.name) for item in effect.parameters if item.nuisance]
    return f"Fitted beside them and not reported: {', '.join(names)}." if names else ""


def _range(parameter: Parameter) -> str:
    return f"{_number(parameter.lower)} to {_scaled(parameter.upper, parameter)}"


def _scaled(value: float, parameter: Parameter) -> str:
    return _number(value) + (SCALES[parameter.scale] if value else "")


def _number(value: float) -> str:
    return f"{value:g}".replace("inf", "no limit")
