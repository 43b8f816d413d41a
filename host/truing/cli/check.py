"""`truing check`: the guided first power-up."""

from __future__ import annotations

from dataclasses import asdict

import click

from truing.cli.app import App
from truing.cli.options import board_options
from truing.errors import TruingError


@click.command()
@click.option("--fix", "do_fix", is_flag=True, help="Set the parameters of reversed motors and encoders.")
@click.option("--yes", is_flag=True, help="Do not ask whether the wheels are off the ground.")
@board_options
def command(app: App, do_fix: bool, yes: bool) -> None:
    """Find swapped and reversed motors and encoders, dead encoders, and wrong counts per revolution.

    You turn each wheel once by hand; then each motor turns its wheel with 5 % effort, a little more until it
    moves, 24 % at most. On a virtual board the hand is simulated. Nothing is changed without --fix, and what
    --fix sets holds until the board is switched off (`truing params save` keeps it).

    \b
    Examples:
      truing --port /dev/ttyUSB0 check
      truing --port /dev/ttyUSB0 check --fix
    """
    from truing.board.wiring_check import Hand, Person, check_robot, fix

    with app.open_device() as device:
        robot = getattr(device.client.stream, "board", None)
        hand: Hand
        if robot is not None:
            hand = _VirtualHand(robot)
        elif app.asks:
            if not yes:
                click.confirm("The wheels will turn. Are they off the ground?", abort=True, err=True)
            hand = Person(lambda text: _wait_for_enter(text))
        else:
            raise TruingError(
                "`truing check` needs somebody who turns the wheels, and this is no terminal",
                "run it at a terminal, without --json",
            )
        result = check_robot(device, hand, app.note)
        fixed = fix(device, result) if do_fix else []
    app.emit({**asdict(result), "fixed": fixed})
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


def _wait_for_enter(text: str) -> None:
    click.prompt(text, default="", show_default=False, prompt_suffix=" ", err=True)


class _VirtualHand:
    """Turns the wheels of a virtual robot."""

    def __init__(self, robot: object) -> None:
        self._robot = robot

    def turn(self, side: int) -> None:
        """Turn a wheel by one turn."""
        self._robot.turn_by_hand(side)  # type: ignore[attr-defined]
