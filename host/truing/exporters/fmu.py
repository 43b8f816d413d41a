"""An FMI 2.0 co-simulation FMU: the model in C, compiled here, with its sources inside.

Efforts are inputs that hold between communication steps; speeds, travel and (where the wheelbase is known)
the pose are outputs; every number of the model is a parameter that may be set before initialisation ends.
"""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
import tempfile
import uuid
import zipfile
from importlib import resources
from pathlib import Path
from typing import TypeAlias
from xml.etree import ElementTree as Xml

from truing.errors import TruingError
from truing.model.robot_model import RobotModel
from truing.recording.writer import replace_file

from .correction_numbers import correction_numbers
from .terms import DEFAULTS, EVERYTHING, ExportOptions, headline, left_out, wheels
from .xml_file import child, number, write_xml

KIND = "fmu"
TITLE = "FMI 2.0 co-simulation unit for Linux on x86-64, with its C sources"
SUFFIX = ".fmu"
HOLDS = EVERYTHING - {"supply"}

# The order of `enum parameter` in fmu_source/wheel.h: field, unit.
PARAMETERS = (
    ("gain_mps", "m/s"),
    ("time_constant_s", "s"),
    ("delay_s", "s"),
    ("friction", ""),
    ("breakaway_excess", ""),
    ("stribeck_mps", "m/s"),
    ("stribeck_shape", ""),
    ("drag", "s2/m2"),
    ("offset", ""),
    ("reverse_gain", ""),
    ("reverse_time_constant", ""),
    ("reverse_friction", ""),
    ("reverse_excess", ""),
    ("lag_s", "s"),
    ("deadband", ""),
)
WHEELBASE_REFERENCE = 10
FIRST_PARAMETER, PER_WHEEL = 20, 20
UNITS: dict[str, dict[str, str]] = {
    "m/s": {"m": "1", "s": "-1"},
    "m": {"m": "1"},
    "s": {"s": "1"},
    "rad": {"rad": "1"},
    "s2/m2": {"s": "2", "m": "-2"},
}
SOURCES = ("slave.c", "wheel.c", "correction.c", "unused.c")
HEADERS = ("fmi2.h", "wheel.h", "correction.h")
COMPILE = ("-std=c11", "-O2", "-fPIC", "-shared", "-ffp-contract=off", "-fvisibility=hidden")
# The same model gives the same file.
ZIP_DATE = (1980, 1, 1, 0, 0, 0)

Variable: TypeAlias = tuple[
    str, int, str, str, str, float, str
]  # name, reference, causality, ..., description


def write(model: RobotModel, path: Path, options: ExportOptions = DEFAULTS) -> tuple[Path, ...]:
    """Compile the model and put description, library and sources into one archive."""
    if not (sys.platform == "linux" and platform.machine() == "x86_64"):
        machine = f"{sys.platform} on {platform.machine()}"
        raise TruingError(f"the FMU's library is built for Linux on x86-64 only, and this is {machine}")
    identifier = "".join(c if c.isalnum() and c.isascii() else "_" for c in path.stem)
    identifier = identifier if identifier[:1].isalpha() else f"m{identifier}"
    wheelbase = model.robot.wheelbase_m or options.wheelbase_m
    guid = f"{{{uuid.uuid5(uuid.NAMESPACE_URL, model.to_toml() + repr(wheelbase))}}}"
    folder = resources.files("truing.exporters") / "fmu_source"
    files = {f"sources/{name}": (folder / name).read_bytes() for name in (*SOURCES, *HEADERS)}
    files["sources/model_numbers.h"] = _numbers(model, guid, wheelbase).encode()
    files["sources/correction_numbers.h"] = correction_numbers(model.correction).encode()
    with tempfile.TemporaryDirectory() as temporary:
        work = Path(temporary)
        (work / "sources").mkdir()
        for name, data in files.items():
            (work / name).write_bytes(data)
        _compile(work)
        description = work / "modelDescription.xml"
        write_xml(_description(model, identifier, guid, wheelbase), description, left_out(model, HOLDS))
        archive = work / "archive"
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as bundle:
            files = {"modelDescription.xml": description.read_bytes()} | files
            files[f"binaries/linux64/{identifier}.so"] = (work / "model.so").read_bytes()
            for name, data in files.items():
                bundle.writestr(zipfile.ZipInfo(name, ZIP_DATE), data, zipfile.ZIP_DEFLATED)
        replace_file(path, archive.read_bytes())
    return (path,)


