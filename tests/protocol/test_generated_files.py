"""What is generated from the schema is checked in and never stale."""

import shutil
import subprocess
import sys
from pathlib import Path

PROTOCOL = Path(__file__).resolve().parents[2] / "protocol"


def _generate(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(folder / "generate.py"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def _copy_with_schema_change(tmp_path: Path, old: str, new: str) -> Path:
    copy = tmp_path / "protocol"
    shutil.copytree(PROTOCOL, copy)
    schema = copy / "schema.toml"
    text = schema.read_text()
    assert old in text
    schema.write_text(text.replace(old, new))
    return copy


def test_generated_files_are_those_of_the_schema() -> None:
    result = _generate(PROTOCOL, "--check")
    assert result.returncode == 0, result.stderr


def test_a_changed_schema_makes_the_check_fail(tmp_path: Path) -> None:
    copy = _copy_with_schema_change(tmp_path, "max_segments = 256", "max_segments = 255")
    result = _generate(copy, "--check")
    assert result.returncode == 1
    assert "proto.h is stale" in result.stderr


def test_an_unknown_type_is_named_with_its_message_and_field(tmp_path: Path) -> None:
    copy = _copy_with_schema_change(
        tmp_path, 'name = "uptime_ms", type = "u32"', 'name = "uptime_ms", type = "u64"'
    )
    result = _generate(copy)
    assert result.returncode == 2
    assert "status_reply.uptime_ms: unknown type 'u64'" in result.stderr
