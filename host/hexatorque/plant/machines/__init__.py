"""Machine models. Each is a module that provides what `plant.machine` demands."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

#: Name in the set-up's key `machine.model` -> module of this folder.
MODELS = {"induction": "induction", "magnet": "magnet"}


def model(name: str) -> ModuleType:
    return import_module(f".{MODELS[name]}", __name__)
