"""The command line: quick, with an example everywhere, and a mistake gets one clear line."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import click
import pytest

from truing.cli import COMMANDS, group


def truing(*arguments: str, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    import os

    return subprocess.run(
        [sys.executable, "-m", "truing", *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        env=os.environ | environment,
    )


def every_command(command: click.Command, name: str) -> list[tuple[str, click.Command]]:
    found = [(name, command)]
    if isinstance(command, click.Group):
        with click.Context(command) as context:
            for child in command.list_commands(context):
                inner = command.get_command(context, child)
                assert inner is not None
                found += every_command(inner, f"{name} {child}")
    return found


def test_help_comes_at_once() -> None:
    truing("--help")
    times = []
    for _ in range(3):
        began = time.perf_counter()
        assert truing("--help").returncode == 0
        times.append(time.perf_counter() - began)
    print(f"truing --help: {min(times):.3f} s")
    assert min(times) < 0.3


@pytest.mark.parametrize(("name", "command"), every_command(group, "truing"))
def test_every_help_text_shows_an_example(name: str, command: click.Command) -> None:
    assert command.help is not None, name
    assert "Example" in command.help, name
    assert "truing " in command.help.split("Example", 1)[1], name


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


def test_a_file_that_is_no_image_is_named(tmp_path: Path, native_library: Path) -> None:
    wrong = tmp_path / "wrong.elf"
    wrong.write_bytes(b"not an ELF file")
    done = truing("info", "--image", str(wrong))
    assert done.returncode == 1
    assert "the virtual board cannot start" in done.stderr
    assert "Traceback" not in done.stderr


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


def test_json_stands_before_or_after_the_subcommand(image: Path, native_library: Path) -> None:
    before = json.loads(truing("--json", "info").stdout)
    after = json.loads(truing("info", "--json").stdout)
    assert before == after
    assert before["status"]["state"] == "idle"
    assert before["board"]["board_name"]


def test_the_port_may_come_from_the_environment() -> None:
    done = truing("info", TRUING_PORT="/dev/nowhere")
    assert "/dev/nowhere" in done.stderr


def test_parameters_are_listed_and_set(image: Path, native_library: Path) -> None:
    listed = json.loads(truing("params", "list", "--json").stdout)
    assert listed["counts_per_rev"] == 2400
    done = json.loads(truing("params", "set", "wheelbase_m", "0.29", "--json").stdout)
    assert done == {"name": "wheelbase_m", "before": 0.283, "value": 0.29}
    refused = truing("params", "set", "wheelbase_m", "-5")
    assert refused.returncode == 1
    assert "must lie within 0.02 to 5 m" in refused.stderr


def test_a_step_is_driven_and_identified(image: Path, native_library: Path, tmp_path: Path) -> None:
    done = truing("step", "--effort", "0.4", "--duration", "2", "--set", str(tmp_path / "set"))
    assert done.returncode == 0, done.stderr
    assert "floor:" in done.stderr
    assert "40 %" in done.stdout
    assert (tmp_path / "set/runs/01_step.csv").is_file()


def test_another_virtual_robot_behaves_as_its_file_says(
    image: Path, native_library: Path, tmp_path: Path
) -> None:
    heavy = tmp_path / "heavy.toml"
    heavy.write_text("[chassis]\nmass_kg = 20.0\n")

    def time_constant(*more: str) -> float:
        done = truing(
            "step", "--effort", "0.5", "--duration", "6", "--set", str(tmp_path / "set"), "--json", *more
        )
        steps = json.loads(done.stdout)["identification"]["runs"][0]["left"]["steps"]
        return float(steps[0]["time_constant_s"]["value"])

    assert time_constant("--robot", str(heavy)) > 1.5 * time_constant()
    heavy.write_text("[chassis]\nweight = 20.0\n")
    wrong = truing("info", "--robot", str(heavy))
    assert wrong.returncode == 2
    assert "weight" in wrong.stderr


def test_a_full_disk_or_a_file_in_the_way_is_one_clear_line(
    image: Path, native_library: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    done = truing("run", "paper/I", "--set", str(tmp_path / "file" / "set"))
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "file" in done.stderr


def test_the_demo_says_what_it_does_and_where_its_files_lie(
    image: Path, native_library: Path, tmp_path: Path
) -> None:
    done = truing(
        "demo", "--json", TRUING_OUT=str(tmp_path / "out"), TRUING_RECORDINGS=str(tmp_path / "none")
    )
    assert done.returncode == 0, done.stderr
    written = [Path(path) for path in json.loads(done.stdout)["written"]]
    assert all(path.is_file() for path in written)
    assert {".png", ".html", ".csv", ".json"} <= {path.suffix for path in written}
    assert all(tmp_path in path.parents for path in written)
    plain = truing("demo", TRUING_OUT=str(tmp_path / "out"), TRUING_RECORDINGS=str(tmp_path / "none"))
    assert "No real recording was identified" in plain.stdout
    assert str(tmp_path / "none") in plain.stdout
    assert plain.stdout.index("report.html") > plain.stdout.index("Written")


@pytest.mark.recordings
def test_the_demo_identifies_a_real_recording_too(
    image: Path, native_library: Path, recordings: Path, tmp_path: Path
) -> None:
    done = truing("demo", "--json", TRUING_OUT=str(tmp_path / "out"), TRUING_RECORDINGS=str(recordings))
    real = json.loads(done.stdout)["real"]
    assert recordings in Path(real["set"]).parents
    assert real["runs"]
