"""`truing check`: the guided first power-up."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from truing.cli.app import App
from truing.cli.options import board_options
from truing.errors import TruingError

if TYPE_CHECKING:
    from truing.board.bring_up_form import Form
    from truing.board.device import Device
    from truing.board.wiring_check import CheckResult, Hand


@click.command()
@click.option("--fix", "do_fix", is_flag=True, help="Set the parameters of reversed motors and encoders.")
@click.option("--yes", is_flag=True, help="Do not ask whether the wheels are off the ground.")
@click.option(
    "--log",
    "form_path",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Keep the form of the board's bring-up in this file: begin it, or go on with it.",
)
@board_options
def command(app: App, do_fix: bool, yes: bool, form_path: Path | None) -> None:
    """Find swapped and reversed motors and encoders, dead encoders, and wrong counts per revolution.

    You turn each wheel once by hand; then each motor turns its wheel with 5 % effort, a little more until it
    moves, 24 % at most. On a virtual board the hand is simulated. Nothing is changed without --fix, and what
    --fix sets holds until the board is switched off (`truing params save` keeps it).

    --log writes a form of the whole bring-up (docs/BRINGUP.md): what the board measures by itself is filled
    in, what a person reads off a meter or a scope is left empty. Fill it in with an editor and give the same
    file again: it goes on where it was, and names what is missing and what is not right. Where nobody can
    turn the wheels, or they are not off the ground, all but the wheels is measured.

    \b
    Examples:
      truing --port /dev/ttyUSB0 check
      truing --port /dev/ttyUSB0 check --fix
      truing --port /dev/ttyUSB0 check --log my_board.toml
    """
    from truing.board.bring_up_form import read_form
    from truing.board.wiring_check import check_robot, fix

    begun = read_form(form_path) if form_path is not None and form_path.exists() else None
    with app.open_device() as device:
        board = device.info.board_name
        app.note(f"board: {board}, firmware {device.info.firmware_version}, on {device.info.port}")
        if begun is not None:
            _check_same_board(device, begun, form_path)
        hand = _hand(app, device, yes, needed=form_path is None)
        result = check_robot(device, hand, app.note) if hand is not None else None
        fixed = fix(device, result) if do_fix and result is not None else []
        done = None if form_path is None else _fill(app, device, form_path, begun, result)
    seen = {} if result is None else asdict(result)
    app.emit({"board": board, **seen, "fixed": fixed, **({} if done is None else {"form": done})})
    if result is not None:
        _say_findings(app, result, fixed)
    if done is not None:
        _say_form(app, done)


def _say_findings(app: App, result: CheckResult, fixed: list[str]) -> None:
    if not result.findings:
        app.say("motors, encoders and counts per revolution are right")
    for finding in result.findings:
        app.say(f"{finding.name}: {finding.text}")
        if finding.parameter in fixed:
            app.say(f"  set: {finding.parameter} = {finding.value:.0f}")
        else:
            app.say(f"  change: {finding.change}")
    if fixed:
        app.say("next: run `truing check` again, then `truing params save`")


def _hand(app: App, device: Device, yes: bool, *, needed: bool) -> Hand | None:
    """Who turns the wheels; None: nobody, where that is allowed."""
    from truing.board.wiring_check import Person

    robot = getattr(device.client.stream, "board", None)
    if robot is not None:
        return _VirtualHand(robot)
    if app.asks:
        question = "The wheels will turn. Are they off the ground?"
        if yes or click.confirm(question, abort=needed, err=True):
            return Person(lambda text: _wait_for_enter(text))
        return None
    if needed:
        raise TruingError(
            "`truing check` needs somebody who turns the wheels, and this is no terminal",
            "run it at a terminal, without --json",
        )
    app.note("note: this is no terminal, nobody turns the wheels: the step `wiring` is left as it is")
    return None


def _check_same_board(device: Device, form: Form, path: Path | None) -> None:
    from truing.errors import FormError

    if form.board_id != device.info.board_id:
        raise FormError(
            path or "",
            f"is the form of board {form.board_id}, and this is board {device.info.board_id}",
            "give each board a file of its own",
        )


def _fill(
    app: App, device: Device, path: Path, begun: Form | None, result: CheckResult | None
) -> dict[str, object]:
    """Measure what the board can, and write the form; returns what is said of it."""
    from truing.board import bring_up
    from truing.board.bring_up_form import Form, write_form

    form = begun or Form(device.info.board_id)
    form.firmware_version = device.info.firmware_version
    with app.progress("measuring") as progress:
        form.take(bring_up.read_board(device, progress))
    if result is not None:
        form.take(bring_up.read_wiring(result))
    write_form(path, form)
    missing, wrong = bring_up.empty(form.values), bring_up.problems(form.values)
    total = sum(len(step.measurements) for step in bring_up.STEPS)
    return {"file": str(path), "filled": total - len(missing), "of": total, "empty": missing, "wrong": wrong}


def _say_form(app: App, done: dict[str, Any]) -> None:
    app.say(f"{done['file']}: {done['filled']} of {done['of']} fields are filled in")
    for name, problem in done["wrong"].items():
        app.say(f"  not right: {name}: {problem}")
    if done["empty"]:
        app.say(f"next: {done['empty'][0]} (docs/BRINGUP.md); then the same command again")
    elif not done["wrong"]:
        app.say("the bring-up is complete, and everything is right")


def _wait_for_enter(text: str) -> None:
    click.prompt(text, default="", show_default=False, prompt_suffix=" ", err=True)


class _VirtualHand:
    """Turns the wheels of a virtual robot."""

    def __init__(self, robot: object) -> None:
        self._robot = robot

    def turn(self, side: int) -> None:
        """Turn a wheel by one turn."""
        self._robot.turn_by_hand(side)  # type: ignore[attr-defined]
