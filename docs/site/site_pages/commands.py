"""One page for each command of `truing`, from the help that click prints."""

from __future__ import annotations

import inspect
import textwrap

import click

from site_pages.markdown import block, code, escaped, page, table
from truing.cli import COMMANDS, GROUPS, group

FOLDER = "reference/commands"
_NO_REWRAPPING = "\b\n"


def pages() -> dict[str, str]:
    """The overview, and a page for every command."""
    context = click.Context(group, info_name="truing", **group.context_settings)
    made = {f"{FOLDER}/index.md": _overview(context)}
    for name in COMMANDS:
        command = group.get_command(context, name)
        assert command is not None
        made[f"{FOLDER}/{name}.md"] = page(f"# truing {name}", *_parts(command, name, context, "##"))
    return made


def navigation() -> list[object]:
    """The commands by group, as `truing --help` has them."""
    return [
        f"{FOLDER}/index.md",
        *({title: [f"{FOLDER}/{name}.md" for name in names]} for title, names in GROUPS.items()),
    ]


def _overview(context: click.Context) -> str:
    groups = [
        page(
            f"## {title}",
            table(
                ("command", "what it does"),
                [(f"[`truing {name}`]({name}.md)", escaped(line)) for name, line in lines.items()],
            ),
        )
        for title, lines in GROUPS.items()
    ]
    return page(
        "# Commands",
        "From `truing --help` and the help of each command, which print the same.",
        *_help(group),
        "## Options of every command",
        "They stand before the command's name: `truing --port /dev/ttyUSB0 info`.",
        _options(group, context, with_help=True),
        *groups,
    )


def _parts(command: click.Command, name: str, above: click.Context, level: str) -> list[str]:
    """Usage, help and options of a command, then the same of its subcommands."""
    context = click.Context(command, info_name=name, parent=above)
    usage = command.get_usage(context).removeprefix("Usage: ")
    parts = [block(" ".join(usage.split()), "console"), *_help(command)]
    options = _options(command, context)
    if options:
        parts += [f"{level} Options", options]
    if isinstance(command, click.Group):
        for sub in command.list_commands(context):
            found = command.get_command(context, sub)
            assert found is not None
            parts += [f"## truing {name} {sub}", *_parts(found, sub, context, "###")]
    return parts


def _help(command: click.Command) -> list[str]:
    """The paragraphs of a command's help; those that click leaves as they stand become code."""
    parts = []
    for paragraph in inspect.cleandoc(command.help or "").split("\n\n"):
        if not paragraph.startswith(_NO_REWRAPPING):
            parts.append(escaped(paragraph))
            continue
        lines = paragraph.removeprefix(_NO_REWRAPPING).split("\n")
        if lines[0].endswith(":") and not lines[0].startswith(" "):
            parts.append(escaped(lines.pop(0)))
        parts.append(block(textwrap.dedent("\n".join(lines))))
    return parts


def _options(command: click.Command, context: click.Context, *, with_help: bool = False) -> str:
    """The table of a command's options; every command has --help, which the overview alone lists."""
    given = command.get_params(context) if with_help else command.params
    records = [one.get_help_record(context) for one in given if isinstance(one, click.Option)]
    rows = [(code(names), escaped(text) or "–") for names, text in filter(None, records)]
    return table(("option", "meaning"), rows) if rows else ""
