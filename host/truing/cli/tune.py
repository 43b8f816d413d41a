"""`truing tune`: learns the feedforward of velocity mode from a short drive."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.cli.options import board_options

if TYPE_CHECKING:
    from truing.board.device import Device
    from truing.identify.feedforward import Tracking
    from truing.plan import Plan
    from truing.recording.run import Run


@click.command()
@click.option(
    "--set",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    help="Recording set to add the runs to.  [default: out/recordings/BOARD]",
)
@click.option("--save", is_flag=True, help="Let the board keep the new parameters beyond its next start.")
@click.option("--yes", is_flag=True, help="Do not ask before a real robot moves.")
@board_options
def command(app: App, folder: Path | None, save: bool, yes: bool) -> None:
    """Learn what each wheel needs per speed, acceleration and direction, and show what it brings.

    Three short drives: steps of speed as the board is now, steps of effort to learn from, and the steps of
    speed again. The twelve parameters ff_k... are changed only if the wheels then follow more closely.
    Before anything moves, truing says how much floor it needs.

    \b
    Examples:
      truing tune --robot my_robot.toml
      truing --port /dev/ttyUSB0 tune --save
    """
    from rich.table import Table

    from truing.board.state import format_f32
    from truing.board.tuning import tune
    from truing.cli.driving import warn_and_ask
    from truing.identify.feedforward import learning_plan, proof_plan

    with app.open_device(lasting=False) as device:
        parameters = device.parameters()
        for plan in (proof_plan(), learning_plan()):
            warn_and_ask(app, device, parameters, plan, ask=not yes)
        values = {name: parameter.value for name, parameter in parameters.items()}
        result = tune(_Robot(app, device, folder), values, proof_plan(), learning_plan())
        if result.is_better and save:
            device.save_parameters()

    before, after, better = result.before, result.after, result.is_better
    app.emit(
        {
            "parameters": {
                name: {"before": old, "after": learned} for name, (old, learned) in result.parameters.items()
            },
            "tracking_mps": {
                "before": {"left": before.left_mps, "right": before.right_mps, "both": before.both_mps},
                "after": {"left": after.left_mps, "right": after.right_mps, "both": after.both_mps},
            },
            "kept": better,
            "saved": better and save,
        }
    )
    table = Table("parameter", "before", "learned")
    for name, (old, learned) in result.parameters.items():
        table.add_row(name, format_f32(old), f"{learned:.4g}")
    app.show(table)
    for side, was, now in (
        ("left", before.left_mps, after.left_mps),
        ("right", before.right_mps, after.right_mps),
        ("both", before.both_mps, after.both_mps),
    ):
        app.say(f"tracking error, {side}: {1e3 * was:.1f} mm/s before, {1e3 * now:.1f} mm/s after")
    if not better:
        app.say("the wheels did not follow more closely: the board has its old parameters again")
    elif save:
        app.say("saved: the board keeps them")
    else:
        app.say("the board holds them until it is switched off\n  next: truing params save")


class _Robot:
    """The robot as a command drives it."""

    def __init__(self, app: App, device: Device, folder: Path | None) -> None:
        self._app = app
        self._device = device
        self._folder = folder

    def drive(self, plan: Plan, label: str) -> Run:
        """Drive a plan, and return its run."""
        from truing.cli.driving import drive_on

        return drive_on(self._app, self._device, self._device.parameters(), plan, self._folder, label).run

    def learn(self, run: Run) -> dict[str, float]:
        """Return the feedforward parameters that a run shows."""
        from truing.identify.feedforward import learn

        return learn(run)

    def tracking(self, run: Run, parameters: Mapping[str, float]) -> Tracking:
        """Return the tracking error of a run."""
        from truing.identify.feedforward import tracking

        return tracking(run, parameters)

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Put values into force."""
        self._device.set_parameters(values)

    def restore_parameters(self, values: Mapping[str, float]) -> None:
        """Put the old values into force again; another Ctrl-C does not get in between."""
        from truing.board.drive import Interrupts

        with Interrupts().caught(), self._device.client.uninterrupted():
            self._device.set_parameters(values)
