"""`truing params`: the board's parameters."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.cli.options import board_options

if TYPE_CHECKING:
    from truing.board.device import Device
    from truing.board.state import Parameter, ParameterStore

_in_file = click.option(
    "--file", "file", type=click.Path(path_type=Path), help="A TOML file in place of the board's own store."
)


@click.group(no_args_is_help=True)
def command() -> None:
    """List, change, save and compare the board's parameters.

    A change is in force at once and holds until the board is switched off; `save` stores it.

    \b
    Examples:
      truing params list
      truing params set wheelbase_m 0.290
      truing params save                      the board keeps what is in force
      truing params save --file mine.toml     so does this file
      truing params diff                      what a restart would change
    """


@command.command("list")
@board_options
def list_(app: App) -> None:
    """List every parameter: value in force, stored value, default, limits, meaning.

    A star marks a value that the next start would not take.

    \b
    Examples:
      truing --port /dev/ttyUSB0 params list
      truing params list --json
    """
    from rich.table import Table

    from truing.board.state import format_f32

    with app.open_device() as device:
        parameters, store = device.parameters(), device.parameter_store()
    app.emit({name: parameter.to_dict() for name, parameter in parameters.items()})
    table = Table("parameter", "value", "stored", "default", "unit", "limits", "meaning")
    for name, parameter in parameters.items():
        info = parameter.info
        default = format_f32(info.default)
        style = "[bold]" if parameter.text != default else ""
        star = "" if parameter.is_kept else " *"
        stored = "" if parameter.stored is None else format_f32(parameter.stored)
        limits = f"{format_f32(info.minimum)} to {format_f32(info.maximum)}"
        table.add_row(name, style + parameter.text + star, stored, default, info.unit, limits, info.doc)
    app.show(table)
    app.say(_store_line(store))
    if not all(parameter.is_kept for parameter in parameters.values()):
        app.say("* not stored: `truing params save` keeps it, `truing params load` gives it up")


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
    """Change one parameter; it holds until the board is switched off, or is stored by `params save`.

    \b
    Example:
      truing --port /dev/ttyUSB0 params set wheelbase_m 0.290
    """
    with app.open_device() as device:
        before = device.get_parameter(name)
        after = device.set_parameter(name, value)
    app.emit({"name": name, "before": float(before.text), "value": float(after.text)})
    app.say(f"{name} = {after.text} {after.info.unit}".rstrip() + f" (was {before.text})")


@command.command()
@_in_file
@board_options
def save(app: App, file: Path | None) -> None:
    """Store the values in force on the board, or copy them into a file.

    The board keeps two sets and replaces the older one, so that losing power meanwhile leaves the
    old set or the new one. It brakes and stands still for up to a second, and refuses while it moves.

    \b
    Examples:
      truing --port /dev/ttyUSB0 params save
      truing --port /dev/ttyUSB0 params save --file mine.toml
    """
    with app.open_device() as device:
        if file is not None:
            _save_file(app, device, file)
            return
        saved = device.save_parameters()
    app.emit({"sequence": saved.sequence, "written": saved.written, "stall_s": saved.stall_s})
    if saved.written:
        app.say(f"saved as set {saved.sequence}; the board stood still for {saved.stall_s:.2f} s")
    else:
        app.say(f"nothing to save: set {saved.sequence} holds these very values")


def _save_file(app: App, device: Device, file: Path) -> None:
    from truing.board.parameter_file import write_parameter_file

    parameters = device.parameters()
    origin = f"Parameters of board {device.info.board_id}, firmware {device.info.firmware_version}."
    write_parameter_file(file, parameters, origin)
    app.emit({"file": str(file), "values": {name: float(p.text) for name, p in parameters.items()}})
    app.say(f"{file}: {len(parameters)} parameters")


@command.command()
@_in_file
@board_options
def load(app: App, file: Path | None) -> None:
    """Put the stored values into force, or those of a file.

    Without --file this undoes every change since the last save. A file may name some parameters
    only; all are checked before the first is changed. `params save` then stores them.

    \b
    Examples:
      truing --port /dev/ttyUSB0 params load
      truing --port /dev/ttyUSB0 params load --file mine.toml
    """
    from truing.board.parameter_file import read_parameter_file, same_on_the_board

    wanted = None if file is None else read_parameter_file(file)
    with app.open_device() as device:
        before = device.parameters()
        if wanted is None:
            device.load_parameters()
        changes = (wanted or {}).items()
        device.set_parameters(
            {name: value for name, value in changes if not same_on_the_board(before[name].value, value)}
        )
        after = device.parameters()
        store = device.parameter_store()
    _show_changes(app, before, after)
    if wanted is None:
        app.say(_store_line(store))
    elif not all(parameter.is_kept for parameter in after.values()):
        app.say("not stored yet: `truing params save` keeps them")


@command.command()
@board_options
def defaults(app: App) -> None:
    """Put every default into force; what is stored stays until the next `params save`.

    \b
    Example:
      truing --port /dev/ttyUSB0 params defaults
    """
    with app.open_device() as device:
        before = device.parameters()
        device.default_parameters()
        after = device.parameters()
    _show_changes(app, before, after)


@command.command()
@_in_file
@board_options
def diff(app: App, file: Path | None) -> None:
    """Compare the values in force with the stored ones (what a restart would change), or with a file.

    \b
    Examples:
      truing --port /dev/ttyUSB0 params diff
      truing --port /dev/ttyUSB0 params diff --file mine.toml
    """
    from truing.board.parameter_file import read_parameter_file

    other = "stored" if file is None else "file"
    wanted = None if file is None else read_parameter_file(file)
    with app.open_device() as device:
        parameters = device.parameters()
    if wanted is None:
        wanted = {name: parameter.after_restart for name, parameter in parameters.items()}
    _show_pairs(app, {name: (parameters[name], value) for name, value in wanted.items()}, ("live", other))


def _show_changes(app: App, before: Mapping[str, Parameter], after: Mapping[str, Parameter]) -> None:
    _show_pairs(app, {name: (after[name], before[name].value) for name in after}, ("now", "before"))


def _show_pairs(app: App, pairs: Mapping[str, tuple[Parameter, float]], titles: tuple[str, str]) -> None:
    """Show a table of the parameters whose value differs from the number beside it."""
    from rich.table import Table

    from truing.board.parameter_file import same_on_the_board
    from truing.board.state import format_f32

    differ = {name: pair for name, pair in pairs.items() if not same_on_the_board(pair[0].value, pair[1])}
    app.emit(
        {
            name: {titles[0]: float(parameter.text), titles[1]: float(format_f32(value))}
            for name, (parameter, value) in differ.items()
        }
    )
    if not differ:
        app.say(f"no difference in {len(pairs)} parameters")
        return
    table = Table("parameter", *titles, "unit")
    for name, (parameter, value) in differ.items():
        table.add_row(name, parameter.text, format_f32(value), parameter.info.unit)
    app.show(table)


def _store_line(store: ParameterStore) -> str:
    """How the store is, in one line."""
    names = [state.name.lower() for state in store.slots]
    if not store.sequence:
        held = "holds no set"
    else:
        held = f"holds set {store.sequence} with {store.stored} of these parameters"
    more = [f"slots {names[0]} and {names[1]}"]
    if store.unknown:
        more.append(f"{store.unknown} values of parameters that this firmware does not have")
    if store.unfit:
        more.append(f"{store.unfit} values beyond this firmware's limits, defaults in their place")
    return f"the store {held} ({'; '.join(more)})"
