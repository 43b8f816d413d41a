"""What moves when a tuned constant of `truing.diagnose` is changed by 30 %; run it with --help for options.

The table docs/CONSTANTS.md names every constant with a literal numeric value, its stated reason (the comment
above it), and how the diagnoses of a panel of recording sets change. Measurements are kept as JSON lines in
out/bench/constants.jsonl and taken up again by the next call with the same panel.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import json
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FunctionType, ModuleType

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path[:0] = [str(ROOT / folder) for folder in ("host", "protocol/python", "tests")]

DIAGNOSE = ROOT / "host" / "truing" / "diagnose"
PAGE = ROOT / "docs" / "CONSTANTS.md"
KEPT = ROOT / "out" / "bench" / "constants.jsonl"
CHANGES = (1.3, 0.7)
STATUSES = ("tuned", "compiled", "presentation", "fixed")
Value = float | tuple[float, ...]
Outcome = list[list[str]]

# Measured first: the modules in which the verdict is made.
FIRST = (
    "verdict", "pairs", "stepwise", "unseen_runs", "compare", "noise", "noise_floor", "problem",
    "residual_tests", "screen", "search",
)  # fmt: skip
# Values that physics, statistics, a format or a layout in memory fixes.
NOT_TUNED = {
    "GRAVITY", "NORMAL_975", "CHI2_95", "SCHEMA", "BASELINE_PARAMETERS", "COUNTER_SPANS", "WHOLE_RUN",
    "NO_EVENT", "PAST", "MEETING", "BAR_PX", "HEADER_PX",
}  # fmt: skip
# The numbers in these are frozen when numba compiles the simulation.
COMPILED_FOLDER = "simulation/kernel/"
_ARITHMETIC = (ast.Constant, ast.UnaryOp, ast.BinOp, ast.Tuple, ast.operator, ast.unaryop, ast.Load)


@dataclass(frozen=True)
class Constant:
    """A module-level number, or tuple of numbers, and the comment above it."""

    file: str
    name: str
    value: Value
    reason: str

    @property
    def module(self) -> str:
        return "truing.diagnose." + self.file.removesuffix(".py").replace("/", ".")

    @property
    def status(self) -> str:
        """Tuned; compiled: tuned, but frozen in compiled code; presentation: moves no verdict; or fixed."""
        if self.name in NOT_TUNED:
            return "fixed"
        if self.file.startswith("present/"):
            return "presentation"
        return "compiled" if self.file.startswith(COMPILED_FOLDER) else "tuned"


def constants() -> list[Constant]:
    """All constants of the folder, those of the verdict's modules first."""
    files = sorted(DIAGNOSE.rglob("*.py"), key=lambda path: (_rank(path), path.as_posix()))
    return [constant for path in files for constant in _constants_of(path)]


def _rank(path: Path) -> int:
    return FIRST.index(path.stem) if path.parent == DIAGNOSE and path.stem in FIRST else len(FIRST)


def _constants_of(path: Path) -> Iterator[Constant]:
    source = path.read_text(encoding="utf-8")
    for node in ast.parse(source).body:
        if isinstance(node, ast.AnnAssign):
            targets: list[ast.expr] = [node.target]
        elif isinstance(node, ast.Assign):
            targets = node.targets
        else:
            continue
        if node.value is None:
            continue
        for name, value in _pairs(targets, node.value):
            number = _number(value)
            if name.isupper() and number is not None:
                reason = _comment_above(source.splitlines(), node.lineno)
                yield Constant(path.relative_to(DIAGNOSE).as_posix(), name, number, reason)


def _pairs(targets: list[ast.expr], value: ast.expr) -> Iterator[tuple[str, ast.expr]]:
    for target in targets:
        if isinstance(target, ast.Name):
            yield target.id, value
        elif isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            for one, part in zip(target.elts, value.elts, strict=True):
                yield from _pairs([one], part)


def _number(node: ast.expr) -> Value | None:
    """The value of a literal, or of arithmetic between literals; None where it is no number."""
    if not all(isinstance(part, _ARITHMETIC) for part in ast.walk(node)):
        return None
    value = eval(compile(ast.Expression(node), "constant", "eval"), {"__builtins__": {}})
    parts = value if isinstance(value, tuple) else (value,)
    numeric = all(isinstance(part, int | float) and not isinstance(part, bool) for part in parts)
    return value if parts and numeric else None


