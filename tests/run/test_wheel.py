"""The wheel: installed without the repository it holds what its extras say, and says which one is missing.

A virtual environment gets the wheel by pip, without an index. What the wheel requires is taken from the
project's own environment, which holds the pins of host/requirements.lock: links to the packages that its
metadata names, with those that they require, and to no others. A whole installation would unpack 300 MB.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass, replace
from importlib.metadata import distribution, distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

pytestmark = pytest.mark.slow

VERBS = """
import truing
recordings = truing.read("example")
run = recordings.runs[0]
found = truing.identify(recordings)
models = truing.fit(recordings)
simulated = truing.simulate(models, recordings)
result = truing.diagnose(recordings)
truing.export(result, "model.toml")
print(truing.__file__)
print(*(effect.name for effect in result.effects))
"""


# Of the host's tests, quick ones that need neither a board nor an extra.
HOST_TESTS = (
    "test_recording",
    "test_import_tables",
    "test_import_traps",
    "test_import_command",
    "test_import_sysid",
    "test_identify_steps",
    "test_model_file",
    "test_plan",
)


@dataclass(frozen=True, slots=True)
class Installed:
    """An environment with the wheel, and an empty folder to work in."""

    python: Path
    folder: Path
    packages: frozenset[str]
    cache: Path
    more: Path | None = None

    def call(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        """Run its Python, without compiler, repository or settings of whoever runs the tests."""
        environment = {
            "PATH": str(self.python.parent),
            "HOME": str(self.folder),
            "XDG_CACHE_HOME": str(self.cache),
            "OPENBLAS_NUM_THREADS": "1",
            "LANG": "C.UTF-8",
        } | ({} if self.more is None else {"PYTHONPATH": str(self.more)})
        return subprocess.run(
            [self.python, *arguments],
            cwd=self.folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
            stdin=subprocess.DEVNULL,
        )

    def truing(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        """Run the command."""
        return self.call("-m", "truing", *arguments)


def pip(command: str, *arguments: str | Path, python: Path = Path(sys.executable)) -> None:
    """Run this environment's pip, for another Python if one is named."""
    whole = [sys.executable, "-m", "pip", "--python", python, command, "--no-index", "--no-deps", *arguments]
    done = subprocess.run(whole, check=False, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def wheel(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, with what is built in it."""
    folder = tmp_path_factory.mktemp("wheel")
    pip("wheel", "--no-build-isolation", "--wheel-dir", folder, root)
    return next(folder.glob("*.whl"))


def closure(requirements: Iterable[str], extras: Iterable[str] = ()) -> frozenset[str]:
    """Names of all packages that these requirements bring along, by the metadata of those here."""
    found: set[str] = set()
    seen: set[tuple[str, str]] = set()
    pending = [(Requirement(text), extra) for text in requirements for extra in ("", *extras)]
    while pending:
        requirement, extra = pending.pop()
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": extra}):
            continue
        name = canonicalize_name(requirement.name)
        for wanted in ("", *requirement.extras):
            if (name, wanted) in seen:
                continue
            seen.add((name, wanted))
            if name != "truing":
                found.add(name)
                pending += [(Requirement(text), wanted) for text in distribution(name).requires or ()]
    return frozenset(found)


def link(package: str, site: Path) -> None:
    """Let `site` have a package of this environment."""
    here = distribution(package)
    for top in {path.parts[0] for path in here.files or () if path.parts[0] not in ("..", "__pycache__")}:
        place = site / top
        if not place.is_symlink():
            place.symlink_to(Path(str(here.locate_file(top))))


@pytest.fixture(scope="module")
def bare(wheel: Path, root: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """The wheel without extras, with the example in the folder to work in."""
    folder = tmp_path_factory.mktemp("bare")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True, timeout=120)
    python = folder / "venv" / "bin" / "python"
    pip("install", wheel, python=python)
    site = Path(sysconfig.get_path("purelib", vars={"base": str(folder / "venv")}))
    packages = closure(required(site))
    for package in packages:
        link(package, site)
    work = folder / "some where"
    example = root / "docs" / "example"
    shutil.copytree(example, work / "example")
    (work / "one run" / "runs").mkdir(parents=True)
    shutil.copy(example / "baseline.toml", work / "one run")
    shutil.copy(min((example / "runs").glob("*.csv")), work / "one run" / "runs")
    return Installed(python, work, packages, folder / "cache")


def required(site: Path) -> list[str]:
    """What the wheel's metadata asks for."""
    return list(next(iter(distributions(path=[str(site)], name="truing"))).requires or ())


@pytest.fixture(scope="module")
def with_sim(bare: Installed, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """The same with the extra `sim`, whose packages lie in a folder of their own."""
    site = next((bare.python.parents[1] / "lib").glob("*/site-packages"))
    packages = closure(required(site), ("sim",))
    more = tmp_path_factory.mktemp("sim")
    for package in packages - bare.packages:
        link(package, more)
    return replace(bare, packages=packages, more=more)


@pytest.fixture(scope="module")
def with_pytest(bare: Installed, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """The same with what the tests of the host themselves need, in a folder of its own."""
    more = tmp_path_factory.mktemp("pytest")
    for package in closure(["pytest", "pytest-timeout", "pytest-xdist", "hypothesis"]) - bare.packages:
        link(package, more)
    for package in ("pytest", "pytest-timeout", "pytest-xdist", "hypothesis"):
        link(package, more)
    return replace(bare, more=more)


# The package is the wheel's, also where the tests stand; what it compiles stays beside the installation.
RUN_TESTS = """
import os, sys
os.environ["NUMBA_CACHE_DIR"] = sys.argv.pop(1)
import pytest, truing
print(truing.__file__, file=sys.stderr)
sys.exit(pytest.main(sys.argv[1:]))
"""


def test_host_tests_that_need_no_board_pass_on_the_installed_wheel(
    with_pytest: Installed, root: Path
) -> None:
    names = [f"tests/host/{name}.py" for name in HOST_TESTS]
    cache = with_pytest.cache
    options = ("-q", "-n", "0", "-o", f"cache_dir={cache / 'pytest'}")
    done = replace(with_pytest, folder=root).call("-P", "-c", RUN_TESTS, cache / "numba", *options, *names)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    assert done.stderr.startswith(str(with_pytest.python.parents[1]))
    assert int(re.findall(r"(\d+) passed", done.stdout)[0]) > 150


def test_the_wheel_holds_image_and_virtual_board_for_its_platform(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    held = {
        *(f"truing/built/truing-f405{suffix}" for suffix in (".elf", ".update")),
        *(f"hil_sim/built/lib{name}.so" for name in ("hil_sim", "host_robot")),
    }
    assert held <= names
    assert "-py3-none-" in wheel.name
    assert "linux" in wheel.name


def test_no_path_of_the_build_stays_in_the_wheels_libraries(wheel: Path, root: Path) -> None:
    archive = zipfile.ZipFile(wheel)
    for name in ("libhil_sim.so", "libhost_robot.so"):
        assert str(root).encode() not in archive.read(f"hil_sim/built/{name}")


def test_a_bare_installation_is_under_fifteen_packages(bare: Installed) -> None:
    assert len(bare.packages | {"truing"}) < 15, sorted(bare.packages)
    assert {"numpy", "scipy", "numba"} <= bare.packages


def test_every_pin_of_the_wheel_is_the_locks(wheel: Path, root: Path) -> None:
    """What the extras name in all is pinned in the one lock."""
    lock = (root / "host" / "requirements.lock").read_text(encoding="utf-8")
    pins = {line.split(" ")[0] for line in lock.splitlines() if "==" in line}
    metadata = distribution("truing")
    extras = ("all", "bags", "can", "engines", "fleet", "foxglove", "plots", "s3", "sim", "view")
    for package in closure(metadata.requires or (), extras):
        assert f"{package}=={distribution(package).version}" in pins


def test_the_six_verbs_work_without_repository_and_compiler(bare: Installed) -> None:
    done = bare.call("-c", VERBS)
    assert done.returncode == 0, done.stderr
    where, effects = done.stdout.splitlines()[-2:]
    assert where.startswith(str(bare.python.parents[1]))
    assert effects == "stribeck_friction"
    assert (bare.folder / "model.toml").is_file()


@pytest.mark.parametrize(
    "arguments",
    [
        ["fit", "one run", "--out", "fitted.toml"],
        ["export", "example/baseline.toml", "--to", "mjcf", "--out", "robot.xml"],
        ["diagnose", "one run", "--report", "diagnosis.html"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_the_commands_work_too_and_compiled_code_goes_to_the_users_cache(
    bare: Installed, arguments: list[str]
) -> None:
    done = bare.truing(*arguments)
    assert done.returncode == 0, done.stderr
    assert (bare.folder / arguments[-1]).exists()
    if arguments[0] != "export":  # compiles nothing
        assert list((bare.cache / "truing").rglob("*.nbi"))
        assert not list(bare.python.parents[1].glob("lib/*/site-packages/truing/**/*.nbi"))


@pytest.mark.parametrize(
    ("extra", "arguments"),
    [
        ("sim", ["run", "paper/XI", "--yes"]),
        ("sim", ["trial", "--core", "--seed", "1"]),
        ("view", ["view", "--no-browser"]),
        ("can", ["--port", "can:slcan:COM3", "info"]),
        ("can", ["ports", "--can", "virtual:robots,3"]),
        ("plots", ["plot", "example"]),
        ("plots", ["fit", "example", "--report", "pictures"]),
        ("bags", ["identify", "drive.mcap"]),
        ("bags", ["identify", "drive.bag"]),
        ("foxglove", ["export", "example", "--to", "mcap", "--out", "mcap"]),
        ("foxglove", ["run", "paper/XI", "--yes", "--foxglove"]),
        ("engines", ["trial", "--engine", "mujoco"]),
        ("fleet", ["fleet", "example"]),
        ("bullet", ["trial", "--engine", "pybullet"]),
    ],
    ids=lambda value: value if isinstance(value, str) else value[0],
)
def test_what_is_missing_is_named_by_its_extra(bare: Installed, extra: str, arguments: list[str]) -> None:
    (bare.folder / "drive.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(64))
    (bare.folder / "drive.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(64))
    done = bare.truing(*arguments)
    assert done.returncode == 2, (done.stdout, done.stderr)
    assert f"pip install 'truing[{extra}]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_demos_plan_runs_on_the_virtual_board(with_sim: Installed, bare: Installed) -> None:
    assert with_sim.packages - bare.packages >= {"unicorn"}
    done = with_sim.truing("run", "paper/XI", "--yes")
    assert done.returncode == 0, done.stderr
    assert "181 records at 20 Hz" in done.stdout + done.stderr
    runs = list((with_sim.folder / "out" / "recordings" / "virtual" / "runs").glob("*.csv"))
    assert len(runs) == 1
