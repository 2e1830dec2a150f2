"""Machines and their operating points."""

from __future__ import annotations

from dataclasses import dataclass

from .... import setups
from ..fsw.points import Place


@dataclass(frozen=True)
class Machine:
    """name: in tables; places: operating points, the last one is that of torque steps and wrong
    parameters; modules: of 20 A in parallel, for the losses."""

    name: str
    setup: str
    places: tuple[Place, ...]
    modules: int = 1

    @property
    def base(self) -> setups.Setup:
        return setups.load(self.setup)

    @property
    def place(self) -> Place:
        return self.places[-1]


def _machine(name: str, setup: str, *points: tuple[float, float], modules: int = 1) -> Machine:
    return Machine(name, setup, tuple(Place(setup, *point) for point in points), modules)


#: Each at low and at medium voltage.
MACHINES = (
    _machine("paper A", "paper-a-feasible", (100, 10), (900, 10)),
    _machine("paper B", "paper-b", (1000, 2), (2500, 2)),
    _machine("2 kW, high inductance", "small-2kw", (500, 6.7), (2500, 3.3)),
    _machine("110 kW", "large-110kw", (400, 700), (1200, 350), modules=20),
)
PLACES = tuple(place for machine in MACHINES for place in machine.places)


def machine_of(place: Place) -> Machine:
    return next(machine for machine in MACHINES if place in machine.places)


def label(place: Place) -> str:
    return f"{machine_of(place).name}, {place.speed_rpm:g} r/min, {place.torque_Nm:g} N m"
