"""The catalogue of effects: every file in a folder of effects, found by looking."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType, ModuleType
from typing import Any

from truing.diagnose.effect import Effect
from truing.diagnose.simulation.stages import STAGES

HOOK_NAMES = (*STAGES, "slow", "after_step")


@dataclass(frozen=True, slots=True)
class Entry:
    """An effect, the module that holds it, and its hooks by stage."""

    effect: Effect
    module: str
    hooks: Mapping[str, Callable[..., Any]]


class Catalogue(Mapping[str, Effect]):
    """Effects by name, in the order of their names.

    Parameters
    ----------
    packages : dotted names of packages whose every module is one effect.
    """

    def __init__(self, packages: tuple[str, ...] = ("truing.diagnose.effects",)) -> None:
        entries = [_entry(module) for package in packages for module in _modules(package)]
        self.entries: Mapping[str, Entry] = MappingProxyType(
            {entry.effect.name: entry for entry in sorted(entries, key=lambda item: item.effect.name)}
        )
        if len(self.entries) != len(entries):
            raise ValueError("two files of effects share one name")

    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:
        return id(self)

    def __getitem__(self, name: str) -> Effect:
        return self.entries[name].effect

    def __iter__(self) -> Iterator[str]:
        return iter(self.entries)

    def __len__(self) -> int:
        return len(self.entries)

    @property
    def names(self) -> tuple[str, ...]:
        """All names, in order: an effect's place here is its bit in the simulation."""
        return tuple(self.entries)


def _modules(package: str) -> list[ModuleType]:
    parent = importlib.import_module(package)
    names = sorted(item.name for item in pkgutil.iter_modules(parent.__path__))
    return [importlib.import_module(f"{package}.{name}") for name in names]


def _entry(module: ModuleType) -> Entry:
    effect = module.EFFECT
    hooks = {
        name: function
        for name in HOOK_NAMES
        if callable(function := getattr(module, name, None)) and function.__module__ == module.__name__
    }
    return Entry(effect, module.__name__, MappingProxyType(hooks))


CATALOGUE = Catalogue()
