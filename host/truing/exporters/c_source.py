"""One C11 file that runs anywhere: both wheels with their physics, and the learned correction beside them."""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path

from truing.model.robot_model import RobotModel
from truing.recording.writer import replace_file

from .correction_numbers import correction_numbers
from .fmu import PARAMETERS
from .terms import DEFAULTS, EVERYTHING, ExportOptions, headline, left_out, wheels
from .xml_file import number

KIND = "c"
TITLE = "one C file with robot_step(robot, seconds, efforts), needs no library but libm"
SUFFIX = ".c"
HOLDS = EVERYTHING - {"supply"}

_INCLUDES = re.compile(r"^#include .*\n", re.MULTILINE)
_GUARDS = re.compile(r"^#(ifndef|define) TRUING_\w+_H\n|^#endif\n", re.MULTILINE)


def write(model: RobotModel, path: Path, options: ExportOptions = DEFAULTS) -> tuple[Path, ...]:
    """Write the file; with -DROBOT_MAIN it is a program that reads `seconds left right` and prints speeds."""
    folder = resources.files("truing.exporters") / "fmu_source"
    wheelbase = model.robot.wheelbase_m or options.wheelbase_m or 0.0
    rows = ", ".join(
        "{" + ", ".join(number(getattr(wheel, name)) for name, _ in PARAMETERS) + "}"
        for _, wheel in wheels(model)
    )
    remarks = "".join(f" * {note}\n" for note in left_out(model, HOLDS))

    def text(name: str) -> str:
        whole = (folder / name).read_text(encoding="utf-8")
        return _GUARDS.sub("", _INCLUDES.sub("", whole))

    parts = [f"/* {headline(model).replace('*/', '')}\n{remarks} */\n{_LIBRARIES}"]
    parts += [text("wheel.h"), text("correction.h"), correction_numbers(model.correction)]
    parts += [text("wheel.c"), text("correction.c")]
    parts.append(_ROBOT.replace("NUMBERS", f"{{{rows}}}").replace("WHEELBASE", number(wheelbase)))
    replace_file(path, "\n".join(parts).encode("utf-8"))
    return (path,)


_LIBRARIES = """#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>
"""
_ROBOT = """struct robot {
    struct wheel wheel[2];
    struct correction correction;
    double time_s;
    double speed_mps[2], travel_m[2];
};

void robot_reset(struct robot *robot)
{
    static const double numbers[2][PARAMETERS] = NUMBERS;
    memset(robot, 0, sizeof *robot);
    for (int side = 0; side < 2; side++) {
        memcpy(robot->wheel[side].parameter, numbers[side], sizeof numbers[side]);
        robot->wheel[side].lagged = numbers[side][OFFSET];
    }
}

/* Run for a time under constant efforts, -1..1; false: too many changes of effort within a delay. */
bool robot_step(struct robot *robot, double duration_s, const double effort[2])
{
    const bool corrected = correction_terms() > 0;
    const double longest_s = correction_longest_step_s();
    const int count = corrected && duration_s > longest_s ? (int)ceil(duration_s / longest_s) : 1;
    const double h = duration_s / count;
    for (int n = 0; n < count; n++) {
        double speed_mps[2];
        for (int side = 0; side < 2; side++) {
            robot->wheel[side].input = effort[side];
            if (!wheel_step(&robot->wheel[side], robot->time_s, h)) {
                return false;
            }
            speed_mps[side] = robot->wheel[side].speed_mps;
        }
        if (corrected && h > 0.0) {
            correction_step(&robot->correction, h, effort, speed_mps, WHEELBASE);
        }
        robot->time_s += h;
    }
    for (int side = 0; side < 2; side++) {
        const struct wheel *wheel = &robot->wheel[side];
        robot->speed_mps[side] = corrected ? robot->correction.shown_mps[side] : wheel->speed_mps;
        robot->travel_m[side] = corrected ? robot->correction.travel_m[side] : wheel->travel_m;
    }
    return true;
}

#ifdef ROBOT_MAIN
#include <stdio.h>

int main(void)
{
    static struct robot robot;
    double duration_s, effort[2];
    robot_reset(&robot);
    while (scanf("%lf %lf %lf", &duration_s, &effort[0], &effort[1]) == 3) {
        if (!robot_step(&robot, duration_s, effort)) {
            return 1;
        }
        printf("%.17g %.17g\\n", robot.speed_mps[0], robot.speed_mps[1]);
    }
    return 0;
}
#endif
"""