def _comment_above(lines: list[str], number: int) -> str:
    """The comment over a statement, also over the first of the statements that directly follow it."""
    at = number - 2
    while at >= 0 and lines[at][:1].isupper() and " = " in lines[at]:
        at -= 1
    comment: list[str] = []
    while at >= 0 and lines[at].startswith("#"):
        comment.insert(0, lines[at].lstrip("# "))
        at -= 1
    return " ".join(comment)


def changed(value: Value, factor: float) -> Value:
    """The value times a factor; integers change by at least one, and stay integers."""
    if isinstance(value, tuple):
        return tuple(_changed(part, factor) for part in value)
    return _changed(value, factor)


def _changed(value: float, factor: float) -> float:
    if not isinstance(value, int):
        return value * factor
    step = max(1, round(abs(value * (factor - 1.0))))
    return value + (step if (factor > 1.0) == (value >= 0) else -step)


def holders(constant: Constant) -> list[ModuleType]:
    """Loaded modules that hold the constant: its own, and those that import it by name."""
    found = [importlib.import_module(constant.module)]
    for path in DIAGNOSE.rglob("*.py"):
        nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        imports = (n for n in nodes if isinstance(n, ast.ImportFrom) and n.module == constant.module)
        if any(alias.name == constant.name and not alias.asname for n in imports for alias in n.names):
            name = path.relative_to(ROOT / "host").with_suffix("").as_posix().replace("/", ".")
            found.append(importlib.import_module(name))
    return found


def outcomes_with(constant: Constant, factor: float, measure: Callable[[], Outcome]) -> Outcome:
    """Outcomes of the panel while the constant is changed."""
    held = holders(constant)
    before = getattr(held[0], constant.name)
    after = changed(before, factor)
    try:
        for module in held:
            setattr(module, constant.name, after)
            _set_defaults(module, before, after)
        return measure()
    except Exception as error:  # a constant that is out of its range is a finding
        return [["fails", type(error).__name__, ""]]
    finally:
        for module in held:
            setattr(module, constant.name, before)
            _set_defaults(module, after, before)


def _set_defaults(module: ModuleType, old: Value, new: Value) -> None:
    """Replace the constant where it is an argument's default (floats only: small integers are shared)."""
    for function in vars(module).values():
        if isinstance(function, FunctionType) and function.__defaults__ and not isinstance(old, int):
            function.__defaults__ = tuple(new if one is old else one for one in function.__defaults__)


def outcome(folder: Path) -> list[str]:
    """Verdict, named effects, and their parameters to two digits, of one set."""
    from truing.diagnose.diagnosis_input import Options, read_input
    from truing.diagnose.engine import diagnose

    options = Options(jobs=1)
    found = diagnose(read_input(folder, None), options)
    effects = sorted((e.explanation, e.name, str(e.scope)) for e in found.effects)
    parameters = sorted(
        (e.name, name, f"{p.value:.2g}") for e in found.effects for name, p in e.parameters.items()
    )
    return [str(found.verdict), json.dumps(effects), json.dumps(parameters)]


def difference(before: Outcome, after: Outcome) -> str:
    """What differs, in the words of the table."""
    if after and after[0][0] == "fails":
        return f"fails: {after[0][1]}"
    said = []
    for number, (old, new) in enumerate(zip(before, after, strict=True), start=1):
        if old[0] != new[0]:
            said.append(f"set {number}: {new[0]}")
        elif old[1] != new[1]:
            said.append(f"set {number}: effects")
        elif old[2] != new[2]:
            said.append(f"set {number}: parameters")
    return ", ".join(said) or "no verdict moves"


def default_panel(folder: Path) -> list[Path]:
    """Two small sets of a first-order robot: as its baseline says, and with another time constant."""
    from support import recorded_sets

    slower = recorded_sets.BASELINE_TOML.replace("= 0.35", "= 0.25")
    plain = recorded_sets.write_set(folder / "plain", 2)
    return [plain, recorded_sets.write_set(folder / "wrong_time_constant", 2, model=slower)]


