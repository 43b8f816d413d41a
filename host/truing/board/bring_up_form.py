"""The form of a board's bring-up: a TOML file that the board and a person fill in turn by turn."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from truing.board.bring_up import STEPS, Measurement, Readings, Value
from truing.errors import FormError
from truing.recording.writer import replace_file

_HEAD = (
    "# Bring-up of a board, step by step; docs/BRINGUP.md says how to measure each value.",
    '# Fill in what is "" with a number or a word, and give this file to `truing check --log` again: what',
    "# you filled in stays, the board measures its own anew, and what is not right is named. Where a comment",
    '# ends with "or skip", the word skip is right for what this robot does not have.',
)


@dataclass(slots=True)
class Form:
    """What is known of a board so far; `values` by step and measurement, without what is empty."""

    board_id: str
    firmware_version: str = ""
    person: str = ""
    values: Readings = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)

    def take(self, readings: Mapping[str, Mapping[str, Value]]) -> None:
        """Put readings into their fields, in the place of what stood there."""
        for step, values in readings.items():
            self.values.setdefault(step, {}).update(values)


def write_form(path: str | Path, form: Form) -> None:
    """Write the form in one step; a form that stands there is replaced."""
    lines = [
        *_HEAD,
        "",
        f"board_id = {_text(form.board_id)}",
        f"firmware_version = {_text(form.firmware_version)}",
        f"person = {_text(form.person)}",
    ]
    for number, step in enumerate(STEPS, 1):
        lines += ["", f"[{step.name}]  # {number}. {step.title}"]
        values = form.values.get(step.name, {})
        for one in step.measurements:
            lines.append(f"{one.name} = {_toml(values.get(one.name))}  # {_comment(one)}")
        lines.append(f"notes = {_text(form.notes.get(step.name, ''))}")
    replace_file(path, ("\n".join(lines) + "\n").encode())


def read_form(path: str | Path) -> Form:
    """Read a form that was begun before.

    Raises
    ------
    FormError : it cannot be read, is no form, or has a table or a field that the form does not have.
    """
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise FormError(path, f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise FormError(path, "is not text in UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise FormError(path, f"not valid TOML: {error}", 'words stand in quotes: notes = "..."') from None
    head = {key: content.pop(key, "") for key in ("board_id", "firmware_version", "person")}
    if not all(isinstance(value, str) for value in head.values()) or not head["board_id"]:
        raise FormError(path, "names no board", "`truing check --log NEW_FILE` begins a form")
    form = Form(**head)
    steps = {step.name: step for step in STEPS}
    for name, table in content.items():
        if name not in steps or not isinstance(table, dict):
            raise FormError(path, f"{name} is no step of the bring-up", f"the steps are {', '.join(steps)}")
        known = {one.name for one in steps[name].measurements}
        for key, value in table.items():
            if key == "notes" and isinstance(value, str):
                form.notes[name] = value
            elif key not in known:
                raise FormError(path, f"[{name}] has no field {key}", f"it has {', '.join(sorted(known))}")
            elif isinstance(value, bool) or not isinstance(value, (int, float, str)):
                raise FormError(path, f"{name}.{key} is neither a number nor a word")
            elif value != "":
                form.values.setdefault(name, {})[key] = value if isinstance(value, str) else float(value)
    return form


def _comment(one: Measurement) -> str:
    return f"{one.wanted}; {one.by}{'; or skip' if one.optional else ''}"


def _toml(value: Value | None) -> str:
    if value is None:
        return '""'
    return _text(value) if isinstance(value, str) else f"{value:.10g}"


def _text(text: str) -> str:
    """A basic string of TOML: JSON's, which leaves one control character as it is."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
