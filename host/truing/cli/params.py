"""`truing params`: the board's parameters."""

from __future__ import annotations

import click

from truing.cli.app import App
from truing.cli.options import board_options


@click.group(no_args_is_help=True)
def command() -> None:
    """List, get and set the board's parameters.

    \b
    Examples:
      truing params list
      truing params get wheelbase_m
      truing params set wheelbase_m 0.290
    """


@command.command("list")
@board_options
def list_(app: App) -> None:
    """List every parameter with value, limits, default and meaning.

    \b
    Example:
      truing --port /dev/ttyUSB0 params list
    """
    from rich.table import Table

    from truing.board_state import format_f32

    with app.open_device() as device:
        parameters = device.parameters()
    app.emit({name: float(parameter.text) for name, parameter in parameters.items()})
    table = Table("parameter", "value", "unit", "limits", "default", "meaning")
    for name, parameter in parameters.items():
        info = parameter.info
        default = format_f32(info.default)
        changed = "[bold]" if parameter.text != default else ""
        limits = f"{format_f32(info.minimum)} to {format_f32(info.maximum)}"
        table.add_row(name, changed + parameter.text, info.unit, limits, default, info.doc)
    app.show(table)


@command.command()
@click.argument("names", nargs=-1, required=True, metavar="NAME...")
@board_options
def get(app: App, names: tuple[str, ...]) -> None:
    """Print the value of one or more parameters.

    \b
    Example:
      truing params get wheel_radius_m wheelbase_m
    """
    with app.open_device() as device:
        found = [device.get_parameter(name) for name in names]
    app.emit({parameter.info.name: float(parameter.text) for parameter in found})
    for parameter in found:
        app.say(f"{parameter.info.name} = {parameter.text} {parameter.info.unit}".rstrip())


@command.command("set", context_settings={"ignore_unknown_options": True})
@click.argument("name")
@click.argument("value", type=float)
@board_options
def set_(app: App, name: str, value: float) -> None:
    """Change one parameter; it holds until the board is switched off.

    \b
    Example:
      truing --port /dev/ttyUSB0 params set wheelbase_m 0.290
    """
    with app.open_device() as device:
        before = device.get_parameter(name)
        after = device.set_parameter(name, value)
    app.emit({"name": name, "before": float(before.text), "value": float(after.text)})
    app.say(f"{name} = {after.text} {after.info.unit}".rstrip() + f" (was {before.text})")
