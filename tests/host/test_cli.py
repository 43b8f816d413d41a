"""The command line: quick, with an example everywhere, and a mistake gets one clear line."""

from __future__ import annotations

import json
import re
import resource
from pathlib import Path

import click
import pytest

from support.cli import truing
from truing.cli import COMMANDS, GROUPS, group


def with_subcommands(command: click.Command, name: str) -> list[tuple[str, click.Command]]:
    found = [(name, command)]
    if isinstance(command, click.Group):
        for child, inner in command.commands.items():
            found += with_subcommands(inner, f"{name} {child}")
    return found


def test_help_comes_at_once() -> None:
    """The processor's time, not the clock's: other tests run beside this one."""

    def spent_s() -> float:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    truing("--help")
    times = []
    for _ in range(3):
        before = spent_s()
        assert truing("--help").returncode == 0
        times.append(spent_s() - before)
    print(f"truing --help: {min(times):.3f} s")
    assert min(times) < 0.3


@pytest.mark.parametrize("name", COMMANDS)
def test_every_help_text_shows_an_example(name: str) -> None:
    command = group.get_command(click.Context(group), name)
    assert command is not None
    for path, inner in [("truing", group), *with_subcommands(command, f"truing {name}")]:
        assert inner.help is not None, path
        assert "Example" in inner.help, path
        assert "truing " in inner.help.split("Example", 1)[1], path


def test_every_command_stands_in_exactly_one_group_of_the_help() -> None:
    folder = Path(__file__).parents[2] / "host/truing/cli"
    modules = [path for path in folder.glob("*.py") if "\ndef command(" in path.read_text(encoding="utf-8")]
    grouped = [name for lines in GROUPS.values() for name in lines]
    assert sorted(grouped) == sorted(path.stem.rstrip("_") for path in modules)

    sections = re.findall(r"^(\w[\w ]*):\n((?:  .*\n?)+)", truing("--help").stdout, re.M)
    listed = {title: re.findall(r"^  (\w+) ", lines, re.M) for title, lines in sections if title != "Options"}
    assert listed == {title: list(lines) for title, lines in GROUPS.items()}


def test_every_subcommand_named_in_the_help_exists() -> None:
    said = truing("--help").stdout
    for name in COMMANDS:
        assert f"\n  {name} " in said
        assert truing(name, "--help").returncode == 0


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (["nonsense"], 2, "No such command"),
        (["infoo"], 2, "Did you mean 'info'?"),
        (["run", "papr/XI"], 2, "neither a plan that comes with truing nor a file"),
        (["run", "nowhere/plan.toml"], 2, "cannot be read"),
        (["plan", "show", "paper/XX"], 2, "did you mean"),
        (["step"], 2, "give either --effort or --velocity"),
        (["step", "--effort", "1.5"], 2, "1.5 is not in the range"),
        (["--port", "/dev/nowhere", "info"], 1, "there is no such port"),
        (["--port", "tcp:127.0.0.1:1", "info"], 1, "nobody answers there"),
        (["--port", "tcp:nonsense", "info"], 1, "not an address"),
        (["--port", "usb", "info"], 1, "not a kind of port"),
        (["--port", "/dev/null", "info"], 1, "cannot be opened as a serial port"),
        (["--port", "tcp:127.0.0.1:1", "info", "--seed", "3"], 2, "--seed is for a virtual board"),
        (["info", "--image", "/dev/zero/none"], 2, "does not exist"),
        (["board", "--tcp", "off"], 2, "nobody could connect"),
        (["board", "--tcp", "x:y"], 2, "neither [HOST:]PORT nor off"),
        (["board", "--speed", "fast"], 2, "neither a factor"),
        (["params", "set", "wheelbase_m", "wide"], 2, "not a valid float"),
        (["log", "fetch", "0"], 2, "not in the range"),
    ],
)
def test_a_mistake_gets_one_clear_line_and_its_exit_code(arguments: list[str], code: int, says: str) -> None:
    done = truing(*arguments)
    assert done.returncode == code
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


def test_without_an_image_the_virtual_board_says_how_to_build_it(tmp_path: Path) -> None:
    done = truing("info", TRUING_IMAGE=str(tmp_path / "none.elf"))
    assert done.returncode == 1
    assert "no firmware image" in done.stderr
    assert "./run setup" in done.stderr


def test_plans_are_listed_and_shown() -> None:
    listed = truing("plan", "list", "--json")
    assert len(json.loads(listed.stdout)) >= 18
    shown = json.loads(truing("plan", "show", "paper/XVII", "--json").stdout)
    assert len(shown["segment"]) == 8
    assert shown["floor"]["ahead_m"] > 3
    assert "floor:" in truing("plan", "show", "square").stdout


def test_a_plan_printed_as_toml_is_a_plan(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(truing("plan", "show", "paper/XI", "--toml").stdout)
    shown = json.loads(truing("plan", "show", str(mine), "--json").stdout)
    assert shown["segment"][1]["effort"] == [0.35, 0.35]


def test_the_port_may_come_from_the_environment() -> None:
    done = truing("info", TRUING_PORT="/dev/nowhere")
    assert "/dev/nowhere" in done.stderr
