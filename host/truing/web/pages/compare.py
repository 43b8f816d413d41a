"""Compare: desired, simulated, simulated with the error model, and real, as paths and as a table."""

from __future__ import annotations

import math

from truing.web.models.error_model import KINDS, Kind, offered_kinds
from truing.web.pages.address import Address
from truing.web.pages.drop_dialogue import RunDrop
from truing.web.pages.elements import Choice, button, number, panel, tag
from truing.web.pages.run_stage import RunStage
from truing.web.pose import Pose
from truing.web.session import ViewSession

_KINDS: dict[str, Kind] = {str(kind): kind for kind in KINDS}


class ComparePage:
    """One comparison."""

    def __init__(self, session: ViewSession, address: Address) -> None:
        self.session = session
        self.address = address
        kind = _KINDS.get(address.text("model"))
        if kind is not None and kind in offered_kinds(session.model):
            session.set_model(kind=kind)
        start = address.numbers("start", 3)
        if start is not None:
            session.comparison_start = Pose(*start)
        self.stage = RunStage(session, address, lambda: session.model)

    def build(self) -> None:
        """Make the elements."""
        with tag("div", classes="view broad"):
            self.stage.picture("Paths and speeds")
            with tag("section", classes="side", aria_label="Run and stopping points"):
                with panel("Run"):
                    self.stage.choice()
                    self.stage.other_runs()
                    RunDrop(self.stage.find)
                with panel("Error model"):
                    Choice(
                        "Error model",
                        offered_kinds(self.session.model),
                        self.session.model.kind,
                        self.choose_model,
                    )
                    self.source = tag("p", self.session.model.source, "dim note", style="margin:4px 0 0")
                with tag("div"):
                    self.stage.table()
                self._start()

    def _start(self) -> None:
        start = self.session.comparison_start
        with panel("Start"), tag("div", classes="row-tight"):
            number("x, m", start.x_m, lambda v: self.set_start(x=v), low=-50, high=50, step=0.1)
            number("y, m", start.y_m, lambda v: self.set_start(y=v), low=-50, high=50, step=0.1)
            degrees = round(math.degrees(start.theta_rad), 3)
            number("heading, °", degrees, lambda v: self.set_start(theta=v), low=-360, high=360, step=5)
            button("Rescan", self.stage.find, label="Search the disk for new runs")

    def set_start(
        self, *, x: float | None = None, y: float | None = None, theta: float | None = None
    ) -> None:
        """The common start pose."""
        start = self.session.comparison_start
        self.session.comparison_start = Pose(
            start.x_m if x is None else x,
            start.y_m if y is None else y,
            start.theta_rad if theta is None else math.radians(theta),
        )
        text = ",".join(f"{value:g}" for value in self.session.comparison_start.as_list())
        self.address.write(start=text)
        self.stage.draw()

    def choose_model(self, kind: str) -> None:
        """Select the error model."""
        self.session.set_model(kind=_KINDS[kind])
        self.address.write(step=True, model=kind)
        self.stage.draw()
