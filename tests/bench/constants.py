"""What moves when a tuned constant of `truing.diagnose` is changed by 30 %; run it with --help for options.

The table docs/CONSTANTS.md names every constant with a literal numeric value, its stated reason (the comment
above it), and how the diagnoses of a panel of recording sets change. The page is written after each
measurement, and the next call with the same panel goes on from what it says.
"""

from __future__ import annotations

import argparse
import ast
import dis
import importlib
import json
import math
import sys
import tempfile
import textwrap
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import CodeType, FrameType, FunctionType, ModuleType
from typing import TYPE_CHECKING

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path[:0] = [str(ROOT / folder) for folder in ("host", "protocol/python", "tests")]

if TYPE_CHECKING:
    from support.practice_robots.plans import PlanKind

DIAGNOSE = ROOT / "host" / "truing" / "diagnose"
PAGE = ROOT / "docs" / "CONSTANTS.md"
CHANGES = (1.3, 0.7)
STATUSES = ("tuned", "compiled", "presentation", "fixed")
NOT_MEASURED = "not measured"
NOT_REACHED = "not reached"
NO_CHANGE = "no verdict moves"
FAILS = "fails"
PANEL = "- Panel: "
VERDICTS = "; verdicts as they are: "
Value = float | tuple[float, ...]
Place = tuple[str, str]  # a file, and the qualified name of a function in it
Marks = dict[tuple[str, str, str, float], str]  # what moves, by file, name, value and factor

