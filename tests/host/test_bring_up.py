"""The form of a board's bring-up, and the page that explains it."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path

import click
import pytest

from truing.board.bring_up import STEPS, empty, problems
from truing.board.bring_up_form import Form, read_form, write_form
from truing.cli import group
from truing.cli.check import _hand
from truing.errors import FormError, TruingError

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/BRINGUP.md").read_text(encoding="utf-8")
RIGHT = {"battery": {"battery_by_meter": 12.0, "battery_by_board": 12.1}}
COMMANDS = sorted(set(re.findall(r"^\./run truing (.+)$", PAGE, re.M)))


def sections() -> dict[str, str]:
    parts = re.split(r"^## (\d+\. .+)$", PAGE, flags=re.M)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def test_the_page_has_the_steps_of_the_form_in_their_order_each_with_its_limits() -> None:
    found = sections()
    assert list(found) == [f"{number}. {step.title}" for number, step in enumerate(STEPS, 1)]
    for step, text in zip(STEPS, found.values(), strict=True):
        rows = re.findall(r"^\| `(\w+)` \| (.+?) \| (.+?) \|$", text, re.M)
        assert rows == [
            (one.name, one.wanted + (", or skip" if one.optional else ""), one.by)
            for one in step.measurements
        ]
        assert f"`[{step.name}]`" in text
        assert "Otherwise: " in text


def test_there_are_commands_on_the_page() -> None:
    assert len(COMMANDS) > 8


@pytest.mark.filterwarnings("ignore:.*protected_args:DeprecationWarning")
@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_of_the_page_exists_with_its_options(line: str) -> None:
    command: click.Command = group
    arguments, context = shlex.split(line), None
    while True:
        context = command.make_context(command.name or "truing", list(arguments), parent=context)
        if not isinstance(command, click.Group):
            return
        rest = [*context.protected_args, *context.args]  # what the group left for its subcommand
        name, found, arguments = command.resolve_command(context, rest)
        assert found is not None, name
        command = found


def filled() -> Form:
    """A form in which every value is right, and as far inside its limits as it can be."""
    form = Form("0123", "0.1.0", 'Ada "the first" \\ of all')
    for step in STEPS:
        for one in step.measurements:
            limits = [limit for limit in (one.low, one.high) if limit is not None]
            value = one.words[0] if one.words else sum(limits) / len(limits) if limits else 2400.0
            form.values.setdefault(step.name, {})[one.name] = value
    form.notes["pwm"] = "picture 3\nsecond line\t\x7f\x01 ü"
    return form


def test_a_form_comes_back_as_it_was_written(tmp_path: Path) -> None:
    form = filled()
    write_form(tmp_path / "form.toml", form)
    assert read_form(tmp_path / "form.toml") == Form(
        form.board_id,
        form.firmware_version,
        form.person,
        form.values,
        {s.name: "" for s in STEPS} | form.notes,
    )
    assert problems(form.values) == {}
    assert empty(form.values) == []


def test_an_empty_form_names_each_step_once_in_order(tmp_path: Path) -> None:
    write_form(tmp_path / "form.toml", Form("0123"))
    values = read_form(tmp_path / "form.toml").values
    assert values == {}
    missing = empty(values)
    assert missing == [f"{step.name}.{one.name}" for step in STEPS for one in step.measurements]
    assert problems(values) == {}


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.name)
def test_a_value_beyond_each_limit_is_named(step: object) -> None:
    assert hasattr(step, "measurements")
    for one in step.measurements:
        for value in (
            *([] if one.low is None else [one.low - 1e-3]),
            *([] if one.high is None else [one.high + 1e-3]),
            *(["no"] if one.words else []),
            *(["about 3"] if not one.words else []),
        ):
            form = filled()
            form.values[step.name][one.name] = value
            assert f"{step.name}.{one.name}" in problems(form.values), value


def test_skip_is_right_only_where_the_form_says_so() -> None:
    form = filled()
    for step in STEPS:
        for one in step.measurements:
            form.values[step.name][one.name] = "skip"
    wrong = problems(form.values)
    optional = {f"{step.name}.{one.name}" for step in STEPS for one in step.measurements if one.optional}
    assert optional
    assert set(wrong) == set(empty({})) - optional


def test_the_board_and_the_meter_must_agree_on_the_battery() -> None:
    assert problems(RIGHT) == {}
    wrong = problems({"battery": {**RIGHT["battery"], "battery_by_board": 12.4}})
    assert list(wrong) == ["battery.battery_by_board"]
    assert "more than 2.5% apart" in wrong["battery.battery_by_board"]


def spoil(old: str, new: str) -> Callable[[str], str]:
    return lambda text: text.replace(old, new, 1)


@pytest.mark.parametrize(
    ("spoiled", "says"),
    [
        (spoil("supply_3v3 = 3.3", "supply_3v3 = about 3.3"), "not valid TOML"),
        (spoil("supply_3v3 = 3.3", "supply_5v = 5.0"), "[power] has no field supply_5v"),
        (spoil("supply_3v3 = 3.3", "supply_3v3 = true"), "neither a number nor a word"),
        (spoil("[pwm]", "[pmw]"), "pmw is no step"),
        (spoil('board_id = "0123"', 'board_id = ""'), "names no board"),
        (lambda _: "\xff", "not valid TOML"),
    ],
)
def test_a_form_that_is_none_is_refused_by_name(
    tmp_path: Path, spoiled: Callable[[str], str], says: str
) -> None:
    path = tmp_path / "form.toml"
    write_form(path, filled())
    text = path.read_text(encoding="utf-8")
    changed = spoiled(text)
    assert changed != text
    path.write_text(changed, encoding="utf-8")
    with pytest.raises(FormError, match=re.escape(says)):
        read_form(path)


class _NoTerminal:
    """An app whose command nobody can answer, and a device behind a real line."""

    asks = False

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.client = self
        self.stream = self

    def note(self, text: str) -> None:
        self.notes.append(text)


def test_where_nobody_can_turn_the_wheels_the_form_does_without_and_a_mere_check_refuses() -> None:
    app = _NoTerminal()
    assert _hand(app, app, False, needed=False) is None  # type: ignore[arg-type]
    assert "`wiring` is left as it is" in app.notes[0]
    with pytest.raises(TruingError, match="this is no terminal"):
        _hand(app, app, True, needed=True)  # type: ignore[arg-type]


@pytest.mark.parametrize("answer", [True, False])
def test_a_person_who_declines_keeps_the_wheels_still(monkeypatch: pytest.MonkeyPatch, answer: bool) -> None:
    app = _NoTerminal()
    monkeypatch.setattr(app, "asks", True)
    monkeypatch.setattr(click, "confirm", lambda *_, **__: answer)
    hand = _hand(app, app, False, needed=False)  # type: ignore[arg-type]
    assert (hand is not None) == answer
