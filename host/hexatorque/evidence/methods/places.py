"""The operating points of both comparisons, each with the reason why it is there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ... import setups


@dataclass(frozen=True)
class Place:
    """torque_Nm is in the direction of the speed; negative: the machine generates. modules: of 20 A
    in parallel, for the losses."""

    setup: str
    speed_rpm: float
    torque_Nm: float
    modules: int = 1

    @property
    def base(self) -> setups.Setup:
        return setups.load(self.setup)

    @property
    def name(self) -> str:
        """The name of a point on one of the papers' machines."""
        letter = "B" if self.setup == "paper-b" else "A"
        return f"{letter} {self.speed_rpm:g} r/min {self.torque_Nm:g} N m"


A, B = "paper-a-feasible", "paper-b"
#: Where the firmware's schemes are compared.
TWENTY = (
    # The study in which the modulated law was found.
    Place(A, 20, 10),
    Place(A, 100, 10),
    Place(A, 100, 0),
    Place(A, 400, 2),
    Place(A, 400, 10),
    Place(A, 600, -8),
    Place(A, 900, 10),
    Place(A, 1350, 5),
    Place(B, 200, 1),
    Place(B, 1000, 2),
    Place(B, 2500, 0.3),
    Place(B, 2500, 2),
    Place(B, 3500, 2),
    # Points on which the modulated law was not tuned.
    Place(A, -400, 10),  # the other direction
    Place(A, 520, 5),  # 0.3 V_dc, where the carrier begins to turn: neither side of it is typical
    Place(A, 900, 1),  # high voltage at a tenth of the load: THD is relative to a small current
    Place(A, 1150, 10),  # the end of the voltage: above what the virtual vectors reach
    Place(B, -2500, 2),  # the other direction
    Place(B, 3000, -1.5),  # generating at high voltage
    Place(B, 4100, 1),  # overmodulation is near; f1 is high, so a period of f1 has few pulses
)
#: The three of a quick run: low, high and medium voltage.
QUICK = (TWENTY[1], TWENTY[6], TWENTY[11])


@dataclass(frozen=True)
class Machine:
    """name: in tables; places: operating points, the last one is that of torque steps and wrong
    parameters."""

    name: str
    places: tuple[Place, ...]

    @property
    def place(self) -> Place:
        return self.places[-1]


#: Where references are compared too: each machine at low and at medium voltage.
MACHINES = (
    Machine("paper A", (Place(A, 100, 10), Place(A, 900, 10))),
    Machine("paper B", (Place(B, 1000, 2), Place(B, 2500, 2))),
    Machine("2 kW, high inductance", (Place("small-2kw", 500, 6.7), Place("small-2kw", 2500, 3.3))),
    Machine("110 kW", (Place("large-110kw", 400, 700, 20), Place("large-110kw", 1200, 350, 20))),
)
PLACES = tuple(place for machine in MACHINES for place in machine.places)


def label(place: Place) -> str:
    """The name of a point on one of MACHINES."""
    machine = next(machine for machine in MACHINES if place in machine.places)
    return f"{machine.name}, {place.speed_rpm:g} r/min, {place.torque_Nm:g} N m"


def machines_of(places: Iterable[Place]) -> list[Machine]:
    there = set(places)
    return [machine for machine in MACHINES if there & set(machine.places)]