# Measured first: the modules in which the verdict is made.
FIRST = (
    "verdict", "pairs", "stepwise", "unseen_runs", "compare", "noise", "noise_floor", "problem",
    "residual_tests", "screen", "search",
)  # fmt: skip
# Practice robots, two runs each, near limits of several rules: effect, second one, strength, plan, seed.
PRACTICE: tuple[tuple[str, str | None, str, PlanKind, int], ...] = (
    ("driver_lag", None, "weak", "ordinary", 11),
    ("stribeck_friction", None, "full", "rich", 3),
    ("knocks", None, "full", "ordinary", 14),
    ("supply_sag", "direction_asymmetry", "full", "rich", 15),
    ("payload_change", None, "full", "thirds", 16),
)
PRACTICE_RUNS = 2
# Values that physics, statistics, a format or a layout in memory fixes.
NOT_TUNED = {
    "GRAVITY", "NORMAL_975", "CHI2_95", "SCHEMA", "BASELINE_PARAMETERS", "COUNTER_SPANS", "WHOLE_RUN",
    "NO_EVENT", "KEPT_JACOBIANS", "PAST", "MEETING", "BAR_PX", "HEADER_PX",
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


def outcome_with(constant: Constant, factor: float, folder: Path) -> list[str]:
    """Outcome of a set while the constant is changed."""
    held = holders(constant)
    before = getattr(held[0], constant.name)
    after = changed(before, factor)
    try:
        for module in held:
            setattr(module, constant.name, after)
            _set_defaults(module, before, after)
        return outcome(folder)
    except Exception as error:  # a constant that is out of its range is a finding
        return [FAILS, type(error).__name__, ""]
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


def difference(number: int, old: list[str], new: list[str]) -> str:
    """What differs between two outcomes of a set, in the words of the table; empty where nothing does."""
    if old[0] != new[0]:
        return f"set {number}: {new[0]}"
    if old[1] != new[1]:
        return f"set {number}: effects"
    return f"set {number}: parameters" if old[2] != new[2] else ""


def default_panel(folder: Path) -> list[Path]:
    """What is at hand everywhere: the example, a first-order robot with another time constant, PRACTICE."""
    from support import recorded_sets
    from support.practice_robots import make_trial

    slower = recorded_sets.BASELINE_TOML.replace("= 0.35", "= 0.25")
    sets = [ROOT / "docs" / "example"]
    sets.append(recorded_sets.write_set(folder / "wrong_time_constant", 2, model=slower))
    for effect, second, strength, plan, seed in PRACTICE:
        made = folder / effect
        make_trial(seed, effect, strength, folder=made, plan_kind=plan, second_effect=second)
        for run in sorted(made.glob("recordings/runs/*.csv"))[PRACTICE_RUNS:]:
            run.unlink()
        sets.append((made / "recordings").rename(folder / f"{effect}_{strength}"))
    return sets


@dataclass(frozen=True)
class Panel:
    """The sets, their outcomes with all constants as they are, and the code that ran for each."""

    sets: list[Path]
    before: list[list[str]]
    ran: list[set[Place]]

    @classmethod
    def of(cls, sets: list[Path]) -> Panel:
        for path in sets:  # compiles the simulation
            outcome(path)
        ran = [code_of(partial(outcome, path)) for path in sets]
        return cls(sets, [outcome(path) for path in sets], ran)

    def changes(self, constant: Constant, factor: float) -> str:
        """What the first set that moves says; a set in which no code that uses the constant ran cannot."""
        users = using(constant)
        reached = [at for at, ran in enumerate(self.ran) if users is None or users & ran]
        for at in reached:
            after = outcome_with(constant, factor, self.sets[at])
            if after[0] == FAILS:
                return f"fails: {after[1]}"
            if found := difference(at + 1, self.before[at], after):
                return found
        return NO_CHANGE if reached else NOT_REACHED


def code_of(run: Callable[[], object]) -> set[Place]:
    """Functions of `truing.diagnose` that are run, in this thread and in those that it starts."""
    found: set[Place] = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and str(DIAGNOSE) in frame.f_code.co_filename:
            found.add(_place(frame.f_code))

    threading.setprofile(note)
    sys.setprofile(note)
    try:
        run()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return found


def using(constant: Constant) -> set[Place] | None:
    """Functions that name the constant; None where that does not say when it is used.

    It does not where other module-level values are made from it (defaults, tables, classes), or where
    compiled code holds it.
    """
    users: set[CodeType] = set()
    for module in holders(constant):
        source = Path(str(module.__file__))
        whole = compile(source.read_text(encoding="utf-8"), str(source), "exec")
        if _loads(whole, constant.name):
            return None
        users |= {one for one in _inner(whole) if _loads(one, constant.name)}
    return None if any(_is_compiled(one) for one in users) else {_place(one) for one in users}


def _place(code: CodeType) -> Place:
    return code.co_filename, code.co_qualname


def _loads(code: CodeType, name: str) -> bool:
    loads = ("LOAD_NAME", "LOAD_GLOBAL")
    return any(one.opname in loads and one.argval == name for one in dis.get_instructions(code))


def _inner(code: CodeType) -> Iterator[CodeType]:
    for one in code.co_consts:
        if isinstance(one, CodeType):
            yield one
            yield from _inner(one)


def _is_compiled(code: CodeType) -> bool:
    lines = Path(code.co_filename).read_text(encoding="utf-8").splitlines()
    return "@compiled" in "".join(lines[max(code.co_firstlineno - 2, 0) : code.co_firstlineno])


def measure(sets: list[Path], panel: str, minutes: float) -> None:
    """Measure what the page does not say of this panel yet, until the time is over."""
    said, marks = read_page()
    marks = marks if said.startswith(panel + VERDICTS) else {}
    end = time.monotonic() + 60.0 * minutes
    at_hand = Panel.of(sets)
    panel += VERDICTS + ", ".join(one[0] for one in at_hand.before)
    print(at_hand.before, file=sys.stderr, flush=True)
    for constant, factor in missing(marks):
        if time.monotonic() > end:
            break
        marks[key(constant, factor)] = at_hand.changes(constant, factor)
        print(f"{constant.name} {factor}: {marks[key(constant, factor)]}", file=sys.stderr, flush=True)
        PAGE.write_text(page(panel, marks), encoding="utf-8")


def missing(marks: Marks) -> list[tuple[Constant, float]]:
    """Tuned constants, and the factors by which they have not been changed yet."""
    tuned = [constant for constant in constants() if constant.status == "tuned"]
    return [(one, factor) for one in tuned for factor in CHANGES if key(one, factor) not in marks]


def key(constant: Constant, factor: float) -> tuple[str, str, str, float]:
    """Where a constant's measurement is kept: another value has not been measured."""
    return constant.file, constant.name, shown(constant.value), factor


def read_page() -> tuple[str, Marks]:
    """The panel, with its verdicts, and what moves."""
    panel, marks, file = "", Marks(), ""
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith(PANEL):
            panel = line.removeprefix(PANEL)
        elif line.startswith("  "):
            panel += " " + line.strip()
        elif line.startswith("## "):
            file = line.removeprefix("## ")
        elif line.startswith("| `"):
            cells = [cell.strip() for cell in line.strip("| ").split(" | ")]
            name, value = cells[0].strip("`"), cells[1]
            for factor, mark in zip(CHANGES, cells[-2:], strict=True):
                if mark != NOT_MEASURED and mark not in STATUSES:
                    marks[file, name, value, factor] = mark
    return panel.removesuffix("."), marks


HEAD = """# Tuned constants of `truing diagnose`

Made by `tests/bench/constants.py`; a test fails when a constant is missing here or has another value. Only
literal values are listed: a grid such as a geometric series is not. *Compiled*: frozen in compiled code, not
measured. *Presentation*: used only after the verdict. *Fixed*: physics, statistics, a format or a layout.
Compared are the verdict, the effects named, and their parameters to two digits; the first set of the panel
that moves is given. *Not reached*: no code that uses it ran. A panel can show that a constant matters, not
that it does not matter on other recordings.
"""


def page(panel: str, marks: Marks) -> str:
    """The table as Markdown."""
    every = constants()
    counts = {kind: sum(c.status == kind for c in every) for kind in STATUSES}
    pairs = [[marks.get(key(c, factor), NOT_MEASURED) for factor in CHANGES] for c in every]
    measured = [pair for pair in pairs if NOT_MEASURED not in pair]
    still = sum(pair == [NO_CHANGE] * 2 for pair in measured)
    unreached = sum(pair == [NOT_REACHED] * 2 for pair in measured)
    text = [
        HEAD,
        f"- {len(every)} constants: " + ", ".join(f"{count} {kind}" for kind, count in counts.items()) + ".",
        textwrap.fill(f"{PANEL}{panel}.", 128, subsequent_indent="  ", break_on_hyphens=False),
        f"- Measured both ways: {len(measured)} of {counts['tuned']}; of these, {still} move nothing"
        f" and {unreached} are in no code that ran.",
    ]
    file = ""
    for constant, pair in zip(every, pairs, strict=True):
        if constant.file != file:
            file = constant.file
            head = "| constant | value | stated reason | +30 % | -30 % |"
            text += ["", f"## {file}", "", head, "| --- " * 5 + "|"]
        text.append(_row(constant, pair if constant.status == "tuned" else [constant.status] * 2))
    return "\n".join(text) + "\n"


def shown(value: Value) -> str:
    """A value as the table writes it."""
    return ", ".join(f"{v:g}" for v in value) if isinstance(value, tuple) else f"{value:g}"


def _row(constant: Constant, marks: list[str]) -> str:
    value = shown(constant.value)
    room = 130 - len(f"| `{constant.name}` | {value} |  | {marks[0]} | {marks[1]} |")
    reason = (constant.reason or "none stated").replace("|", "/")
    if len(reason) > room:
        reason = reason[: max(room - 3, 0)].rsplit(" ", 1)[0] + "..."
    return f"| `{constant.name}` | {value} | {reason} | {marks[0]} | {marks[1]} |"


def main(arguments: list[str]) -> int:
    """Measure, then write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sets", nargs="*", type=Path, help="sets beside docs/example and a made one")
    parser.add_argument("--minutes", type=float, default=math.inf, help="measure no longer than this")
    options = parser.parse_args(arguments)
    if options.minutes > 0:
        with tempfile.TemporaryDirectory() as made:
            sets = [*default_panel(Path(made)), *options.sets]
            measure(sets, ", ".join(path.name for path in sets), options.minutes)
    PAGE.write_text(page(*read_page()), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
