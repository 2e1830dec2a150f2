"""The operating points, each with the reason why it is there."""

from __future__ import annotations

from dataclasses import dataclass

from .... import setups


@dataclass(frozen=True)
class Place:
    """torque_Nm is in the direction of the speed; negative: the machine generates."""

    setup: str
    speed_rpm: float
    torque_Nm: float

    @property
    def name(self) -> str:
        letter = "B" if self.setup == "paper-b" else "A"
        return f"{letter} {self.speed_rpm:g} r/min {self.torque_Nm:g} N m"


A, B = "paper-a-feasible", "paper-b"
PLACES = (
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
QUICK = (PLACES[1], PLACES[6], PLACES[11])


def setup_of(place: Place) -> setups.Setup:
    return setups.load(place.setup)
