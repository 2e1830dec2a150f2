"""Mean squares of the currents over a period, against the machine's equations in its phases.

The reference knows no planes of the firmware. It solves for each state of the legs

    L di/dt = v - the neutrals' voltages,   each set's currents add up to 0,

with the inductances between the phases and the two neutrals' voltages unknown, count by count."""

import numpy as np
import pytest

from hexatorque.firmware import ffi, lib

LEGS = 6
COUNTS, DEAD = 4000, 120
TS_S, VDC_V = 1e-4, 310.0
SET2 = np.array([0, 1, 0, 1, 0, 1])  # u1 u2 w1 w2 v1 v2
#: Displacement of the sets, degrees -> the firmware's name of it.
WINDINGS = {30: lib.HT_WINDING_30, 0: lib.HT_WINDING_0, 60: lib.HT_WINDING_60}
INDUCTION = {"ld_H": 6e-3, "lq_H": 6e-3, "lxy_H": 2.5e-3}
SALIENT = {"ld_H": 5e-3, "lq_H": 14e-3, "lxy_H": 1.5e-3}


def phase_angles(displacement):
    return np.deg2rad([0, displacement, 120, 120 + displacement, 240, 240 + displacement])


def slopes(displacement, machine, axis_rad, off):
    """(6, 6): di/dt of the phases over the voltages of the legs."""
    at = phase_angles(displacement)
    rotor = np.array([np.cos(at - axis_rad), -np.sin(at - axis_rad)]) / np.sqrt(3)
    own = np.diag([machine["ld_H"] - machine["lxy_H"], machine["lq_H"] - machine["lxy_H"]])
    inductance = machine["lxy_H"] * np.eye(LEGS) + rotor.T @ own @ rotor
    given = np.array([1 - SET2, SET2] + [np.eye(LEGS)[leg] for leg in off], float)
    n = len(given)
    # Unknown: di/dt, the neutrals' voltages, and what the voltage of a leg that is off lacks.
    system = np.block([[inductance, given.T], [given, np.zeros((n, n))]])
    right = np.vstack([np.eye(LEGS), np.zeros((n, LEGS))])
    return np.linalg.lstsq(system, right, rcond=None)[0][:LEGS]


def levels(before, first, start, ca, cb, from_A, to_A):
    """(6, COUNTS): whether each leg is high, with edges that are late where the current says so."""
    high = np.zeros((LEGS, COUNTS), bool)
    for leg in range(LEGS):
        commanded = np.empty(COUNTS, bool)
        commanded[:first] = before[leg]
        commanded[first:] = start[leg]
        for at in (ca[leg], cb[leg]):
            commanded[at:] ^= True
        outward = from_A[leg] + to_A[leg] > 0
        level, pending, was = before[leg], None, before[leg]
        for t in range(COUNTS):
            if commanded[t] != was:
                was = commanded[t]
                pending = t + (DEAD if was == outward else 0)
            if pending == t:
                level, pending = was, None
            high[leg, t] = level
    return high


def reference(p, displacement, machine, axis_rad, off):
    high = levels(p["before"], p["first"], p["start"], p["ca"], p["cb"], p["from"], p["to"])
    slope = slopes(displacement, machine, axis_rad, off) @ (VDC_V * high) * TS_S / COUNTS
    drift = (p["to"] - p["from"])[:, None] / COUNTS
    change = slope - slope.mean(axis=1, keepdims=True) + drift
    i = p["from"][:, None] + np.hstack([np.zeros((LEGS, 1)), np.cumsum(change, axis=1)])
    a, b = i[:, :-1], i[:, 1:]
    return np.mean((a * a + a * b + b * b) / 3, axis=1), i


def currents(rng, displacement, off):
    """Six that the machine may have, none near to zero."""
    at = phase_angles(displacement)
    while True:
        i = rng.uniform(4, 9) * np.cos(at - rng.uniform(0, 6.3)) + rng.uniform(-1, 1, LEGS)
        i[off] = 0.0
        if np.all(np.abs(np.delete(i, off)) > 0.8):
            return i


