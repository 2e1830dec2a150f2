"""Every miswiring is named: first from the matrix of answers alone, then on the machine."""

import numpy as np
import pytest
from campaigns import part

from hexatorque import setups
from hexatorque.commissioning import encoder, wiring
from hexatorque.commissioning.excitation import CommissioningError, Excitation, Limits
from hexatorque.commissioning.regression import Value
from hexatorque.commissioning.resistance import Resistance
from hexatorque.commissioning.sequence import commission
from hexatorque.drive.interface import DriveFault
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.studies.commissioning import Watched, miswirings
from hexatorque.plant.vsd import INVERSE, PHASES, TRANSFORM

STRAIGHT = (1, 2, 3, 4, 5, 6)
LIMIT_A = 6.0


def exchanged(a, b):
    order = list(STRAIGHT)
    order[a - 1], order[b - 1] = b, a
    return tuple(order)


# -- from the matrix -------------------------------------------------------------------------


def answers(leads=STRAIGHT, sensors=STRAIGHT, ab=40.0, xy=85.0, noise=0.01):
    """Slopes of the channels for a wave on each leg, by the definition of the planes."""
    phase = np.array(leads) - 1
    conductance = INVERSE @ np.diag([ab, ab, xy, xy]) @ TRANSFORM
    legs = conductance[phase][:, phase] @ (INVERSE @ TRANSFORM)
    wires = np.array(sensors)
    rows = np.sign(wires)[:, None] * legs[np.abs(wires) - 1]
    return rows + noise * ab * np.random.default_rng(3).standard_normal((6, 6))


def named(words, found):
    return all(any(word in line for line in found.mistakes) for word in words)


@pytest.mark.parametrize("ab, xy", [(40, 85), (40, 60), (100, 300)])
def test_right_wiring_is_right(ab, xy):
    found = wiring.decide(answers(ab=ab, xy=xy))
    assert found.mistakes == ()
    assert found.ab_per_H == pytest.approx(ab, rel=0.05)
    assert found.xy_per_H == pytest.approx(xy, rel=0.05)


@pytest.mark.parametrize("a", STRAIGHT)
@pytest.mark.parametrize("b", STRAIGHT)
def test_each_pair_of_leads_and_each_pair_of_sensors(a, b):
    if a >= b:
        return
    names = PHASES[a - 1], PHASES[b - 1]
    found = wiring.decide(answers(leads=exchanged(a, b)))
    # Not always these two leads: turning the machine's axes may make another pair the same.
    assert len(found.mistakes) == 2 and named(["motor lead"], found)
    found = wiring.decide(answers(sensors=exchanged(a, b)))
    assert found.mistakes == (
        f"current sensor {names[0]}: measures leg {names[1]}",
        f"current sensor {names[1]}: measures leg {names[0]}",
    )


def test_the_named_leads_are_the_remedy():
    """Leads moved as the lines say give a machine without mistakes, for every order."""
    orders = wiring.ORDERS[1:].tolist()
    for order in (orders[k] for k in part(range(len(orders)), 40)):
        found = wiring.decide(answers(leads=[phase + 1 for phase in order]))
        moved = dict.fromkeys(range(6))
        for line in found.mistakes:
            words = line.split()  # motor lead: leg A feeds phase B
            moved[PHASES.index(words[3])] = PHASES.index(words[6])
        # The wire that hangs on the wrong leg goes to the leg of its phase.
        remedied = [0] * 6
        for leg in range(6):
            remedied[leg if moved[leg] is None else moved[leg]] = order[leg] + 1
        assert wiring.decide(answers(leads=remedied)).mistakes == (), (order, found.mistakes)


def test_sign_open_twice_and_gain():
    assert wiring.decide(answers(sensors=(1, -2, 3, 4, 5, 6))).mistakes == (
        "current sensor u2: has the wrong sign",
    )
    assert wiring.decide(answers(sensors=(1, 1, 3, 4, 5, 6))).mistakes == (
        "current sensor u2: measures leg u1",
    )
    dead = answers()
    dead[4] = 0
    assert "v1: reads nothing" in wiring.decide(dead).mistakes[0]
    loud = answers()
    loud[3] *= 1.6
    assert "w2: reads 1.6" in wiring.decide(loud).mistakes[0]