def measure(panel: list[Path], minutes: float) -> None:
    """Measure what has not been measured with this panel, until the time is over."""
    key = [path.name for path in panel]
    lines = [line for line in _kept() if line["panel"] == key]
    done = {(line["file"], line["name"], line["value"], line["factor"]) for line in lines}
    end = time.monotonic() + 60.0 * minutes
    for path in panel:  # compiles the simulation
        outcome(path)
    began = time.process_time()
    before = [outcome(path) for path in panel]
    print(f"{time.process_time() - began:.1f} s CPU a panel; {before}", file=sys.stderr, flush=True)
    KEPT.parent.mkdir(parents=True, exist_ok=True)
    tuned = [constant for constant in constants() if constant.status == "tuned"]
    for number, constant in enumerate(tuned, start=1):
        for factor in CHANGES:
            if (constant.file, constant.name, str(constant.value), factor) in done:
                continue
            if time.monotonic() > end:
                return
            after = outcomes_with(constant, factor, lambda: [outcome(path) for path in panel])
            line = {"panel": key, "file": constant.file, "name": constant.name, "value": str(constant.value)}
            line |= {
                "factor": factor,
                "moves": difference(before, after),
                "before": [one[0] for one in before],
            }
            with KEPT.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
            print(
                f"{number}/{len(tuned)} {constant.name} {factor}: {line['moves']}",
                file=sys.stderr,
                flush=True,
            )


def _kept() -> list[dict[str, object]]:
    if not KEPT.exists():
        return []
    return [json.loads(line) for line in KEPT.read_text(encoding="utf-8").splitlines()]


HEAD = """# Tuned constants of `truing diagnose`

Made by `tests/bench/constants.py`; a test fails when a constant is missing here or has another value. Only
literal values are listed: a grid such as a geometric series is not. *Compiled*: frozen in compiled code, not
measured. *Presentation*: used only after the verdict. *Fixed*: physics, statistics, a format or a layout.
Compared are the verdict, the effects named, and their parameters to two digits. A small panel can show that
a constant matters, not that it does not matter on other recordings.
"""


def page(panel: str) -> str:
    """The table as Markdown, from what was measured with the last panel."""
    lines = _kept()
    last = [line for line in lines if line["panel"] == lines[-1]["panel"]]
    moves = {(x["file"], x["name"], x["value"], x["factor"]): str(x["moves"]) for x in last}
    every = constants()
    counts = {kind: sum(c.status == kind for c in every) for kind in STATUSES}
    both = [[moves.get((c.file, c.name, str(c.value), factor)) for factor in CHANGES] for c in every]
    measured = [pair for pair in both if None not in pair]
    still = sum(pair == ["no verdict moves"] * 2 for pair in measured)
    text = [
        HEAD,
        f"- {len(every)} constants: " + ", ".join(f"{count} {kind}" for kind, count in counts.items()) + ".",
        f"- Panel: {panel}{_verdicts(last)}.",
        f"- Measured both ways: {len(measured)} of {counts['tuned']}; of these, {still} move nothing.",
    ]
    file = ""
    for constant, pair in zip(every, both, strict=True):
        if constant.file != file:
            file = constant.file
            head = "| constant | value | stated reason | +30 % | -30 % |"
            text += ["", f"## {file}", "", head, "| --- " * 5 + "|"]
        marks = pair if constant.status == "tuned" else [constant.status] * 2
        text.append(_row(constant, [mark or "not measured" for mark in marks]))
    return "\n".join(text) + "\n"


def _verdicts(lines: list[dict[str, object]]) -> str:
    before = lines[0]["before"] if lines else []
    assert isinstance(before, list)
    return "; verdicts as they are: " + ", ".join(map(str, before)) if before else ""


def _row(constant: Constant, marks: list[str]) -> str:
    value = constant.value
    shown = ", ".join(f"{v:g}" for v in value) if isinstance(value, tuple) else f"{value:g}"
    room = 130 - len(f"| `{constant.name}` | {shown} |  | {marks[0]} | {marks[1]} |")
    reason = (constant.reason or "none stated").replace("|", "/")
    if len(reason) > room:
        reason = reason[: max(room - 3, 0)].rsplit(" ", 1)[0] + "..."
    return f"| `{constant.name}` | {shown} | {reason} | {marks[0]} | {marks[1]} |"


def main(arguments: list[str]) -> int:
    """Measure, then write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sets", nargs="*", type=Path, help="folders of recordings; two made ones if none")
    parser.add_argument("--minutes", type=float, default=math.inf, help="measure no longer than this")
    parser.add_argument("--panel", default="", help="what the panel is, for the head of the table")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as made:
        panel = options.sets or default_panel(Path(made))
        if options.minutes > 0:
            measure(panel, options.minutes)
        description = options.panel or ", ".join(path.name for path in panel)
        if not _kept():
            description = "none measured yet"
    PAGE.write_text(page(description), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
