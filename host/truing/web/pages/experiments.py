"""Experiments: every plan with preview, run and progress; then diagnose and compare what was driven."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from nicegui import background_tasks, context, ui

from truing.errors import TruingError, with_next
from truing.plan import Plan
from truing.web.models.run_forecast import forecast
from truing.web.pages.address import Address
from truing.web.pages.components import Plot, TopView
from truing.web.pages.diagnosis_card import DiagnosisCard
from truing.web.pages.elements import (
    Select,
    action_link,
    button,
    heading,
    notify,
    number,
    panel,
    set_text,
    tag,
    text_field,
)
from truing.web.pages.live import task_panel
from truing.web.pages.procedure_panel import ProcedurePanel
from truing.web.pages.run_preview import RunPreview
from truing.web.path.sequence_file import checked_name
from truing.web.pose import Pose
from truing.web.runs.library import FoundSet, find_sets
from truing.web.runs.plans import GROUPS, StepSettings, plan_named, plans_of
from truing.web.session import ViewSession
from truing.web.views.figures import empty_figure
from truing.web.views.plan_figure import plan_figure
from truing.web.worker.state import RunRequest

_STEP_KINDS = {"effort": "Effort, %", "velocity": "Speed, m/s"}
_WHEELS = {"both": "Both wheels", "left": "Left wheel", "right": "Right wheel"}
_NEW = "a new set"
_PATH_COLOUR = "#7ee787"
_NOTHING = {
    "saved": "no saved paths yet: draw one under Trajectory",
    "next": "no proposed experiments: a diagnosis that cannot decide proposes one",
}


class ExperimentsPage:
    """A plan that is chosen, and the run that was driven last."""

    def __init__(self, session: ViewSession, address: Address) -> None:
        self.session = session
        self.address = address
        self.client = context.client
        self.preview = RunPreview(session)
        self.group = address.one_of("group", GROUPS, "diagnosis")
        self.step = _step_of(address.text("height"))
        self.plan: Plan | None = None
        self.new_set = "experiments"
        self._sets: dict[str, FoundSet] = {}
        self._shown_run = ""

    # ---- elements

    def build(self) -> None:
        """Make the elements."""
        with tag("div", classes="view broad"):
            with tag("section", classes="stage", aria_label="What the plan does"):
                self.top = TopView(
                    "The path that the plan commands", "live", fitted=True, address=self.address
                )
                self.top.set(sensors=False)
                with tag("div", classes="overlay"):
                    button("Fit", self.top.fit)
                self.plot = Plot("What the plan commands", address=self.address)
            with tag("section", classes="side", aria_label="Plan, run and result"):
                self._choice()
                self._run_part()
                self.procedures = ProcedurePanel(self.session)
                task_panel()
                self.result = tag("div", classes="result", aria_live="polite")
                self.diagnosis = DiagnosisCard(self.session, lambda _: None, self._show_stretch)
        self.choose_group(self.group)
        background_tasks.create(self._list_sets())
        task = self.session.worker.snapshot.task
        self._shown_run = "" if task is None else task.saved
        ui.timer(0.4, self._look)

    def _choice(self) -> None:
        with panel("Experiment"):
            with tag("div", classes="picks rows"):
                self.groups = Select("Kind", GROUPS, self.group, self.choose_group)
                self.plans = Select("Plan", {"": "–"}, "", self.choose_plan)
            self.step_box = tag("div", classes="row-tight", style="margin-top:8px")
            with self.step_box:
                self._step_fields()
            self.about = tag("p", classes="note", role="status", style="margin:6px 0 0")
            self.facts = tag("dl", classes="facts preview-facts", style="margin-top:6px")

    def _step_fields(self) -> None:
        step = self.step
        Select("Input", _STEP_KINDS, step.kind, lambda value: self.set_step(kind=value))
        number("height", step.height, lambda v: self.set_step(height=v), low=-100, high=100, step=5)
        number(
            "duration, s", step.duration_s, lambda v: self.set_step(duration_s=v), low=0.1, high=60, step=0.5
        )
        Select("Wheels", _WHEELS, step.wheel, lambda value: self.set_step(wheel=value))
        number("log rate, Hz", step.rate_hz, lambda v: self.set_step(rate_hz=v), low=1, high=200, step=10)

    def _run_part(self) -> None:
        with panel("Run"), tag("div", classes="row-tight", style="align-items:end"):
            own = str(self.session.run_folder)
            self.target = Select("Add to set", {own: "this board's own"}, own, self._choose_target)
            self.name = text_field("Name", self.new_set, partial(setattr, self, "new_set"), width_px=150)
            button("Preview and run", self.run, strong=True)
        self.name.set_visibility(False)

    def _choose_target(self, target: str) -> None:
        self.address.write(target=target)
        self._show_target()

    def _show_target(self) -> None:
        """Show the set that runs are added to: its name if it is new, its diagnosis if it is not."""
        self.name.set_visibility(self.target.value == _NEW)
        self.diagnosis.show(self._sets.get(self.target.value))

    async def _list_sets(self, chosen: Path | None = None) -> None:
        found = await asyncio.to_thread(find_sets, self.session.run_folder.parent)
        if self.result.is_deleted:
            return
        own = self.session.run_folder
        options = {str(own): f"{own.name} (this board's own)"}
        self._sets = {str(own if one.path == own.resolve() else one.path): one for one in found}
        for one in found:
            try:
                self.session.own_set(one.path)
            except TruingError:
                continue
            if one.path != own.resolve():
                options[str(one.path)] = one.name
        with self.client:
            target = self.address.text("target") or self.target.value
            self.target.fill(options | {_NEW: _NEW}, target if chosen is None else str(chosen))
            self._show_target()

    # ---- the plan

    def choose_group(self, group: str) -> None:
        """Show the plans of a kind."""
        self.group = group
        self.address.write(step=True, group=group)
        found = plans_of(group, self.session.sequence_folder, self.session.diagnosis_folder)
        named = self.address.text("plan")
        self.plans.fill(found or {"": "–"}, named if named in found else next(iter(found), ""))
        self.step_box.set_visibility(group == "step")
        self.procedures.show(group)
        self.choose_plan(self.plans.value)

    def choose_plan(self, name: str) -> None:
        """Show what a plan does."""
        if self.group == "tune":
            background_tasks.create(self._show_tuning())
            return
        if self.group == "step":
            self._show_step()
            return
        self.address.write(plan=name)
        folders = (self.session.sequence_folder, self.session.diagnosis_folder)
        self.show_plan(plan_named(self.group, name, *folders) if name else None)

    def set_step(self, **changes: Any) -> None:
        """Change the step."""
        self.step = replace(self.step, **changes)
        self._show_step()

    def _show_step(self) -> None:
        step = self.step
        values = (step.kind, f"{step.height:g}", f"{step.duration_s:g}", step.wheel, f"{step.rate_hz:g}")
        self.address.write(height=",".join(values))
        limit = 1.0 if step.kind == "effort" else 10.0
        self.show_plan(step.plan() if abs(step.height) <= 100.0 * limit else None)

    async def _show_tuning(self) -> None:
        try:
            proof, _ = await self.session.tuning.plans()
        except TruingError as error:
            notify(with_next(error), good=False)
            return
        if self.result.is_deleted:
            return
        with self.client:
            self.show_plan(proof)

    def show_plan(self, plan: Plan | None) -> None:
        """Show a plan: path, commands, room."""
        self.plan = plan
        self.facts.clear()
        if plan is None:
            text = self.procedures.about(self.group) or _NOTHING.get(self.group, "")
            set_text(self.about, text)
            self.top.set(paths=[])
            self.plot.show(
                empty_figure("nothing is driven by a plan here" if self.group == "check" else text)
            )
            return
        session = self.session
        with session.sensing.world_lock:
            pose = session.corrected_pose() or Pose()
            found = forecast(plan, session.worker.parameters, pose, session.world)
        about = [plan.title, self.procedures.about(self.group)]
        if found.obstacle is not None:
            about.append("An obstacle of the world is in the way at {:.2f}, {:.2f} m".format(*found.obstacle))
        set_text(self.about, ". ".join(filter(None, about)) + ".")
        path = {
            "points": found.path.round(3).tolist(),
            "colour": _PATH_COLOUR,
            "name": "",
            "title": "planned",
        }
        self.top.set(paths=[path])
        self.plot.show(plan_figure(plan), plan.title)
        with self.facts:
            for name, value in found.facts():
                tag("dt", name)
                tag("dd", value, "num")

    # ---- running

    def run(self) -> None:
        """Show what will happen; the user starts it from there."""
        try:
            folder = self._folder()
            if self.group == "check":
                self.procedures.ask_for_check()
            elif self.plan is None:
                notify("choose a plan first", good=False)
            elif self.group == "tune" and self.session.tuning.is_running:
                notify("a tuning is under way: wait until it ends, or press space", good=False)
            elif self.group == "tune":
                request = RunRequest(self.plan, folder, "tune_before")
                self.preview.show(request, lambda: self._tune(folder))
            else:
                self.preview.show(RunRequest(self.plan, folder, self.plan.name.replace("/", "_")))
        except TruingError as error:
            notify(with_next(error), good=False)

    def _folder(self) -> Path:
        if self.target.value == _NEW:
            return self.session.run_folder.parent / checked_name(self.new_set)
        return Path(self.target.value)

    def _tune(self, folder: Path) -> None:
        name = self.client.id
        drive = self.session.tuning.run(lambda request: self.session.run(name, request), folder)
        background_tasks.create(drive)

    # ---- the result

    def _look(self) -> None:
        """Show the run that has been saved."""
        self.procedures.update()
        task = self.session.worker.snapshot.task
        saved = "" if task is None else task.saved
        if saved and saved != self._shown_run:
            self._shown_run = saved
            background_tasks.create(self._show_run(Path(saved)))

    async def _show_run(self, run: Path) -> None:
        found = await asyncio.to_thread(find_sets, self.session.run_folder.parent)
        home = next((one for one in found if run.resolve() in [path.resolve() for path in one.runs]), None)
        if home is None or self.result.is_deleted:
            return
        with self.client:
            self.result.clear()
            with self.result:
                self._result(home, run)
        made_here = self.target.value == _NEW and home.path.name == self.new_set
        await self._list_sets(home.path if made_here else None)

    def _result(self, home: FoundSet, run: Path) -> None:
        query = urlencode({"set": home.name, "run": run.stem})
        heading("Driven")
        tag(
            "p", f"{run.stem} is in {home.name}, which has {len(home.runs)} runs now.", style="margin:0 0 6px"
        )
        with tag("div", classes="row-tight"):
            action_link("Compare", f"/compare?{query}", strong=True)
            action_link("Analyse", f"/analysis?{query}")

    def _show_stretch(self, stretch: dict[str, Any]) -> None:
        first, last = stretch["span"]
        home = self.diagnosis.home
        query = {"set": "" if home is None else home.name, "run": stretch["run"]}
        ui.navigate.to(f"/analysis?{urlencode(query | {'span': f'{first:g},{last:g}'})}")


def _step_of(text: str) -> StepSettings:
    """The step that an address names; the usual one otherwise."""
    parts = text.split(",")
    try:
        kind, height, duration, wheel, rate = parts
        step = StepSettings(kind, float(height), float(duration), wheel, float(rate))
    except ValueError:
        return StepSettings()
    valid = (
        kind in _STEP_KINDS and wheel in _WHEELS and 0.1 <= step.duration_s <= 60 and 1 <= step.rate_hz <= 200
    )
    return step if valid and abs(step.height) <= 100 else StepSettings()
