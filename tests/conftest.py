"""What every test may ask for: image, native library, real recordings; and the summary of a full run."""

from __future__ import annotations

import fcntl
import os
import sys
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parent.parent
IMAGE = ROOT / "build/stm32f405/firmware/truing-f405.elf"
USB_IMAGE = ROOT / "build/stm32f405-usb/firmware/truing-f405-usb.elf"
G474_IMAGE = ROOT / "build/stm32g474/firmware/truing-g474.elf"
NATIVE_LIBRARY = ROOT / "build/host/hil_sim/libhil_sim.so"

# A bare `pytest` keeps its caches inside the repository too, as `./run test` does.
for _variable, _folder in {
    "MPLCONFIGDIR": "matplotlib",
    "NUMBA_CACHE_DIR": "numba",
    "HYPOTHESIS_STORAGE_DIRECTORY": "hypothesis",
    "XDG_CACHE_HOME": "",
}.items():
    os.environ.setdefault(_variable, str(ROOT / ".cache" / _folder))
os.environ.setdefault("MPLBACKEND", "agg")
# As the commands do: the tests are run side by side, and a second thread of the library takes another's time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# How long an example takes says something about the machine that the tests share, not about the code.
settings.register_profile("busy-machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy-machine")


def _built(path: Path) -> Path:
    if not path.is_file():
        pytest.fail(f"{path.relative_to(ROOT)} is not built; run ./run setup", pytrace=False)
    return path


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository's root."""
    return ROOT


@pytest.fixture(scope="session")
def image() -> Path:
    """The image that is flashed."""
    return _built(IMAGE)


@pytest.fixture(scope="session")
def usb_image() -> Path:
    """The image for the board whose USB pins are free."""
    return _built(USB_IMAGE)


@pytest.fixture(scope="session")
def g474_image() -> Path:
    """The image for the NUCLEO-G474RE, which runs on no emulator."""
    return _built(G474_IMAGE)


@pytest.fixture(scope="session", params=["pwm-dir", "phase-enable"])
def other_driver_image(request: pytest.FixtureRequest) -> Path:
    """The first board's image for motor drivers of each other kind."""
    name = f"stm32f405-{request.param}"
    return _built(ROOT / "build" / name / "firmware" / f"truing-f405-{request.param.split('-')[0]}.elf")


@pytest.fixture(scope="session")
def native_library() -> Path:
    """The virtual robot: board, plant and the wires between them."""
    return _built(NATIVE_LIBRARY)


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recording sets."""
    named = os.environ.get("TRUING_RECORDINGS")
    beside = ROOT.parent / "shared" / "recordings"
    folder = Path(named) if named else beside
    if not folder.is_dir():
        says = f"is {named}, no folder" if named else f"is not set, and {beside} is not there"
        pytest.skip(f"no real recordings: TRUING_RECORDINGS {says}")
    return folder


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give what shares a module's fixture to one process, which makes it once; begin with the slow tests.

    A worker that takes a slow test last keeps the other one waiting.
    """
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return
    for item in items:
        if _shares_with_module(item) and item.get_closest_marker("xdist_group") is None:
            item.add_marker(pytest.mark.xdist_group(item.nodeid.split("::")[0]))
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


_IMPORTED = pytest.StashKey[frozenset[str]]()


def pytest_collection_finish(session: pytest.Session) -> None:
    session.config.stash[_IMPORTED] = frozenset(sys.modules)


@pytest.fixture(scope="session")
def imported_at_collection(pytestconfig: pytest.Config) -> frozenset[str]:
    """Names of the modules that were imported when all tests of this process had been collected."""
    return pytestconfig.stash[_IMPORTED]


def _shares_with_module(item: pytest.Item) -> bool:
    definitions = getattr(item, "_fixtureinfo").name2fixturedefs  # noqa: B009 - pytest has no public name for it
    return any(each.scope == "module" for name in definitions for each in definitions[name])


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """What the checks beside pytest said; how many tests each part has and how long it took.

    Nothing where pytest runs alone.
    """
    if "TRUING_TEST_CHECKS" not in os.environ:
        return
    checks = Path(os.environ["TRUING_TEST_CHECKS"])
    outcomes = ("passed", "failed", "skipped", "xfailed", "xpassed")
    count = sum(len(terminalreporter.stats.get(outcome, ())) for outcome in outcomes)
    own = round(time.time() - float(os.environ["TRUING_TEST_BEGAN"]))
    said, parts = _ended(checks)
    parts.append([str(own), str(count), "Python and end-to-end tests (pytest)"])
    total = round(time.time() - float(os.environ["TRUING_TEST_BEGAN"]))
    parts.append([str(total), str(sum(int(tests or 0) for _, tests, _ in parts)), "in all, side by side"])
    terminalreporter.section("checks beside pytest")
    terminalreporter.write(said)
    terminalreporter.section("seconds and tests of each part")
    for took, tests, title in parts:
        terminalreporter.write_line(f"{took:>6} s {tests:>6} {'tests' if tests else '':5}  {title}")


def _ended(checks: Path) -> tuple[str, list[list[str]]]:
    """Wait for the checks; what they said, and seconds, number of tests and title of each."""
    with checks.with_suffix(".lock").open() as held:  # by `run`, until the last of them has ended
        fcntl.flock(held, fcntl.LOCK_SH)
    parts = checks.with_suffix(".parts")
    lines = parts.read_text(encoding="utf-8").splitlines() if parts.is_file() else []
    said = checks.with_suffix(".log").read_text(encoding="utf-8", errors="replace")
    return said, [line.split("\t") for line in lines]
