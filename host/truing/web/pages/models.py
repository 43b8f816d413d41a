"""Error models: none, the paper's, or a diagnosed one; the overlay follows every slider."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import events

from truing.errors import TruingError, with_next
from truing.web.models.error_model import (
    KINDS,
    Kind,
    ModelChoice,
    Slider,
    diagnosed_model,
    explanations,
    paper_sliders,
    read_verdict,
    save_model,
)
from truing.web.pages.address import Address
from truing.web.pages.components import DropZone, ParameterSlider
from truing.web.pages.elements import Choice, Select, button, notify, panel, tag
from truing.web.pages.model_export import ModelExport
from truing.web.pages.run_stage import RunStage
from truing.web.runs.dropped_files import ADDRESS, MAX_BYTES
from truing.web.runs.library import baseline_of, safe_name
from truing.web.session import ViewSession

_NO_DIAGNOSES = {"": "none yet: start one under Analysis"}
_KINDS: dict[str, Kind] = {str(kind): kind for kind in KINDS}
_TEXTS = {str(kind): text for kind, text in KINDS.items()}
_ABOUT = {
    "none": "No error model: the path follows from the wheel speeds alone.",
    "paper": "The MOM paper's constants distort the commanded motion. The bar extends from the value printed "
    "in its text to the one implied by the end points of its Table 2.",
    "found": "The diagnosed effects act on wheels and ground under the applied efforts. The bar is the 95 % "
    "interval of each parameter.",
}


class ModelsPage:
    """A model under adjustment; saving makes it the robot's model."""

    def __init__(self, session: ViewSession, address: Address) -> None:
        self.session = session
        self.address = address
        self.choice = session.model
        self.diagnosed_sliders: list[Slider] = []
        self.verdict: dict[str, Any] | None = None
        self.explanation = "0"
        self.stage = RunStage(session, address, lambda: self.choice, self.drawn)

    def build(self) -> None:
        """Make the elements."""
        diagnosis = self._open_address()
        with tag("div", classes="view broad"):
            self.stage.picture("Overlay")
            with tag("section", classes="side", aria_label="Error model"):
                with panel("Run"):
                    self.stage.choice()
                with panel("Error model"):
                    Choice("Error model", _TEXTS, self.choice.kind, self.set_kind)
                    self.about = tag("p", classes="dim note", style="margin:6px 0 0")
                    self.diagnosis_box = tag("div", classes="picks", style="margin-top:6px")
                self.slider_box = tag("div", classes="sliders")
                with tag("div"):
                    with tag("p", classes="note", role="status", style="margin:0"):
                        self.error = tag("span", "", "num", style="white-space:normal")
                    with tag("div", classes="row-tight", style="margin-top:6px"):
                        button("Save as the robot's model", self.save, strong=True)
                        button("Reset values", self.reset)
                    self.saved = tag("p", classes="note dim", role="status", style="margin:4px 0 0")
                ModelExport(self.session)
                with tag("div"):
                    self.stage.table()
        self.list_diagnoses(diagnosis)
        self.show()

    def _open_address(self) -> Path | None:
        """Restore model and sliders from the address; returns the diagnosis that is used."""
        if self.choice.kind == "found" and self.choice.effects:
            self.diagnosed_sliders = self._sliders_of_choice()
        kind, values = _KINDS.get(self.address.text("model")), self.address.text("values")
        name, explanation = self.address.text("diagnosis"), self.address.text("explanation")
        path = self.session.diagnosis_folder / f"{safe_name(name)}.json"
        used = path if name and self._read(path, explanation) else None
        if kind is not None:
            self.choice = replace(self.choice, kind=kind)
        for part in filter(None, values.split(",")):
            key, _, value = part.rpartition("~")
            with contextlib.suppress(ValueError, KeyError, TypeError, AttributeError):
                self.choice = self.choice.with_value(key, float(value))
        return used

    def _keep(self, **texts: str) -> None:
        self.address.write(step="values" not in texts, **texts)

    def list_diagnoses(self, chosen: Path | None = None) -> None:
        """List the diagnoses on disk."""
        files = sorted(self.session.diagnosis_folder.glob("*.json"), key=lambda p: -p.stat().st_mtime)
        self.diagnosis_box.clear()
        with self.diagnosis_box:
            options = {str(path): path.stem for path in files} or _NO_DIAGNOSES
            value = str(chosen) if chosen is not None else ""
            if value not in options and files:
                options = {"": "choose one"} | options
            self.diagnoses = Select("Diagnosis", options, value, lambda path: self.use(Path(path)))
            if self.verdict is not None and len(explanations(self.verdict)) > 1:
                entries = {str(number): text for number, text in explanations(self.verdict)}
                Select("Explanation", entries, self.explanation, self.use_explanation)
            zone = DropZone("Drop a diagnosis (JSON) here, or choose one", ".json", ADDRESS, MAX_BYTES)
            zone.on("dropped", self.dropped)

    def dropped(self, event: events.GenericEventArguments) -> None:
        """Use a dropped diagnosis."""
        for one in event.args if isinstance(event.args, list) else []:
            if one.get("kind") == "diagnosis":
                self.use(Path(str(one["path"])))
            else:
                notify(
                    str(
                        one.get(
                            "error", "this is not a diagnosis: drop the JSON file of `truing diagnose --json`"
                        )
                    ),
                    good=False,
                )

    def use(self, path: Path) -> None:
        """Use the result of a diagnosis."""
        if path.name and self._read(path):
            self.list_diagnoses(path)
            self._keep(model="found", diagnosis=path.stem, explanation=self.explanation)
            self.address.write(values="")
            self.show()

    def _read(self, path: Path, explanation: str = "") -> bool:
        try:
            self.verdict = read_verdict(path)
            known = [str(number) for number, _ in explanations(self.verdict)]
            self._take(explanation if explanation in known else known[0])
        except TruingError as error:
            notify(with_next(error), good=False)
            return False
        except (KeyError, TypeError, ValueError, IndexError) as error:
            notify(
                f"{path.name}: is not a diagnosis of this version ({error}): diagnose its set again",
                good=False,
            )
            return False
        return True

    def _take(self, explanation: str) -> None:
        assert self.verdict is not None
        self.explanation = explanation
        found, self.diagnosed_sliders = diagnosed_model(self.verdict, int(explanation))
        self.choice = ModelChoice("found", self.choice.paper, found.numbers, found.effects, found.source)

    def use_explanation(self, number: str) -> None:
        """Use one of several explanations."""
        self._take(number)
        self._keep(model="found", explanation=number)
        self.address.write(values="")
        self.show()

    def set_kind(self, kind: str) -> None:
        """Select the kind of error model."""
        if kind == self.choice.kind:
            return
        self.choice = replace(self.choice, kind=_KINDS[kind])
        self._keep(model=kind)
        self.show()

    def adjust(self, slider: Slider, event: events.GenericEventArguments) -> None:
        """A slider was moved."""
        if isinstance(event.args, int | float):
            self.choice = self.choice.with_value(slider.key, float(event.args))
            self._keep(values=self._values())
            self.stage.draw()

    def _values(self) -> str:
        """The sliders that were moved, as a text of the address."""
        sliders = (
            paper_sliders(ModelChoice().paper) if self.choice.kind == "paper" else self.diagnosed_sliders
        )
        pairs = [(slider, _value(self.choice, slider)) for slider in sliders]
        return ",".join(f"{slider.key}~{value:.6g}" for slider, value in pairs if value != slider.value)

    def reset(self) -> None:
        """Restore the published or diagnosed values."""
        if self.choice.kind == "paper":
            self.choice = replace(self.choice, paper=ModelChoice().paper)
        elif self.verdict is not None:
            self._take(self.explanation)
        self._keep(values="")
        self.show()

    def save(self) -> None:
        """Save it as the robot's model, which Compare and later sessions use."""
        run = self.stage.run
        baseline = None if run is None else baseline_of(run)
        self.session.model = self.choice
        try:
            path = save_model(self.choice, baseline, self.session.model_file)
        except (TruingError, OSError) as error:
            notify(with_next(error), good=False)
            return
        self.saved._text = f"saved: {path}"
        self.saved.update()

    # ---- display

    def show(self) -> None:
        """Show the sliders of the selected model, and redraw."""
        kind = self.choice.kind
        self.about._text = _ABOUT[kind]
        self.about.update()
        self.diagnosis_box.set_visibility(kind == "found")
        self.slider_box.clear()
        shown = {"none": [], "paper": paper_sliders(self.choice.paper), "found": self.diagnosed_sliders}[kind]
        with self.slider_box:
            for slider in shown:
                element = ParameterSlider(slider, _value(self.choice, slider))
                element.on("adjust", partial(self.adjust, slider))
        self.stage.draw()

    def drawn(self, found: dict[str, Any]) -> None:
        """Show the speed error of the simulation with the present values."""
        parts = [
            f"{text} {1e3 * found['rms'][name]:.1f} mm/s"
            for name, text in (("simulated", "speed error simulated"), ("modelled", "with the model"))
            if found["rms"].get(name) is not None
        ]
        self.error._text = ", ".join(parts)
        self.error.update()

    def _sliders_of_choice(self) -> list[Slider]:
        """Sliders for a saved model without its diagnosis: no intervals."""
        sliders = []
        for name, table in self.choice.effects.items():
            for key, value in table.items():
                around = max(abs(value), 1e-3)
                title = f"{name.replace('_', ' ')}: {key.replace('_', ' ')}"
                sliders.append(
                    Slider(
                        f"effect.{name}.{key}",
                        title,
                        "",
                        value,
                        min(0.0, value - around),
                        value + around,
                        None,
                    )
                )
        return sliders


def _value(choice: ModelChoice, slider: Slider) -> float:
    what, _, name = slider.key.partition(".")
    if what == "paper":
        return float(getattr(choice.paper, name))
    if what == "number":
        return choice.numbers.get(name, slider.value)
    effect, _, parameter = name.partition(".")
    return choice.effects.get(effect, {}).get(parameter, slider.value)
