"""Files dropped onto a page: what became of each, and what a file of another program leaves open."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from nicegui import context, events, ui

from truing.web.pages.components import DropZone
from truing.web.pages.elements import PlainTable, button, dialog_box, notify, tag
from truing.web.runs.dropped_files import ADDRESS, MAX_BYTES

_ACCEPT = ".csv,.json,.toml,.txt,.tsv,.wpilog,.bag,.db3,.mcap,.mat"
_HEAD = ("column", "unit", "from", "to", "course")


class RunDrop:
    """A target for recordings, as a set of their own.

    Parameters
    ----------
    on_runs : called with the last run that was stored.
    """

    def __init__(self, on_runs: Callable[[Path], Any]) -> None:
        self._on_runs = on_runs
        self._client = context.client
        self._zone = DropZone(
            "Drop recordings here (CSV, SysId JSON, wpilog, bag, MCAP, .mat, baseline.toml), or choose files",
            _ACCEPT,
            ADDRESS,
            MAX_BYTES,
        )
        self._zone.on("dropped", self._dropped)
        with ui.dialog() as self._dialog:
            self._box = dialog_box().classes("import-box")
        self._dialog.props('aria-label="Import"')

    def _dropped(self, event: events.GenericEventArguments) -> None:
        """Report what became of each file; ask what one leaves open."""
        last: Path | None = None
        for one in event.args if isinstance(event.args, list) else []:
            if "error" in one:
                notify(str(one["error"]), good=False)
            elif "ask" in one:
                self._ask(one)
            elif one.get("kind") == "diagnosis":
                notify("diagnosis added: see Error models")
            elif one.get("kind") == "run":
                last = Path(str(one["path"]))
                self._report(one)
        if last is not None:
            self._on_runs(last)

    def _report(self, one: dict[str, Any]) -> None:
        if "form" in one:
            notify(f"{one['form']}: {one['runs']} runs in the set dropped/{one['set']}")
        for finding in one.get("findings", []):
            notify(str(finding))

    def _ask(self, one: dict[str, Any]) -> None:
        self._box.clear()
        with self._box:
            tag("h2", f"Import {one['name']}")
            if one["ask"] == "mapping":
                self._ask_mapping(one)
            else:
                self._ask_numbers(one)
        self._dialog.open()

    def _ask_mapping(self, one: dict[str, Any]) -> None:
        for note in one["notes"]:
            tag("p", str(note), "note dim")
        PlainTable("Columns of the file").fill(_HEAD, one["columns"])
        tag("p", "The columns are taken so; change what is not right:", style="margin:8px 0 4px")
        text = ui.textarea(value=one["toml"]).props('outlined dark dense rows=12 aria-label="Mapping"')
        text.style("width:100%").classes("num")
        if one["why"]:
            tag("p", str(one["why"]), "warning", role="alert")
        self._buttons(lambda: {"mapping": str(text.value)})

    def _ask_numbers(self, one: dict[str, Any]) -> None:
        tag("p", str(one["why"]), role="status")
        fields = {
            name: ui.number(label, min=0).props("dense outlined dark")
            for name, label in one["numbers"].items()
        }
        self._buttons(lambda: {name: str(field.value) for name, field in fields.items() if field.value})

    def _buttons(self, answers: Callable[[], dict[str, str]]) -> None:
        def again() -> None:
            self._dialog.close()
            self._zone.run_method("again", answers())

        with tag("div", classes="row-tight", style="margin-top:8px"):
            button("Import", again, strong=True)
            button("Cancel", self._dialog.close)
