"""Builds the kernel: stage functions written from the effects' hooks, then the simulation's own.

The generated modules lie in NUMBA_CACHE_DIR, named by a hash of everything they are made of, so that
numba keeps their machine code from one process to the next and a changed effect makes another kernel.
Without that folder they are compiled in memory.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import linecache
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from truing.diagnose.catalogue import Catalogue, Entry
from truing.diagnose.simulation import bodies, ground, jit, rollout, rows, step
from truing.diagnose.simulation.stages import SLOW_CONTEXT, STAGES, STATE_CONTEXT, Stage

BASELINE_PARAMETERS = 4
STUB_IMPORT = "from truing.diagnose.simulation import stubs as stage"
# The modules that are compiled upon the stages, each after those that it imports.
KERNEL = (step, rollout, ground)
_WITH_WHEEL = {"drive", "supply", "friction", "push", "gain", "inertia", "gap", "measure", "ground"}
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
    """Writes the stage functions of one catalogue."""

    def __init__(self, catalogue: Catalogue) -> None:
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
            "from truing.diagnose.simulation.jit import compiled",
        ]
        for name, entry in self.entries.items():
            lines.append(f"import {entry.module} as _{name}")
            lines += [f"_{name}_{hook} = compiled(_{name}.{hook})" for hook in entry.hooks]
        for hook in (*STAGES, "slow", "after_step"):
            lines.append(f"USES_{hook.upper()} = {self._uses(hook)}")
        lines.append(f"USES_ANGLE = {self._uses('push', 'angle_start') | self._uses('push', 'angle_end')}")
        speed = self._uses("friction", "speed") | self._uses("supply") | self._uses("coupling")
        lines.append(f"USES_SPEED = {speed}")
        turns = self._uses("friction") | self._uses("scrub")
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
        lines = ["@compiled", f"def {hook}({', '.join(arguments)}):", f"    value = {start}"]
        for name, entry in self.entries.items():
            if hook not in entry.hooks:
                continue
            names = {item: item for item in stage.context}
            if stage.combine == "chain":
                names[stage.context[0]] = "value"
            call = self._call(name, entry, hook, names)
            combined = {
                "sum": f"value += {call}",
                "product": f"value *= {call}",
                "smallest": f"value = min(value, {call})",
                "largest": f"value = max(value, {call})",
                "chain": f"value = {call}",
            }[stage.combine]
            lines += [f"    if active & {1 << self.bit[name]}:", f"        {combined}"]
        return [*lines, "    return value"]

    def _slow_states(self) -> list[str]:
        lines = [
            "@compiled",
            "def slow_states(p, active, dt, heat, draw, elapsed, slows):",
            "    pass",
        ]
        for name, slot in self.slow_slot.items():
            names = {item: item for item in SLOW_CONTEXT} | {"out": f"slows[{slot}]"}
            call = self._call(name, self.entries[name], "slow", names)
            lines += [f"    if active & {1 << self.bit[name]}:", f"        {call}"]
        return lines

    def _after_step(self) -> list[str]:
        lines = [
            "@compiled",
            "def after_step(p, active, wheel, states, h, speed_start, speed_end, travel):",
            "    pass",
        ]
        for name, slot in self.state_slot.items():
            names = {item: item for item in STATE_CONTEXT} | {"state": f"states[{slot}, wheel]"}
            call = self._call(name, self.entries[name], "after_step", names)
            lines += [f"    if active & {1 << self.bit[name]}:", f"        states[{slot}, wheel] = {call}"]
        return lines

    def _call(self, name: str, entry: Entry, hook: str, context: dict[str, str]) -> str:
        """The call of one hook, each argument found by its name."""
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


def _fingerprint(catalogue: Catalogue, stages: str) -> str:
    parts = [stages, *(inspect.getsource(module) for module in (*KERNEL, bodies, rows, jit))]
    parts += [inspect.getsource(sys.modules[entry.module]) for entry in catalogue.entries.values()]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


def _load(name: str, source: str, folder: Path | None) -> ModuleType:
    if name in sys.modules:
        return sys.modules[name]
    if folder is None:
        module = ModuleType(name)
        file = f"<{name}>"
        linecache.cache[file] = (len(source), None, source.splitlines(True), file)
        sys.modules[name] = module
        exec(compile(source, file, "exec"), module.__dict__)
        return module
    path = folder / f"{name}.py"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        fresh = path.with_suffix(f".{os.getpid()}.tmp")
        fresh.write_text(source, encoding="utf-8")
        fresh.replace(path)  # another process may do the same at the same moment
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


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
def kernel_of(catalogue: Catalogue) -> Kernel:
    """The simulation for these effects."""
    stages = _Writer(catalogue).source()
    mark = _fingerprint(catalogue, stages)
    place = os.environ.get("NUMBA_CACHE_DIR")
    folder = Path(place) / "truing_kernels" if place else None
    imports = {STUB_IMPORT: f"import truing_stages_{mark} as stage"}
    stage = _load(f"truing_stages_{mark}", stages, folder)
    found: dict[str, Any] = {}
    for module in KERNEL:
        source = inspect.getsource(module)
        for written, meant in imports.items():
            source = source.replace(written, meant)
        if folder is None:
            source = source.replace("@cached", "@fleeting").replace("import cached", "import fleeting")
        short = module.__name__.rsplit(".", 1)[1]
        name = f"truing_{short}_{mark}"
        found |= vars(_load(name, source, folder))
        imports[f"from {module.__name__} import"] = f"from {name} import"
    return Kernel(
        mark, stage, found["rollout"], found["slow"], found["ground_motion"], found["windowed_motion"]
    )
