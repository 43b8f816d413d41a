"""Builds the kernel: a package of the files in `kernel/` and of stages written from the effects' hooks.

The package lies in the folder of compiled code (`truing.model.code_cache`), named by a hash of everything it
is made of, so that numba keeps its machine code from one process to the next and a changed effect makes
another kernel.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
import os
import shutil
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from truing.diagnose.catalogue import Catalogue, Entry
from truing.diagnose.simulation import state
from truing.diagnose.simulation.stages import SLOW_CONTEXT, STAGES, STATE_CONTEXT, Stage
from truing.model import compiled, kernel
from truing.model.code_cache import code_folder

BASELINE_PARAMETERS = 4
# Stages that a single wheel has not.
BETWEEN_WHEELS = ("scrub", "coupling")
# The written stages take the place of its `stage.py`.
KERNEL = Path(__file__).parent / "kernel"
_WITH_WHEEL = {
    "delay", "drive", "supply", "friction", "friction_ratio", "push", "gain", "inertia", "gap", "measure",
    "ground",
}  # fmt: skip
_WITH_ROW = {"supply", "gain", "inertia"}


def parameter_offsets(catalogue: Catalogue) -> dict[str, int]:
    """Where each effect's parameters begin in the simulation's vector."""
    offsets: dict[str, int] = {}
    at = BASELINE_PARAMETERS
    for name, effect in catalogue.items():
        offsets[name] = at
        at += len(effect.parameters)
    return offsets


class _Writer:
    """Writes the stage functions of one catalogue, for two wheels or for one that is a single axis."""

    def __init__(self, catalogue: Catalogue, wheels: int) -> None:
        self.wheels = wheels
        self.entries: Mapping[str, Entry] = catalogue.entries
        self.offsets = parameter_offsets(catalogue)
        self.bit = {name: index for index, name in enumerate(catalogue.names)}
        self.slow_slot = self._slots("slow")
        self.state_slot = self._slots("after_step")

    def _slots(self, hook: str) -> dict[str, int]:
        users = [name for name, entry in self.entries.items() if hook in entry.hooks]
        return {name: index for index, name in enumerate(users)}

    def _uses(self, hook: str, argument: str | None = None) -> int:
        mask = 0
        for name, entry in self.entries.items():
            function = entry.hooks.get(hook)
            if function is not None and (argument is None or argument in _arguments(function)):
                mask |= 1 << self.bit[name]
        return mask

    def source(self) -> str:
        """The module's text."""
        lines = [
            '"""Stage functions of the simulation, written by truing.diagnose.simulation.assemble."""',
            "import math",
            "from truing.model.compiled import part",
        ]
        for name, entry in self.entries.items():
            lines.append(f"import {entry.module} as _{name}")
            lines += [f"_{name}_{hook} = part(_{name}.{hook})" for hook in entry.hooks]
        lines.append(f"WHEELS = {self.wheels}")
        for hook in (*STAGES, "slow", "after_step"):
            absent = self.wheels == 1 and hook in BETWEEN_WHEELS
            lines.append(f"USES_{hook.upper()} = {0 if absent else self._uses(hook)}")
        lines.append(f"USES_ANGLE = {self._uses('push', 'angle_start') | self._uses('push', 'angle_end')}")
        speed = self._uses("friction", "speed") | self._uses("supply") | self._uses("coupling")
        lines.append(f"USES_SPEED = {speed}")
        turns = self._uses("friction") | self._uses("friction_ratio") | self._uses("scrub")
        for hook in ("gain", "inertia"):
            turns |= self._uses(hook, "direction")
        lines.append(f"USES_DIRECTION = {turns}")
        lines.append(f"SLOW_SLOTS = {max(1, len(self.slow_slot))}")
        lines.append(f"STATE_SLOTS = {max(1, len(self.state_slot))}")
        for name, stage in STAGES.items():
            lines += self._stage(name, stage)
        lines += self._slow_states()
        lines += self._after_step()
        return "\n".join(lines) + "\n"

    def _stage(self, hook: str, stage: Stage) -> list[str]:
        first = {"sum": "0.0", "product": "1.0", "smallest": "math.inf", "largest": "0.0"}
        start = stage.context[0] if stage.combine == "chain" else first[stage.combine]
        arguments = ["p", "active"]
        if hook in _WITH_WHEEL:
            arguments.append("wheel")
        if hook in _WITH_ROW:
            arguments += ["row", "slows"]
        elsewhere = ("wheel", "slow", "state", "state_before")
        arguments += [name for name in stage.context if name not in elsewhere]
        if hook == "measure":
            arguments += ["states", "states_before"]
        lines = ["@part", f"def {hook}({', '.join(arguments)}):", f"    value = {start}"]
        for name, entry in self.entries.items():
            if hook not in entry.hooks:
                continue
            names = {item: item for item in stage.context}
            if stage.combine == "chain":
                names[stage.context[0]] = "value"
            call = self._call(name, hook, names)
            combined = {
                "sum": f"value += {call}",
                "product": f"value *= {call}",
                "smallest": f"value = min(value, {call})",
                "largest": f"value = max(value, {call})",
                "chain": f"value = {call}",
            }[stage.combine]
            lines += self._if_active(name, combined)
        return [*lines, "    return value"]

    def _slow_states(self) -> list[str]:
        lines = ["@part", "def slow_states(p, active, dt, heat, draw, elapsed, slows):", "    pass"]
        for name, slot in self.slow_slot.items():
            call = self._call(name, "slow", {item: item for item in SLOW_CONTEXT} | {"out": f"slows[{slot}]"})
            lines += self._if_active(name, call)
        return lines

    def _after_step(self) -> list[str]:
        signature = "p, active, wheel, states, h, speed_start, speed_end, travel"
        lines = ["@part", f"def after_step({signature}):", "    pass"]
        for name, slot in self.state_slot.items():
            state = f"states[{slot}, wheel]"
            call = self._call(name, "after_step", {item: item for item in STATE_CONTEXT} | {"state": state})
            lines += self._if_active(name, f"{state} = {call}")
        return lines

    def _if_active(self, name: str, statement: str) -> list[str]:
        return [f"    if active & {1 << self.bit[name]}:", f"        {statement}"]

    def _call(self, name: str, hook: str, context: dict[str, str]) -> str:
        """The call of one hook, each argument found by its name."""
        entry = self.entries[name]
        offset = self.offsets[name]
        index = {item.name: offset + k for k, item in enumerate(entry.effect.parameters)}
        if name in self.slow_slot:
            context = {**context, "slow": f"slows[{self.slow_slot[name]}, row, wheel]"}
        if name in self.state_slot:
            slot = self.state_slot[name]
            context = {
                "state": f"states[{slot}, wheel]",
                "state_before": f"states_before[{slot}, wheel]",
                **{k: v for k, v in context.items() if k != "state_before" and (k != "state" or "[" in v)},
            }
        values = []
        for argument in _arguments(entry.hooks[hook]):
            stem = argument.removeprefix("own").removeprefix("_")
            left, right = (f"{stem}_{side}" if stem else side for side in ("left", "right"))
            if argument in index:
                values.append(f"p[{index[argument]}]")
            elif argument.startswith("own") and left in index and right in index:
                values.append(f"p[{index[left]} + {index[right] - index[left]} * wheel]")
            elif argument in context:
                values.append(context[argument])
            else:
                raise ValueError(f"{entry.module}.{hook}: nothing offers {argument!r} at this stage")
        return f"_{name}_{hook}({', '.join(values)})"


