"""hexatorque: switching-table direct torque control of six-phase drives.

The C firmware in `firmware/` is the controller. This package closes the loop around it
(`SimulatedDrive`), talks to a board that runs it (`BoardDrive`), describes set-ups
(`load`) and keeps what comes out (`Recording`). All other rooms have their own modules:
`hexatorque.analysis`, `hexatorque.plant`, `hexatorque.setups` and so on.

The public names load their modules at first use: `import hexatorque` alone is cheap.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .drive.board import BoardDrive
    from .drive.simulated import SimulatedDrive
    from .errors import HexatorqueError
    from .recording.recording import Recording
    from .setups import load

__version__ = "0.1.0"

__all__ = ["BoardDrive", "HexatorqueError", "Recording", "SimulatedDrive", "load"]

#: Where each public name is defined.
_HOMES = {
    "BoardDrive": "drive.board",
    "HexatorqueError": "errors",
    "Recording": "recording.recording",
    "SimulatedDrive": "drive.simulated",
    "load": "setups",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value  # found directly from now on
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
