"""What the remaining phases can carry: the switched inverter and the machine with open windings,
each leg switched by the sign of its current's error. The references are the currents with the
asked-for circle in alpha-beta, from the phases' directions alone."""

import numpy as np
import pytest
from plant_calls import KEEP, NO_LOAD, set_leg, switch

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant.inverter import inverter_record
from hexatorque.plant.legs import BREAK, HIGH, LOW, OPEN
from hexatorque.plant.vsd import PHASES

VDC_V = 250.0
STEP_S = 5e-6
HERTZ = 20.0
AMPLITUDE_A = 2.0
ANGLES_RAD = np.radians([0, 30, 120, 150, 240, 270])
#: Rows: alpha, beta, x, y and the sums of both sets of six phase currents.
ALL = np.array(
    [f(n * ANGLES_RAD) / 3 for n in (1, 5) for f in (np.cos, np.sin)]
    + [[1, 0, 1, 0, 1, 0], [0, 1, 0, 1, 0, 1]]
)


def currents_for(lost, equal_axes):
    """(6, 2): phase currents for 1 A along alpha and along beta, the least that do it. With
    `equal_axes`, the one free current makes the copper loss the same whatever the angle."""
    rows = np.vstack([ALL[[0, 1, 4, 5]], np.eye(6)[lost]])
    wanted = np.zeros((len(rows), 2))
    wanted[0, 0] = wanted[1, 1] = 1
    if equal_axes:
        # Across the lost phase the x-y current is as large as the one in alpha-beta.
        (phase,) = lost
        along = ANGLES_RAD[phase] + np.pi / 2
        rows = np.vstack([rows, np.sin(5 * ANGLES_RAD[phase] + np.pi) * ALL[2]
                          - np.cos(5 * ANGLES_RAD[phase] + np.pi) * ALL[3]])  # fmt: skip
        wanted = np.vstack([wanted, -np.array([np.cos(along), np.sin(along)])])
    found = np.linalg.lstsq(rows, wanted, rcond=None)[0]
    np.testing.assert_allclose(rows @ found, wanted, atol=1e-9)
    return found


@pytest.mark.parametrize(
    ("phases", "equal_axes", "share"),
    [
        ("u1", False, 0.5547),
        ("w2", False, 0.5547),
        ("v1", True, 0.5774),
        ("u2 w1", False, 0.5774),
        ("u1 w1", False, 0.5),
        ("u2 w2 v2", False, 0.5),
        ("u1 u2", False, 0.2887),
        ("u1 w2", False, 0.2887),
    ],
)
def test_the_share_of_the_current_that_is_left(phases, equal_axes, share):
    lost = [PHASES.index(phase) for phase in phases.split()]
    currents = currents_for(lost, equal_axes)
    m = SimulatedDrive(setups.load("paper-a-feasible"))._machine
    inv = inverter_record()
    y = np.zeros(8)
    for leg in range(6):
        set_leg(inv, m, y, leg, LOW)
    for leg in lost:
        set_leg(inv, m, y, leg, BREAK + OPEN)
    period = round(1 / HERTZ / STEP_S)
    flow = np.empty((2 * period, 6))
    legs = np.full((1, 6), KEEP)
    for n in range(len(flow)):
        angle = 2 * np.pi * n / period
        error = currents @ (AMPLITUDE_A * np.array([np.cos(angle), np.sin(angle)]))
        flow[n] = m.i_phase @ y[:6]
        legs[0] = np.where(error > flow[n], HIGH, LOW)
        switch(inv, m, NO_LOAD, y, VDC_V, legs, np.full(1, STEP_S))
        y[6] = 0.0  # a locked shaft
    turn = np.exp(-2j * np.pi * np.arange(period) / period)
    phasors = 2 * turn @ flow[period:] / period
    circle = ALL[:2] @ phasors
    assert np.abs(phasors[lost]).max() < 1e-3
    np.testing.assert_allclose(circle, AMPLITUDE_A * np.array([1, -1j]), atol=0.02)
    assert np.abs(circle).mean() / np.abs(phasors).max() == pytest.approx(share, rel=0.02)
