"""Error models: none, the paper's, or what a diagnosis found; the overlay follows every number's slider."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from nicegui import events

from truing.errors import TruingError
from truing.web.dropped_files import ADDRESS
from truing.web.elements import Choice, DropZone, KnobSlider, Pick, button, heading, say, tag
from truing.web.error_model import (
    KINDS,
    Kind,
    Knob,
    ModelChoice,
    explanations,
    found_choice,
    paper_knobs,
    read_verdict,
    save_model,
)
from truing.web.pages.run_stage import RunStage
from truing.web.run_library import baseline_of
from truing.web.session import ViewSession

_NO_DIAGNOSES = {"": "none yet: Analysis starts one"}
_KINDS: dict[str, Kind] = {str(kind): kind for kind in KINDS}
_TEXTS = {str(kind): text for kind, text in KINDS.items()}
_ABOUT = {
    "none": "The simulated robot goes exactly where its wheels go.",
    "paper": "The MOM paper's constants: they bend the commanded motion. Its text prints them; the bar goes "
    "from there to what the end points of its Table 2 imply.",
    "found": "What a diagnosis found acts on the wheels and the ground, under the efforts that were applied. "
    "The bar is each number's 95 % interval.",
}


def build(session: ViewSession) -> None:
    """The page."""
    _ModelsPage(session).build()


class _ModelsPage:
    """A model being tried; it is the robot's once it has been saved."""

    def __init__(self, session: ViewSession) -> None:
        self.session = session
        self.choice = session.model
        self.found_knobs: list[Knob] = []
        self.verdict: dict[str, Any] | None = None
        self.stage = RunStage(session, lambda: self.choice, self.drawn)

    def build(self) -> None:
        """Make the elements."""
        with tag("div", classes="view broad"):
            self.stage.picture("Overlay")
            with tag("section", classes="side", aria_label="Error model"):
                with tag("div"):
                    heading("Run")
                    self.stage.choice()
                with tag("div"):
                    heading("Error model")
                    Choice("Error model", _TEXTS, self.choice.kind, self.set_kind)
                    self.about = tag("p", classes="dim told", style="margin:6px 0 0")
                    self.found_box = tag("div", classes="picks", style="margin-top:6px")
                self.knobs = tag("div", classes="knobs")
                with tag("div"):
                    with tag("p", classes="told", role="status", style="margin:0"):
                        self.error = tag("span", "", "num")
                    with tag("div", classes="row-tight", style="margin-top:6px"):
                        button("Save as the robot's model", self.save, strong=True)
                        button("Back to its values", self.back)
                    self.saved = tag("p", classes="told dim", role="status", style="margin:4px 0 0")
                with tag("div"):
                    self.stage.table()
        self.fill_found()
        if self.choice.kind == "found" and self.choice.effects:
            self.found_knobs = self._knobs_of_choice()
        self.show()

    def fill_found(self, chosen: Path | None = None) -> None:
        """The diagnoses on disk."""
        files = sorted(self.session.diagnosis_folder.glob("*.json"), key=lambda p: -p.stat().st_mtime)
        self.found_box.clear()
        with self.found_box:
            options = {str(path): path.stem for path in files} or _NO_DIAGNOSES
            value = str(chosen) if chosen is not None else ""
            if value not in options and files:
                options = {"": "choose one"} | options
            self.diagnoses = Pick("Diagnosis", options, value, lambda path: self.take(Path(path)))
            if self.verdict is not None and len(explanations(self.verdict)) > 1:
                entries = {str(number): text for number, text in explanations(self.verdict)}
                Pick("Explanation", entries, self.explanation, self.take_explanation)
            zone = DropZone("Drop a diagnosis (JSON) here, or choose one", ".json", ADDRESS)
            zone.on("dropped", self.dropped)

    def dropped(self, event: events.GenericEventArguments) -> None:
        """A diagnosis came."""
        for one in event.args if isinstance(event.args, list) else []:
            if one.get("kind") == "diagnosis":
                self.take(Path(str(one["path"])))
            else:
                say(str(one.get("error", "this is no diagnosis")), good=False)

    def take(self, path: Path) -> None:
        """Put a diagnosis' findings into force."""
        if not path.name:
            return
        try:
            self.verdict = read_verdict(path)
            self.explanation = str(explanations(self.verdict)[0][0])
            self.take_explanation(self.explanation)
        except TruingError as error:
            say(str(error), good=False)
            return
        except (KeyError, TypeError, ValueError) as error:
            say(f"{path.name}: is no diagnosis of this version ({error})", good=False)
            return
        self.fill_found(path)

    def take_explanation(self, number: str) -> None:
        """One of several explanations."""
        assert self.verdict is not None
        self.explanation = number
        found, self.found_knobs = found_choice(self.verdict, int(number))
        self.choice = ModelChoice("found", self.choice.paper, found.numbers, found.effects, found.source)
        self.show()

    def set_kind(self, kind: str) -> None:
        """None, the paper's, or found."""
        if kind == self.choice.kind:
            return
        self.choice = ModelChoice(
            _KINDS[kind], self.choice.paper, self.choice.numbers, self.choice.effects, self.choice.source
        )
        self.show()

    def turn(self, knob: Knob, event: events.GenericEventArguments) -> None:
        """A slider moved."""
        if isinstance(event.args, int | float):
            self.choice = self.choice.turned(knob.key, float(event.args))
            self.stage.draw()

    def back(self) -> None:
        """Every number as it was printed or found."""
        if self.choice.kind == "paper":
            self.choice = ModelChoice(
                "paper", ModelChoice().paper, self.choice.numbers, self.choice.effects, self.choice.source
            )
        elif self.verdict is not None:
            self.take_explanation(self.explanation)
        self.show()

    def save(self) -> None:
        """Make it the robot's model: Compare and the next view use it."""
        run = self.stage.run
        baseline = None if run is None else baseline_of(run)
        self.session.model = self.choice
        try:
            path = save_model(self.choice, baseline, self.session.model_file)
        except (TruingError, OSError) as error:
            say(str(error), good=False)
            return
        self.saved._text = f"saved: {path}"
        self.saved.update()

    # ---- what is shown

    def show(self) -> None:
        """Sliders of the model that is chosen, and the overlay."""
        kind = self.choice.kind
        self.about._text = _ABOUT[kind]
        self.about.update()
        self.found_box.set_visibility(kind == "found")
        self.knobs.clear()
        shown = {"none": [], "paper": paper_knobs(self.choice.paper), "found": self.found_knobs}[kind]
        with self.knobs:
            for knob in shown:
                slider = KnobSlider(knob, _value(self.choice, knob))
                slider.on("turn", partial(self.turn, knob))
        self.stage.draw()

    def drawn(self, found: dict[str, Any]) -> None:
        """How far off the simulation is with the numbers as they stand."""
        parts = [
            f"{text} {1e3 * found['rms'][name]:.1f} mm/s"
            for name, text in (("simulated", "speed error simulated"), ("modelled", "with the model"))
            if found["rms"][name] is not None
        ]
        self.error._text = ", ".join(parts)
        self.error.update()

    def _knobs_of_choice(self) -> list[Knob]:
        """Sliders for a saved model whose diagnosis is not at hand: no intervals."""
        knobs = []
        for name, table in self.choice.effects.items():
            for key, value in table.items():
                around = max(abs(value), 1e-3)
                title = f"{name.replace('_', ' ')}: {key.replace('_', ' ')}"
                knobs.append(
                    Knob(
                        f"effect.{name}.{key}",
                        title,
                        "",
                        value,
                        min(0.0, value - around),
                        value + around,
                        None,
                    )
                )
        return knobs


def _value(choice: ModelChoice, knob: Knob) -> float:
    what, _, name = knob.key.partition(".")
    if what == "paper":
        return float(getattr(choice.paper, name))
    if what == "number":
        return choice.numbers.get(name, knob.value)
    effect, _, parameter = name.partition(".")
    return choice.effects.get(effect, {}).get(parameter, knob.value)
