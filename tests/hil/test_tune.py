"""`truing tune` makes velocity mode follow more closely, also on a robot whose wheels differ."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from support.cli import truing

UNEVEN = """
[left.motor]
resistance_ohm = 7.5
[left.friction]
coulomb_nm = 0.06
breakaway_nm = 0.12
[right.motor]
emf_v_per_radps = 0.0165
[right.friction]
coulomb_nm = 0.03
viscous_nms_per_rad = 0.012
[chassis]
mass_kg = 7.0
"""


@pytest.mark.parametrize(
    ("robot", "bar"), [("", 0.75), (UNEVEN, 0.85)], ids=["paper's robot", "uneven robot"]
)
def test_learned_feedforward_cuts_the_tracking_error(
    tmp_path: Path, image: Path, native_library: Path, robot: str, bar: float
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(robot)
    done = truing("tune", "--robot", str(file), "--set", str(tmp_path / "set"), "--save", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    before, after = (result["tracking_mps"][when]["both"] for when in ("before", "after"))
    print(f"tracking error {1e3 * before:.1f} mm/s before, {1e3 * after:.1f} mm/s after")
    assert result["kept"]
    assert result["saved"]
    assert after < bar * before
    learned = {name: value["after"] for name, value in result["parameters"].items()}
    assert len(learned) == 12
    if robot:
        assert learned["ff_ks_left"] > 1.3 * learned["ff_ks_right"]
        assert learned["ff_kv_right"] > 1.1 * learned["ff_kv_left"]
    assert "floor:" in done.stderr
