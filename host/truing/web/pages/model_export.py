"""Export of the robot's model to simulators and controllers."""

from __future__ import annotations

from pathlib import Path

from nicegui import ui

from truing.errors import TruingError, with_next
from truing.web.pages.elements import Select, button, notify, set_text, tag
from truing.web.session import ViewSession
from truing.web.views.exports import KINDS


class ModelExport:
    """A format and a button that downloads the saved model in it."""

    def __init__(self, session: ViewSession) -> None:
        self._session = session
        with tag("details", classes="more-runs"):
            tag("summary", "Export the robot's model")
            with tag("div", classes="picks", style="align-items:end"):
                self._kind = Select("Format", KINDS, "mjcf", lambda _: None)
                button("Export", self._export)
            self._said = tag("p", classes="note dim", role="status", style="margin:4px 0 0")

    async def _export(self) -> None:
        if not self._session.model_file.is_file():
            notify("no model has been saved: press Save as the robot's model first", good=False)
            return
        request = {
            "kind": "export",
            "model": str(self._session.model_file),
            "to": self._kind.value,
            "folder": str(self._session.model_folder / "exports"),
        }
        set_text(self._said, "exporting …")
        try:
            found = await self._session.simulation.ask(request)
        except TruingError as error:
            set_text(self._said, "")
            notify(with_next(error), good=False)
            return
        set_text(self._said, " ".join([f"written: {found['file']}.", *found["notes"]]))
        ui.download.file(Path(found["file"]))