def _arguments(function: Callable[..., Any]) -> tuple[str, ...]:
    return tuple(inspect.signature(function).parameters)


@dataclass(frozen=True)
class Kernel:
    """The simulation of one catalogue, named by `mark`; each function is compiled at its first call."""

    mark: str
    stage: ModuleType
    rollout: Callable[..., None]
    slow: Callable[..., None]
    ground_motion: Callable[..., None]
    windowed_motion: Callable[..., None]


@cache
def kernel_of(catalogue: Catalogue, wheels: int = 2) -> Kernel:
    """The simulation for these effects; of one wheel, the left one, where it is a single axis."""
    stages = _Writer(catalogue, wheels).source()
    mark = _fingerprint(catalogue, stages)
    name = f"truing_kernel_{mark}"
    _import_package(name, stages, code_folder() / "truing_kernels")
    files = (importlib.import_module(f"{name}.{file}") for file in ("stage", "rollout", "ground"))
    stage, rollout, ground = files
    return Kernel(mark, stage, rollout.rollout, rollout.slow, ground.ground_motion, ground.windowed_motion)


def _fingerprint(catalogue: Catalogue, stages: str) -> str:
    modules = [state, compiled, kernel, *(sys.modules[entry.module] for entry in catalogue.entries.values())]
    files = [*sorted(KERNEL.glob("*.py")), *(Path(inspect.getfile(module)) for module in modules)]
    text = "\0".join([stages, *(file.read_text(encoding="utf-8") for file in files)])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _import_package(name: str, stages: str, folder: Path) -> None:
    """Make the kernel's files and these stages a package of this name."""
    if name in sys.modules:
        return
    path = folder / name
    if not path.exists():
        fresh = path.with_suffix(f".{os.getpid()}.tmp")
        shutil.copytree(KERNEL, fresh, ignore=shutil.ignore_patterns("__pycache__"))
        (fresh / "stage.py").write_text(stages, encoding="utf-8")
        with suppress(OSError):  # another process may do the same at the same moment
            fresh.rename(path)
        shutil.rmtree(fresh, ignore_errors=True)
    spec = importlib.util.spec_from_file_location(
        name, path / "__init__.py", submodule_search_locations=[str(path)]
    )
    assert spec is not None
    assert spec.loader is not None
    sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sys.modules[name])