def _compile(work: Path) -> None:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise TruingError("an FMU needs a C compiler, and there is no gcc", "Install gcc and try again")
    command = [compiler, *COMPILE, *(f"sources/{name}" for name in SOURCES), "-o", "model.so", "-lm"]
    done = subprocess.run(command, cwd=work, capture_output=True, text=True, timeout=120, check=False)
    if done.returncode != 0:
        raise TruingError(f"the FMU did not compile: {done.stderr.strip().splitlines()[0]}")


def _numbers(model: RobotModel, guid: str, wheelbase: float | None) -> str:
    """The header that makes the general source this model."""
    rows = ", ".join(
        "{" + ", ".join(number(getattr(wheel, name)) for name, _ in PARAMETERS) + "}"
        for _, wheel in wheels(model)
    )
    return (
        "/* The numbers of one model. */\n"
        f'#define MODEL_GUID "{guid}"\n'
        f"#define MODEL_WHEELBASE_M {number(wheelbase or 0.0)}\n"
        f"#define MODEL_NUMBERS {{{rows}}}\n"
    )


def _variables(model: RobotModel, wheelbase: float | None) -> list[Variable]:
    found: list[Variable] = []
    for index, (side, _) in enumerate(wheels(model)):
        text = f"share of the supply that drives the {side} wheel, -1..1"
        found.append((f"effort_{side}", 1 + index, "input", "continuous", "", 0.0, text))
    for index, (side, _) in enumerate(wheels(model)):
        text = f"speed of the {side} wheel at its rim"
        found.append((f"speed_{side}", 3 + index, "output", "continuous", "m/s", 0.0, text))
    for index, (side, _) in enumerate(wheels(model)):
        text = f"travel of the {side} wheel at its rim"
        found.append((f"travel_{side}", 5 + index, "output", "continuous", "m", 0.0, text))
    if wheelbase:
        for name, reference, unit in (("x", 7, "m"), ("y", 8, "m"), ("theta", 9, "rad")):
            text = "pose of the middle of the axle, from the start"
            found.append((name, reference, "output", "continuous", unit, 0.0, text))
        text = "distance between the wheels' contact points"
        found.append(("wheelbase_m", WHEELBASE_REFERENCE, "parameter", "fixed", "m", wheelbase, text))
    for index, (side, wheel) in enumerate(wheels(model)):
        for offset, (name, unit) in enumerate(PARAMETERS):
            reference = FIRST_PARAMETER + PER_WHEEL * index + offset
            start = float(getattr(wheel, name))
            found.append((f"{side}.{name}", reference, "parameter", "fixed", unit, start, f"{side} wheel"))
    return found


def _description(model: RobotModel, identifier: str, guid: str, wheelbase: float | None) -> Xml.Element:
    """modelDescription.xml, FMI 2.0 sections 2.2 and 4.3.1."""
    root = Xml.Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": model.robot.name or identifier,
            "guid": guid,
            "description": headline(model),
            "generationTool": "truing",
            "variableNamingConvention": "structured",
            "numberOfEventIndicators": "0",
        },
    )
    slave = child(
        root,
        "CoSimulation",
        modelIdentifier=identifier,
        canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
        canNotUseMemoryManagementFunctions="true",
    )
    files = child(slave, "SourceFiles")
    for name in SOURCES:
        child(files, "File", name=name)
    units = child(root, "UnitDefinitions")
    for name, exponents in UNITS.items():
        child(child(units, "Unit", name=name), "BaseUnit", **exponents)
    logs = child(root, "LogCategories")
    child(logs, "Category", name="logStatusError")
    child(root, "DefaultExperiment", startTime="0", stopTime="10", stepSize="0.01")
    variables = child(root, "ModelVariables")
    outputs = []
    listed = _variables(model, wheelbase)
    for index, (name, reference, causality, variability, unit, start, text) in enumerate(listed, start=1):
        element = child(
            variables,
            "ScalarVariable",
            name=name,
            valueReference=str(reference),
            causality=causality,
            variability=variability,
            description=text,
        )
        if causality != "input":
            element.set("initial", "exact")
        real = child(element, "Real", start=number(start))
        if unit:
            real.set("unit", unit)
        if causality == "output":
            outputs.append(index)
    structure = child(child(root, "ModelStructure"), "Outputs")
    for index in outputs:
        # Nothing jumps with an input: speed needs time.
        child(structure, "Unknown", index=str(index), dependencies="")
    return root
