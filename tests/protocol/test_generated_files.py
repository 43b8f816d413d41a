"""What is generated from the schema is checked in and never stale."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_generated_files_are_those_of_the_schema() -> None:
    result = subprocess.run(
        [sys.executable, str(ROOT / "protocol" / "generate.py"), "--check"], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr


def test_a_changed_schema_makes_the_check_fail(tmp_path: Path) -> None:
    copy = tmp_path / "protocol"
    subprocess.run(["cp", "-r", str(ROOT / "protocol"), str(copy)], check=True)
    schema = copy / "schema.toml"
    schema.write_text(schema.read_text().replace("max_segments = 256", "max_segments = 255"))
    result = subprocess.run([sys.executable, str(copy / "generate.py"), "--check"], capture_output=True, text=True, check=False)
    assert result.returncode == 1
    assert "proto.h is stale" in result.stderr


def test_an_unknown_type_is_named_with_its_message_and_field(tmp_path: Path) -> None:
    copy = tmp_path / "protocol"
    subprocess.run(["cp", "-r", str(ROOT / "protocol"), str(copy)], check=True)
    schema = copy / "schema.toml"
    schema.write_text(schema.read_text().replace('name = "uptime_ms", type = "u32"', 'name = "uptime_ms", type = "u64"'))
    result = subprocess.run([sys.executable, str(copy / "generate.py")], capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert "status_reply.uptime_ms: unknown type 'u64'" in result.stderr
