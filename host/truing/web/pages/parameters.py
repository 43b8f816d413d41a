"""Parameters: list, change, save and compare the board's parameters."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import background_tasks, context

from truing.board.device import Device
from truing.board.parameter_file import read_parameter_file, same_on_the_board, write_parameter_file
from truing.board.state import Parameter, format_f32
from truing.errors import TruingError, with_next
from truing.web.pages.address import Address
from truing.web.pages.components import NumberField
from truing.web.pages.control import ControlGate
from truing.web.pages.elements import PlainTable, Select, button, notify, panel, set_text, tag, text_field
from truing.web.path.sequence_file import checked_name
from truing.web.session import ViewSession

_STORED = "what the board has stored"
_DEFAULT = "the defaults"


class ParametersPage:
    """The parameters in force, and what they are compared with."""

    def __init__(self, session: ViewSession, address: Address) -> None:
        self.session = session
        self.address = address
        self.client = context.client
        self.gate = ControlGate(session)
        self.found: dict[str, Parameter] = {}
        self.search = address.text("search")
        self.file_name = "board"

    def build(self) -> None:
        """Make the elements."""
        with tag("div", classes="view"):
            with tag("section", classes="stage listing", aria_label="Parameters", tabindex="0"):
                with tag("div", classes="tools"):
                    text_field("Search", self.search, self.set_search, width_px=200, more="clearable")
                    button("Read again", self.read)
                self.table = tag("table", classes="plain parameters", aria_label="Parameters of the board")
            with tag("section", classes="side", aria_label="Store and comparison"):
                self._store_part()
                self._compare_part()
        self.read()

    def _store_part(self) -> None:
        with panel("Store"):
            self.status = tag("p", classes="note", role="status", style="margin:0 0 6px")
            with tag("div", classes="row-tight"):
                self._action(
                    "Save on the board", "save the parameters", lambda d: d.save_parameters(), strong=True
                )
                self._action("Load what is stored", "load the parameters", lambda d: d.load_parameters())
                self._action("Defaults", "set the defaults", lambda d: d.default_parameters())
        with panel("File"):
            with tag("div", classes="row-tight"):
                text_field("Name", self.file_name, partial(setattr, self, "file_name"))
                button("Save to file", self.save_file)
            self.saved = tag("p", classes="note dim", role="status", style="margin:4px 0 0")

    def _compare_part(self) -> None:
        with panel("Difference"):
            self.other = Select("Compare with", self._others(), self.address.text("with"), self.compare)
            self.difference = tag("p", classes="note", role="status", style="margin:6px 0")
            with tag("div", classes="many"):
                self.differences = PlainTable("Parameters that differ")
            self.load = button("Put these into force", self.load_file)

    def _action(self, text: str, what: str, work: Callable[[Device], Any], *, strong: bool = False) -> None:
        button(text, lambda: self.gate.run(what, partial(self.do, work)), strong=strong)

    # ---- reading and changing

    def read(self) -> None:
        """Read the parameters of the board."""
        self.do(lambda _: None)

    def do(self, work: Callable[[Device], Any]) -> None:
        """Do something with the board, then show its parameters."""
        background_tasks.create(self._guarded(partial(self._do, work)))

    async def _do(self, work: Callable[[Device], Any]) -> None:
        try:
            await asyncio.wrap_future(self.session.worker.call(work))
        finally:
            found = await asyncio.wrap_future(self.session.worker.read_parameters())
            if not self.table.is_deleted:
                with self.client:
                    self.found = found
                    self.show()

    async def _guarded(self, work: Callable[[], Awaitable[None]]) -> None:
        try:
            await work()
        except TruingError as error:
            with self.client:
                set_text(self.status, with_next(error))
                notify(with_next(error), good=False)

    def change(self, name: str, text: object) -> None:
        """Put a value into force."""
        try:
            value = float(str(text))
        except ValueError:
            notify(f"{name}: {text} is not a number: the value in force stays", good=False)
            self.show()
            return
        if same_on_the_board(self.found[name].value, value):
            return
        self.gate.run(
            f"change {name}", partial(self.do, lambda device: device.set_parameter(name, value)), self.show
        )

    # ---- display

    def set_search(self, text: str) -> None:
        """Show the parameters whose name or meaning has this text."""
        self.search = text
        self.address.write(search=text)
        self.show()

    def show(self) -> None:
        """Show the list, and the comparison."""
        kept = [one for one in self.found.values() if one.is_kept]
        text = (
            f"{len(self.found) - len(kept)} of {len(self.found)} values are not stored: a restart loses them."
        )
        set_text(
            self.status, text if len(kept) < len(self.found) else "A restart keeps every value as it is."
        )
        self.table.clear()
        with self.table:
            with tag("thead"), tag("tr"):
                for head in ("parameter", "value", "unit", "stored", "default", "limits"):
                    tag("th", head, scope="col")
                tag("th", "meaning", "meaning", scope="col")
            with tag("tbody"):
                for name, parameter in self.found.items():
                    if self.search.lower() in f"{name} {parameter.info.doc}".lower():
                        self._row(name, parameter)
        self.compare(self.other.value)

    def _row(self, name: str, parameter: Parameter) -> None:
        info = parameter.info
        with tag("tr", classes="" if parameter.is_kept else "not-stored"):
            tag("th", name, scope="row")
            with tag("td"):
                field = NumberField(name, parameter.text)
                field.on("typed", lambda event: self.change(name, event.args))
            stored = "–" if parameter.stored is None else format_f32(parameter.stored)
            limits = f"{format_f32(info.minimum)} to {format_f32(info.maximum)}"
            for text in (info.unit, stored, format_f32(info.default), limits):
                tag("td", text)
            tag("td", info.doc, "meaning")

    # ---- comparison and files

    def _others(self) -> dict[str, str]:
        files = sorted(self._folder.glob("*.toml"))
        return {"": _STORED, "default": _DEFAULT} | {str(path): path.stem for path in files}

    @property
    def _folder(self) -> Path:
        return self.session.parameter_folder

    def _other_values(self) -> Mapping[str, float]:
        if self.other.value == "":
            return {name: one.after_restart for name, one in self.found.items()}
        if self.other.value == "default":
            return {name: one.info.default for name, one in self.found.items()}
        found = read_parameter_file(self.other.value)
        return {name: value for name, value in found.items() if name in self.found}

    def _differing(self, values: Mapping[str, float]) -> dict[str, float]:
        """Those of the values that are not in force."""
        return {
            name: value
            for name, value in values.items()
            if not same_on_the_board(self.found[name].value, value)
        }

    def compare(self, other: str) -> None:
        """Show which values differ from the stored ones, the defaults, or a file's."""
        self.address.write({"with": other})
        try:
            values = self._other_values()
        except TruingError as error:
            notify(with_next(error), good=False)
            values = {}
        rows = [
            [name, self.found[name].text, format_f32(value), self.found[name].info.unit]
            for name, value in self._differing(values).items()
        ]
        self.differences.clear()
        if rows:
            self.differences.fill(["parameter", "in force", "there", "unit"], rows)
        set_text(
            self.difference,
            f"{len(rows)} of {len(values)} differ" if rows else f"no difference in {len(values)}",
        )
        self.load.set_visibility(bool(rows) and other not in ("", "default"))

    def save_file(self) -> None:
        """Write the values in force to a file."""
        info = self.session.worker.snapshot.info
        origin = (
            "" if info is None else f"Parameters of board {info.board_id}, firmware {info.firmware_version}."
        )
        try:
            path = self._folder / f"{checked_name(self.file_name)}.toml"
            write_parameter_file(path, self.found, origin)
        except TruingError as error:
            notify(with_next(error), good=False)
            return
        set_text(self.saved, f"saved: {path}")
        self.other.fill(self._others(), self.other.value)

    def load_file(self) -> None:
        """Put the values of the file into force; all are checked before the first is changed."""
        values = self._differing(self._other_values())
        self.gate.run("change the parameters", partial(self.do, lambda device: device.set_parameters(values)))
