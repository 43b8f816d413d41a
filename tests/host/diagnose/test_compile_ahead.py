"""After the set-up a diagnosis compiles nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).resolve().parents[3] / "docs" / "example"


@pytest.mark.slow
def test_the_first_diagnosis_finds_all_machine_code_in_the_cache(tmp_path: Path) -> None:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "numba")}

    def compiled_after(*arguments: str) -> set[str]:
        subprocess.run([sys.executable, "-m", *arguments], env=environment, check=True, capture_output=True)
        return {path.name for path in (tmp_path / "numba").rglob("*.nbc")}

    ahead = compiled_after("truing.diagnose.compile_ahead")
    assert ahead
    assert compiled_after("truing", "diagnose", str(EXAMPLE)) == ahead
