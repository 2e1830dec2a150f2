"""hexatorque: switching-table direct torque control of six-phase drives.

The controller is the C firmware in `firmware/`. This package loads set-ups (`load`), measures a
drive at an operating point (`measure`), simulates the drive around the firmware step by step
(`SimulatedDrive`), communicates with a board that runs it (`BoardDrive`), makes many runs and one
table of them (`Study`), and stores measurements (`Recording`). Everything else is in the
subpackages: `hexatorque.analysis`, `hexatorque.plant`, `hexatorque.setups` and so on.

The modules of these names are imported at first use, so `import hexatorque` is fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .analysis.run import Run
    from .drive.board import BoardDrive
    from .drive.interface import DriveFault
    from .drive.simulated import SimulatedDrive
    from .errors import HexatorqueError, InputError
    from .experiments.steady import measure
    from .laws.law import Law
    from .recording.recording import Recording
    from .setups import Setup, SetupError, load
    from .sweeps.study import Study

__version__ = "0.2.0"

__all__ = [
    "BoardDrive",
    "DriveFault",
    "HexatorqueError",
    "InputError",
    "Law",
    "Recording",
    "Run",
    "Setup",
    "SetupError",
    "SimulatedDrive",
    "Study",
    "load",
    "measure",
]

#: Module that defines each public name.
_HOMES = {
    "BoardDrive": "drive.board",
    "DriveFault": "drive.interface",
    "HexatorqueError": "errors",
    "InputError": "errors",
    "Law": "laws.law",
    "Recording": "recording.recording",
    "Run": "analysis.run",
    "Setup": "setups",
    "SetupError": "setups",
    "SimulatedDrive": "drive.simulated",
    "Study": "sweeps.study",
    "load": "setups",
    "measure": "experiments.steady",
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
