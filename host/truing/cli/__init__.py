"""The `truing` command: one module of this package for each subcommand.

A subcommand `name` lives in `truing/cli/name.py` (`name_.py` where Python keeps the word for itself)
as the click command `command`; modules are imported only when their command runs, so that
`truing --help` answers at once.
"""

from __future__ import annotations

import importlib
import keyword
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import click

from truing import __version__
from truing.cli.plain_console import let_every_sign_be_written
from truing.errors import TruingError

# What each group of commands is for, their names, and the line that `truing --help` shows.
GROUPS: dict[str, dict[str, str]] = {
    "Drive a board": {
        "view": "See and drive the robot in the browser.",
        "board": "Start a virtual board for other programs to connect to.",
        "ports": "List where a board may be.",
        "flash": "Write the firmware image to a board, and verify it.",
        "info": "Say who the board is and how it is.",
        "check": "First power-up: find wires and settings that are wrong.",
        "plan": "List, show and check run plans.",
        "run": "Drive a plan, fetch its log, write it as a run.",
        "step": "Drive one quick step and identify it.",
        "stop": "Brake both wheels now.",
        "faults": "Show the board's faults, or clear them.",
        "params": "List, change, save and compare the board's parameters.",
        "tune": "Learn the feedforward of velocity mode from a short drive.",
    },
    "Record": {
        "log": "List, fetch, arm and erase the board's logs.",
        "stream": "Signals of the board as they happen, up to 200 a second.",
        "clock": "Relate the board's clock to this computer's: offset and drift.",
        "import": "Turn recordings of other programs into a set of runs.",
        "plot": "Draw recordings.",
    },
    "Model": {
        "identify": "Gains and time constants of recordings.",
        "fit": "Models of both wheels, judged on runs they never saw.",
        "export": "Write a model for a simulator or a controller.",
    },
    "Diagnose": {
        "diagnose": "Where a simulation is wrong, and which physics it leaves out.",
        "fleet": "Many robots over years: who differs, what drifts and since when.",
    },
    "Prove": {
        "demo": "The whole chain once; then a concealed effect, found and modelled.",
        "trial": "Conceal an effect in a simulated robot, diagnose it, see whether it was found.",
        "real": "Diagnose recordings of real robots, and what that does to the error on unseen runs.",
        "paper": "Drive the paper's tests I to XVII, print Tables III and IV beside it.",
    },
}
COMMANDS: dict[str, str] = {name: line for lines in GROUPS.values() for name, line in lines.items()}

EXIT_INTERRUPTED = 130


class _LazyGroup(click.Group):
    """A group that imports a subcommand's module when that command is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 (click's signature)
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:  # noqa: ARG002
        if name not in COMMANDS:
            return None
        module = f"{name}_" if keyword.iskeyword(name) else name
        loaded = importlib.import_module(f"truing.cli.{module}").command
        assert isinstance(loaded, click.Command)
        return loaded

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        for title, commands in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl(list(commands.items()))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            import difflib

            close = difflib.get_close_matches(name, COMMANDS, n=1)
            hint = f" Did you mean '{close[0]}'?" if close else ""
            ctx.fail(f"No such command '{name}'.{hint}")
        return super().resolve_command(ctx, args)


@click.command(
    cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110}
)
@click.option(
    "--port",
    metavar="PORT",
    envvar="TRUING_PORT",
    default="sim",
    show_default=True,
    help="Where the board is: sim (a virtual board inside this command), auto (the one serial port found), "
    "/dev/ttyUSB0, or tcp:HOST:PORT. Environment: TRUING_PORT.",
)
@click.option("--json", "as_json", is_flag=True, help="Print results as JSON on standard output.")
@click.option(
    "-v", "--verbose", count=True, help="Log what happens to standard error; -vv logs every request."
)
@click.version_option(__version__, prog_name="truing")
@click.pass_context
def group(ctx: click.Context, port: str, as_json: bool, verbose: int) -> None:
    """Run a two-wheel robot, fetch its recordings, and find what its simulation leaves out.

    \b
    Examples:
      truing demo                          the whole chain on a virtual board
      truing diagnose my_robot             what the simulation of my_robot/baseline.toml leaves out
      truing run paper/XI                  the paper's test XI on a virtual board
      truing --port /dev/ttyUSB0 info      who is on that port
    """
    from truing.cli.app import App

    ctx.obj = App(port=port, as_json=as_json, verbose=verbose)


@contextmanager
def ended_like_ctrl_c() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the block as Ctrl-C does, so that what has to be undone is undone.

    By default they end Python where it stands: motors keep their last effort until the board's own time-out,
    a link to a pseudo-terminal stays behind. A signal that the caller ignores (nohup) stays ignored.
    """
    changed = []
    if threading.current_thread() is threading.main_thread():  # Python lets no other thread do it
        # Windows has no SIGHUP.
        for number in (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, signal.default_int_handler)
                changed.append(number)
    try:
        yield
    finally:
        for number in changed:
            signal.signal(number, signal.SIG_DFL)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 board or link failed, 2 bad input, 130 interrupted."""
    let_every_sign_be_written()
    try:
        with ended_like_ctrl_c():
            code = group.main(args=arguments, prog_name="truing", standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except click.exceptions.Abort:
        click.echo("interrupted", err=True)
        sys.exit(EXIT_INTERRUPTED)
    except KeyboardInterrupt:
        click.echo("interrupted", err=True)
        sys.exit(EXIT_INTERRUPTED)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except TruingError as error:
        click.echo(f"truing: {error.message}", err=True)
        if error.next_step:
            click.echo(f"  next: {error.next_step}", err=True)
        sys.exit(error.exit_code)
    except BrokenPipeError:
        # The reader of our output (head, less) has gone: not an error.
        sys.stderr.close()
        sys.exit(0)
