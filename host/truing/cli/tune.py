"""`truing tune`: learns the feedforward of velocity mode from a short drive."""

from __future__ import annotations

from pathlib import Path

import click

from truing.cli.app import App
from truing.cli.options import board_options


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
    from truing.cli.driving import drive_on, warn_and_ask
    from truing.identify.feedforward import learn, learning_plan, proof_plan, tracking

    with app.open_device(lasting=False) as device:
        parameters = device.parameters()
        for plan in (proof_plan(), learning_plan()):
            warn_and_ask(app, device, parameters, plan, ask=not yes)
        values = {name: parameter.value for name, parameter in parameters.items()}
        first = drive_on(app, device, parameters, proof_plan(), folder, "tune_before")
        before = tracking(first.run, values)
        learned = learn(drive_on(app, device, parameters, learning_plan(), folder, "tune_learning").run)
        old = {name: values[name] for name in learned}
        device.set_parameters(learned)
        try:
            again = drive_on(app, device, device.parameters(), proof_plan(), folder, "tune_after")
            after = tracking(again.run, values)
        except BaseException:
            device.set_parameters(old)
            raise
        better = after.both_mps < before.both_mps
        if not better:
            device.set_parameters(old)
        elif save:
            device.save_parameters()

    app.emit(
        {
            "parameters": {name: {"before": values[name], "after": value} for name, value in learned.items()},
            "tracking_mps": {
                "before": {"left": before.left_mps, "right": before.right_mps, "both": before.both_mps},
                "after": {"left": after.left_mps, "right": after.right_mps, "both": after.both_mps},
            },
            "kept": better,
            "saved": better and save,
        }
    )
    table = Table("parameter", "before", "learned")
    for name, value in learned.items():
        table.add_row(name, format_f32(values[name]), f"{value:.4g}")
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