def with_open_leads(response, *legs):
    """What the others answer if these leads are open: the terminal of each takes the voltage at
    which its current is zero."""
    left = [leg for leg in range(6) if leg not in legs]
    to_each = np.linalg.pinv(response[np.ix_(legs, legs)]) @ response[np.ix_(legs, left)]
    cut = np.zeros((6, 6))
    cut[np.ix_(left, left)] = response[np.ix_(left, left)] - response[np.ix_(left, legs)] @ to_each
    return cut


@pytest.mark.parametrize("ab, xy", [(40, 85), (40, 60), (100, 300)])
@pytest.mark.parametrize("leg", range(6))
def test_one_open_lead_is_one_line(leg, ab, xy):
    """The others answer otherwise than in a whole machine, and are not to blame for it."""
    (line,) = wiring.decide(with_open_leads(answers(ab=ab, xy=xy, noise=0), leg)).mistakes
    assert line.startswith(f"leg {PHASES[leg]}: its voltage drives no current: lead open, or")


def test_two_open_leads_of_a_star_are_one_line_and_of_two_stars_are_two():
    (line,) = wiring.decide(with_open_leads(answers(noise=0), 0, 4)).mistakes
    assert line.startswith("legs u1, w1, v1: their voltages drive no current: two of their leads")
    lines = wiring.decide(with_open_leads(answers(noise=0), 0, 3)).mistakes
    assert [line.split(":")[0] for line in lines] == ["leg u1", "leg w2"]


def test_a_mess_is_not_called_right():
    mess = np.random.default_rng(5).standard_normal((6, 6)) * 50
    assert any("fit no order" in line for line in wiring.decide(mess).mistakes)


# -- on the machine --------------------------------------------------------------------------


SETUP = setups.load("paper-a-feasible")
#: What is wrong -> words that the lines must have. All 30 in CI.
MISWIRED = miswirings(SETUP)


def test_there_are_thirty():
    assert len(MISWIRED) == 30


@pytest.mark.parametrize("number", part(range(30), 4))
def test_each_miswiring_is_named_below_the_current_limit(number):
    words, changes = MISWIRED[number]
    sim = Watched(SETUP.changed(sensors__i_noise_A=0.02, inverter__v_switch_V=1.0, **changes))
    limits = Limits(LIMIT_A, 0.1)
    with Excitation(sim, limits, travel_rev=10) as test:
        found = wiring.check(test).mistakes
        if not found:
            found = encoder.check(test, resistance(), 2.0).mistakes
    for word in words:
        assert any(word in line for line in found), found
    assert 0 < sim.largest_A < LIMIT_A


@pytest.mark.parametrize("kind", ("open", "blocked"))
@pytest.mark.parametrize("number", part(range(6), 2))
def test_an_open_lead_and_a_leg_that_does_not_switch_are_one_line_each(number, kind):
    sim = Watched(SETUP.changed(sensors__i_noise_A=0.02, inverter__v_switch_V=1.0))
    sim.break_leg(PHASES[number], kind)
    with Excitation(sim, Limits(LIMIT_A, 0.1), travel_rev=10) as test:
        (line,) = wiring.check(test).mistakes
    assert line.startswith(f"leg {PHASES[number]}: its voltage drives no current")
    assert 0 < sim.largest_A < LIMIT_A


