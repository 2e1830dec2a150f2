"""Machine models. Each is a module that provides what `plant.machine` demands."""

from __future__ import annotations

from dataclasses import fields
from importlib import import_module
from types import ModuleType
from typing import Any

#: Name in the set-up's key `machine.model` -> module of this folder, and the one that has its class
#: of constants, `Parameters`, which needs no installed package.
MODELS = {
    "induction": ("induction", "induction_parameters"),
    "magnet": ("magnet", "magnet_parameters"),
}

#: Displacements of set 2 that are driven, electrical degrees, in the order of the firmware's
#: ht_winding.
DISPLACEMENTS_DEG = (30, 0, 60)


def model(name: str) -> ModuleType:
    return import_module(f".{MODELS[name][0]}", __name__)


def parameters_of(name: str) -> Any:
    """The class of a model's constants."""
    return import_module(f".{MODELS[name][1]}", __name__).Parameters


def constants_of(name: str) -> set[str]:
    """The names of a model's constants, which are its keys of the set-up's section [machine]."""
    return {field.name for field in fields(parameters_of(name))}