def pattern(rng, kind, first):
    """Registers of one period, and the legs' states before it."""
    p = {"first": first, "ca": np.full(LEGS, COUNTS), "cb": np.full(LEGS, COUNTS)}
    room = 4 * DEAD
    p["before"], p["start"] = rng.random(LEGS) < 0.5, rng.random(LEGS) < 0.5
    if kind == "words":  # two instants for all
        t1 = rng.integers(first + room, COUNTS // 2)
        t2 = rng.integers(t1 + room, COUNTS - room)
        p["ca"][rng.random(LEGS) < 0.5] = t1
        p["cb"][rng.random(LEGS) < 0.5] = t2
    elif kind == "toggles":  # each leg has one of its own, and none at the start
        p["start"] = p["before"].copy()
        moves = rng.random(LEGS) < 0.8
        p["ca"][moves] = rng.integers(room, COUNTS - room, LEGS)[moves]
    elif kind == "pulses":
        p["ca"] = rng.integers(first + room, COUNTS // 2 - room, LEGS)
        p["cb"] = rng.integers(COUNTS // 2 + room, COUNTS - room, LEGS)
    else:
        assert kind == "still"
        p["start"] = p["before"].copy()
    return p


def word(legs):
    return int(sum(int(high) << (LEGS - 1 - leg) for leg, high in enumerate(legs)))


def firmware_squares(p, displacement, machine, axis_rad, off, magnets):
    look, circuit = ffi.new("ht_look *"), ffi.new("ht_look_circuit *")
    observer = ffi.new("ht_observer_config *")
    period, dead = ffi.new("ht_period *"), ffi.new("ht_dead_time *")
    observer.ts_s, observer.winding, observer.rotor = TS_S, WINDINGS[displacement], int(magnets)
    observer.inv_sigma_ls = 1 / machine["lq_H"]
    observer.magnet.inv_ld = 1 / machine["ld_H"]
    period.counts, period.first = COUNTS, p["first"]
    dead.dead_pu, dead.i_zero_A = DEAD / COUNTS, 0.2
    circuit.machine, circuit.period, circuit.dead = observer, period, dead
    circuit.lxy_H, circuit.vdc_V, circuit.off_legs = (
        machine["lxy_H"],
        VDC_V,
        word(np.isin(np.arange(LEGS), off)),
    )
    # The states before tell themselves by the pattern before: here by toggles within it.
    toggled = np.arange(LEGS) % 2 == 1
    look.pattern[0].start = word(p["before"] ^ toggled)
    look.pattern[1].start = word(p["start"])
    for leg in range(LEGS):
        look.pattern[0].ca[leg] = 700 if toggled[leg] else COUNTS
        look.pattern[0].cb[leg] = COUNTS
        look.pattern[1].ca[leg], look.pattern[1].cb[leg] = p["ca"][leg], p["cb"][leg]
        look.i_A[0].p[leg], look.i_A[1].p[leg] = p["from"][leg], p["to"][leg]
    look.axis.alpha, look.axis.beta = np.cos(axis_rad), np.sin(axis_rad)
    found = ffi.new("ht_six *")
    lib.ht_look_squares(look, circuit, found)
    return np.array(list(found.p))


CASES = [
    (30, INDUCTION, []), (0, INDUCTION, []), (60, INDUCTION, []), (30, SALIENT, []),
    (60, SALIENT, []), (30, INDUCTION, [2]), (30, INDUCTION, [0, 5]), (30, INDUCTION, [0, 2, 4]),
    (0, INDUCTION, [1]),
]  # fmt: skip


@pytest.mark.parametrize("kind", ("words", "toggles", "pulses", "still"))
@pytest.mark.parametrize("first", (0, 300))
@pytest.mark.parametrize(("displacement", "machine", "off"), CASES)
def test_mean_squares_are_those_of_the_machines_equations(displacement, machine, off, kind, first):
    rng = np.random.default_rng(len(kind) + first + displacement + len(off))
    magnets = machine is SALIENT
    missed = 0.0
    for _ in range(6):
        p = pattern(rng, kind, first)
        p["from"] = currents(rng, displacement, off)
        p["to"] = currents(rng, displacement, off) if rng.random() < 0.3 else 1.1 * p["from"]
        # Where a current turns round within the period its sign at an edge is not told.
        p["to"] = np.where(p["to"] * p["from"] > 0, p["to"], p["from"])
        axis_rad = rng.uniform(0, 6.3)
        expected, i = reference(p, displacement, machine, axis_rad, off)
        found = firmware_squares(p, displacement, machine, axis_rad, off, magnets)
        assert found == pytest.approx(expected, rel=2e-3, abs=2e-3), (p, i[:, ::500])
        missed = max(missed, np.abs(p["from"] ** 2 - expected).max())
    assert missed > 2.0  # what a sample's square is off by
