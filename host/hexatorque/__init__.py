"""hexatorque: switching-table direct torque control of six-phase drives.

The controller is the C firmware in `firmware/`. This package simulates the drive around it
(`SimulatedDrive`), communicates with a board that runs it (`BoardDrive`), loads set-ups (`load`),
makes many runs and one table of them (`Study`), and stores measurements (`Recording`). Everything
else is in the subpackages: `hexatorque.analysis`, `hexatorque.plant`, `hexatorque.setups` and so
on.

The modules of these names are imported at first use, so `import hexatorque` is fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .drive.board import BoardDrive
    from .drive.simulated import SimulatedDrive
    from .errors import HexatorqueError
    from .recording.recording import Recording
    from .setups import load
    from .sweeps.study import Study

__version__ = "0.1.0"

__all__ = ["BoardDrive", "HexatorqueError", "Recording", "SimulatedDrive", "Study", "load"]

#: Module that defines each public name.
_HOMES = {
    "BoardDrive": "drive.board",
    "HexatorqueError": "errors",
    "Recording": "recording.recording",
    "SimulatedDrive": "drive.simulated",
    "Study": "sweeps.study",
    "load": "setups",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value  # the next access does not call this function
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
