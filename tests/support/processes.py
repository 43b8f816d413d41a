"""Child processes of tests, with signals as a person at a terminal would find them."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager


@contextmanager
def child(
    command: Sequence[str], *, ignoring: Sequence[signal.Signals] = ()
) -> Iterator[subprocess.Popen[str]]:
    """Run a child whose output is text in pipes, and that Ctrl-C ends; it does not outlive the block.

    A process that ignores SIGINT hands that on to its children: under `nohup`, in the background of a shell
    without job control and on many CI runners Ctrl-C would have no effect, and a test of it would never end.

    Parameters
    ----------
    ignoring : signals that the child ignores from its first moment; the others have their default effect.
    """

    def set_dispositions() -> None:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN if number in ignoring else signal.SIG_DFL)

    # NiceGUI looks for pytest in the environment and then serves elsewhere.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    with subprocess.Popen(
        command,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=set_dispositions,
    ) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()


def wait_until_it_says(process: subprocess.Popen[str], word: str) -> str:
    """Read a child's notes until one holds the word; returns that line."""
    assert process.stderr is not None
    for line in process.stderr:
        if word in line:
            return line
    raise AssertionError(f"the child has ended and never said {word!r}")
