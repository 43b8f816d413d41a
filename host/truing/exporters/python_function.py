"""The model as one Python file that needs nothing but Python."""

from __future__ import annotations

from pathlib import Path

from truing.model.robot_model import RobotModel
from truing.recording.writer import replace_file

from .terms import CORRECTION, DEFAULTS, EVERYTHING, ExportOptions, headline, left_out, wheels, without

KIND = "python"
TITLE = "one file with simulate(times, efforts), needs no package"
SUFFIX = ".py"
HOLDS = EVERYTHING - {"supply", CORRECTION}

FUNCTION = '''

def simulate(
    times_s: Iterable[float], efforts_left: Iterable[float], efforts_right: Iterable[float]
) -> list[tuple[float, float]]:
    """Speeds (left, right), m/s, at each time, from rest; efforts (-1..1) act over the interval before."""
    return run(Robot(LEFT, RIGHT, WHEELBASE_M), times_s, efforts_left, efforts_right)
'''


def write(model: RobotModel, path: Path, options: ExportOptions = DEFAULTS) -> tuple[Path, ...]:
    """The standalone simulation with this model's numbers in front of it."""
    from . import standalone_wheel

    assert standalone_wheel.__file__ is not None
    body = Path(standalone_wheel.__file__).read_text(encoding="utf-8")
    head, code = body.split("from __future__ import annotations\n", 1)
    head = head.strip().strip('"')
    notes = "".join(f"\n{sentence}" for sentence in left_out(model, HOLDS))
    named = "".join(
        f"{side.upper()} = {{\n"
        + "".join(f'    "{name}": {value!r},\n' for name, value in wheel.to_table().items())
        + "}\n"
        for side, wheel in wheels(without(model, HOLDS))
    )
    base = model.robot.wheelbase_m or options.wheelbase_m
    title = f"{headline(model)}\n\n{head}{notes}".replace("\\", "/").replace('"""', "'''")
    imports, rest = code.split("\n\n#", 1)
    text = (
        f'"""{title}\n"""\n\nfrom __future__ import annotations\n{imports}\n\n{named}'
        f"WHEELBASE_M: float | None = {base!r}\n\n#{rest}{FUNCTION}"
    )
    replace_file(path, text.encode())
    return (path,)