@pytest.mark.parametrize("reversed_too", (False, True))
@pytest.mark.parametrize("kind", ("upper", "lower"))
@pytest.mark.parametrize("number", part(range(6), 2))
def test_a_switch_that_stays_off_is_one_line(number, kind, reversed_too):
    """Its current flows one way only. The other legs' currents are not symmetrical then either, and
    a sensor of the wrong sign does not exchange the switches."""
    wires = [1, 2, 3, 4, 5, 6]
    if reversed_too:
        wires[number] *= -1
    changes = dict(sensors__i_noise_A=0.02, inverter__v_switch_V=1.0, sensors__i_wires=wires)
    sim = Watched(SETUP.changed(**changes))
    sim.break_leg(PHASES[number], kind)
    with Excitation(sim, Limits(LIMIT_A, 0.1), travel_rev=10) as test:
        (line,) = wiring.check(test).mistakes
    assert line.startswith(
        f"leg {PHASES[number]}: its current flows one way only: its {kind} switch stays off"
    )
    assert 0 < sim.largest_A < LIMIT_A


class Slow(SimulatedDrive):
    """A virtual board on a busy computer: from the start on, its time passes slowly."""

    share = 1.0

    def start(self):
        super().start()
        self.share = self.after_start

    def run(self, duration_s, record=True, progress=None):
        super().run(duration_s * self.share, record, progress)


@pytest.mark.parametrize("share", [0.05, 0.0])
def test_a_slow_board_is_waited_for(share):
    sim = Slow(SETUP)
    sim.after_start = share
    limits = Limits(LIMIT_A, 0.1)
    if share:
        with Excitation(sim, limits):
            assert sim.state == "test"
        return
    with pytest.raises(CommissioningError, match="not calibrated its current sensors within 10 s"):
        Excitation(sim, limits).__enter__()
    sim.share = 1.0
    sim.run(0.01)
    assert sim.state == "idle" and sim.get("start_mode") == "drive"


def test_a_shaft_that_a_load_drives_is_no_wrong_wire():
    sim = SimulatedDrive(SETUP)
    sim.load_Nm = 0.2
    with pytest.raises(CommissioningError, match=r"turned by more than 0\.1 revolutions"):
        commission(sim, Limits(LIMIT_A, 0.1), ["wiring"])


def test_each_step_is_told_before_it_and_its_result_after_it():
    told = []
    sim = SimulatedDrive(SETUP)
    commission(sim, Limits(LIMIT_A, 0.1), ["resistance"], report=told.append, begin=told.append)
    firsts = [line.split(":")[0] for line in told]
    assert firsts == ["wiring", "wiring", "resistance", "R_s", "dead time and devices"]


def resistance():
    values = tuple(Value(v, 0.0) for v in [1.84] * 6)
    lost = tuple(Value(v, 0.0) for v in [6.3] * 6)
    return Resistance(values, lost, values[0], lost[0], 0.3, np.empty((0, 2)), 250.0)


@pytest.mark.parametrize("inertia_kgm2", [0.03, 0.4, 3.0])
def test_a_heavy_shaft_is_no_wrong_encoder(inertia_kgm2):
    """A shaft that has not reached the field's speed in the first turns gets as many again. If that
    is too little, too, the command says so and names no mistake."""
    sim = SimulatedDrive(SETUP.changed(machine__inertia_kgm2=inertia_kgm2))
    with Excitation(sim, Limits(LIMIT_A, 0.1), travel_rev=10) as test:
        if inertia_kgm2 > 1:
            with pytest.raises(CommissioningError, match=r"still getting faster.*--turns"):
                encoder.check(test, resistance(), 2.0)
            return
        found = encoder.check(test, resistance(), 2.0)
    assert found.mistakes == ()
    assert found.ratio == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("cause", ("over-current", "link lost"))
def test_what_trips_the_first_pulses_is_told_with_what_may_explain_it(monkeypatch, cause):
    """A short circuit drives a current; a lost line says nothing of it."""

    def trip(test):
        raise DriveFault([cause], 0.1)

    drive = SimulatedDrive(setups.load("small-2kw"), 1)
    monkeypatch.setattr(wiring, "check", trip)
    monkeypatch.setattr(drive, "clear", drive.stop)
    found = commission(drive, Limits(LIMIT_A, 0.1))
    (line,) = found.mistakes
    assert line.startswith(f"{cause} during the first pulses")
    assert ("short circuit" in line) == (cause == "over-current")
