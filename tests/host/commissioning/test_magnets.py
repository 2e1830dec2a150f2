"""Commissioning of machines with magnets: the arithmetic against formulas of its own, then true
machines that their drives do not know."""

import random

import numpy as np
import pytest
from campaigns import SHARE, WHOLE, part
from scipy.stats import binom

from hexatorque import setups
from hexatorque.cli.board import commission as command
from hexatorque.cli.options import Mistake
from hexatorque.commissioning import alignment, emf, inductance, wiring
from hexatorque.commissioning.excitation import CURRENTS, Excitation, Limits, frame
from hexatorque.commissioning.kinds import KINDS, MAGNET
from hexatorque.commissioning.pictures import pictures
from hexatorque.commissioning.plans import plan
from hexatorque.commissioning.regression import Value
from hexatorque.commissioning.result import set_up
from hexatorque.commissioning.sequence import commission, default_current_A
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.studies.commissioning import disturbed
from hexatorque.setups.loading import parse

BUILT_IN = ("magnet-24v", "magnet-surface", "magnet-interior")

# -- arithmetic ------------------------------------------------------------------------------


def conductance(displacement_deg, ld_H, lq_H, lxy_H, rotor_deg):
    """1/H between the phases, from the inductances that two coils at any angles have: the planes'
    by the angle between them, a salient rotor's by where they lie to it."""
    at = np.deg2rad([0, 0, 120, 120, 240, 240] + displacement_deg * np.array([0, 1] * 3))
    sets = np.array([1, -1] * 3)
    rotor = np.deg2rad(rotor_deg)
    mean, half = 0.5 * (1 / ld_H + 1 / lq_H), 0.5 * (1 / ld_H - 1 / lq_H)
    apart, about = at[:, None] - at[None, :], at[:, None] + at[None, :] - 2 * rotor
    across = np.outer(sets, sets) * np.cos(apart) / lxy_H
    star = np.equal.outer(sets, sets) / 3  # what the free star points take away
    return (mean * np.cos(apart) + half * np.cos(about) + across) / 3 @ (np.eye(6) - star)


@pytest.mark.parametrize("displacement_deg", wiring.DISPLACEMENTS_DEG)
@pytest.mark.parametrize(("ld_mH", "lq_mH"), [(6.4, 17.4), (17.4, 6.4), (2.1, 2.1)])
def test_a_winding_is_told_from_others_at_any_angle_of_its_rotor(displacement_deg, ld_mH, lq_mH):
    for rotor_deg in (0.0, 40.0, 100.0):
        rows = conductance(displacement_deg, ld_mH * 1e-3, lq_mH * 1e-3, 0.9e-3, rotor_deg)
        left = {
            deg: wiring.fit(
                rows, np.arange(6), wiring.shapes(frame(deg), True), wiring.ORDERS[:1]
            ).unexplained[0]
            for deg in wiring.DISPLACEMENTS_DEG
        }
        assert left[displacement_deg] < 1e-9
        assert all(left[deg] > wiring.UNEXPLAINED for deg in left if deg != displacement_deg)
        found = wiring.decide(rows, wiring.shapes(frame(displacement_deg), True))
        assert found.mistakes == ()
        ends = sorted(1e3 / (found.ab_per_H + way * found.salient_per_H) for way in (1, -1))
        assert ends == pytest.approx(sorted((ld_mH, lq_mH)))


@pytest.mark.parametrize(("ld_H", "lq_H"), [(6.4e-3, 17.4e-3), (17.4e-3, 6.4e-3)])
@pytest.mark.parametrize("rotor_deg", [(0.0, 0.0), (12.0, -9.0), (-20.0, -15.0)])
def test_both_inductances_although_the_rotor_stands_aside(ld_H, lq_H, rotor_deg):
    """Slopes of the currents by the inverse of the turned inductance, in each wave of its own."""
    found = []
    for axis, deg in enumerate(rotor_deg):
        c, s = np.cos(np.deg2rad(deg)), np.sin(np.deg2rad(deg))
        turn = np.array([[c, -s], [s, c]])
        slopes = (turn @ np.diag([1 / ld_H, 1 / lq_H]) @ turn.T)[:, axis]
        found.append((Value(slopes[axis], 0.01), Value(slopes[1 - axis], 0.01)))
    ld, lq, off_deg = inductance.salient(found)
    assert (ld.value, lq.value) == pytest.approx((ld_H, lq_H), rel=1e-6)
    assert off_deg == pytest.approx(rotor_deg, abs=1e-4)


def test_an_inductance_that_the_firmware_refuses():
    def coils(ld_H, lq_H):
        return inductance.Salient(Value(ld_H, 1e-5), Value(lq_H, 1e-5), Value(1e-3, 0), (0, 0))

    assert coils(2.2e-3, 2.0e-3).too_much and not coils(2.05e-3, 2.0e-3).too_much
    ld, lq = coils(2.05e-3, 2.0e-3).usable()
    assert ld == lq and ld.value == pytest.approx(2.025e-3) and ld.uncertainty >= 2.5e-5


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("begins", [17, 2**32 - 5000])
@pytest.mark.parametrize(("friction_deg", "cogging_deg"), [(0.0, 0.0), (3.0, 0.0), (2.0, 1.5)])
def test_the_zero_of_an_encoder(way, begins, friction_deg, cogging_deg):
    """A rotor that friction keeps behind and teeth pull aside: twelve times in an electrical turn,
    7.2 times, or six times."""
    pairs, counts_rev, zero_deg = 5, 8192, 40.0
    stops = 360.0 * np.array(alignment.STOPS)
    for periods in (12, 7.2, 6):
        rows = []
        for k, asked in enumerate((*stops, *stops[::-1])):
            behind = friction_deg if k < len(stops) else -friction_deg
            pulled = cogging_deg * np.sin(periods * np.deg2rad(asked) + 1.0)
            angle = asked - behind + pulled + 2.0  # the current lies 2 degrees beside its command
            count = begins + round(way * (angle - 50.0) / 360 * counts_rev / pairs)
            rows.append((asked, count % 2**32, 2.0))
        found = alignment.solve(np.array(rows), pairs, counts_rev)
        if way < 0:
            assert "counts backwards" in found.mistakes[0]
            continue
        zero_deg = 50.0 - begins * 360 * pairs / counts_rev
        off = (found.zero_deg.value - zero_deg + 180) % 360 - 180
        assert abs(off) < 0.1 + 0.4 * cogging_deg
        assert abs(off) < found.zero_deg.uncertainty
        assert found.friction_deg == pytest.approx(friction_deg, abs=0.1)


@pytest.mark.parametrize(("pairs", "counts_rev"), [(4, 8192), (5, 4096)])
def test_counts_that_do_not_fit_are_named(pairs, counts_rev):
    asked = 360.0 * np.array(alignment.STOPS * 2)
    rows = np.column_stack([asked, np.round(asked / 360 * 8192 / 5), np.zeros(14)])
    assert "times the number by" in alignment.solve(rows, pairs, counts_rev).mistakes[0]


def emf_table(omega, psi_f, shares, id_A, corner, aside_deg, delay):
    """What a drive would capture of a machine that turns steadily: voltages in x-y by the flux that
    a period changes, the observer's flux by its differential equation's solution."""
    dt, n, ld, lq, lxy, rs, believed = 1e-4, 1800, 6e-3, 15e-3, 1e-3, 0.8, 1.05 * psi_f
    t = np.arange(n + 3) * dt
    u = np.exp(1j * omega * t)
    i_ab = id_A * u
    i_xy = 0.3 * np.exp(5j * omega * t) + 0.1j
    e5, e7 = (s * np.exp(1j * np.deg2rad(d)) for s, d in shares)
    flux = psi_f * (e5 / 5 * u**5 + (e7 / 7 * u**7).conj()) + lxy * i_xy
    v_mean = np.diff(flux) / dt + rs * 0.5 * (i_xy[1:] + i_xy[:-1])
    r_true = (psi_f + (ld - lq) * id_A) * u
    r_model = (believed + (ld - lq) * id_A) * u * np.exp(1j * np.deg2rad(aside_deg))
    psi = r_true + corner / (corner + 1j * omega) * (r_model - r_true) + lq * i_ab
    planes = np.column_stack([i_ab.real, i_ab.imag, i_xy.real, i_xy.imag])
    table = np.column_stack([planes @ frame(30.0).inverse.T, psi.real, psi.imag])[:n]
    command = v_mean[delay:][:n] / 300.0
    table = np.column_stack([table, command.real, command.imag, np.full(n, 300.0)])
    assert table.shape[1] == len(emf.CHANNELS) == len(CURRENTS) + 5
    machine = emf.Machine(rs, ld, lq, lxy, frame(30.0), delay)
    return emf.reading(table, dt, machine, corner, believed)


@pytest.mark.parametrize("delay", [0, 1])
def test_flux_and_harmonics_of_a_machine_that_turns(delay):
    """The drive believes 5 % too much flux, and the rotor 4 degrees aside."""
    shares, omega = ((0.04, 30.0), (0.02, -110.0)), 500.0
    readings = [
        emf_table(omega, 0.17, shares, -4.0, share * omega, 4.0, delay) for share in emf.CORNERS
    ]
    found = emf.solve(readings, 0.0)
    assert found.psi_f_Wb.value == pytest.approx(0.17, rel=1.5e-3)  # the corner's square is left
    assert abs(readings[0].psi_f_Wb / 0.17 - 1) > 5e-3  # one corner alone does not tell
    for k, (share, degrees) in enumerate(shares):
        assert found.share(k).value == pytest.approx(share, rel=0.01)
        # Angles count from where the rotor is seen: corner times 4 degrees, five or seven times.
        assert found.degrees(k).value == pytest.approx(degrees, abs=4.0)
    assert emf.solve(readings, None).harmonics == ()


# -- kinds -----------------------------------------------------------------------------------


def test_each_kind_has_needs_plans_and_an_order():
    for kind in KINDS:
        assert kind.steps.keys() == kind.needs.keys()
        order = list(kind.steps)
        for step, needs in kind.needs.items():
            assert all(order.index(need) < order.index(step) for need in needs)
        assert kind.whole in kind.steps
    sim = SimulatedDrive(setups.load("magnet-surface"), 2)
    for step in MAGNET.steps:
        assert all(plan(sim, Limits(8.0, 0.1), step, 3.0))
    with pytest.raises(Exception, match="no step 'rotor' for a machine of the kind magnet"):
        commission(sim, Limits(8.0, 0.1), ("rotor",))


def test_a_user_agrees_that_the_shaft_turns():
    sim = SimulatedDrive(setups.load("magnet-surface"), 2)
    with pytest.raises(Mistake, match=r"alignment: the shaft TURNS at once .* agree with --yes"):
        command._agreed(sim, Limits(8.0, 0.1), 3.0, MAGNET.asks)


# -- true machines ---------------------------------------------------------------------------

#: What the controller knows is the built-in machine, and nothing of the harmonics and the angle.
UNKNOWN = (
    "emf5_share", "emf5_deg", "emf7_share", "emf7_deg", "drop_V", "rotor_zero_deg",
)  # fmt: skip
OF_THE_TIMING = ("load_mode", "predict", "write_delay_us", "dead_time_us", "min_pulse_us")


def drawn(name, number, **changes):
    """A drive of a machine that it does not know, with friction and cogging, and all that disturbs.
    Below 100 V the devices are MOSFETs."""
    draw = random.Random(number)
    plain = setups.load(name)
    keys = ("rs_ohm", "ld_H", "lq_H", "lxy_H", "psi_f_Wb", "inertia_kgm2")
    true = {f"machine.{k}": plain[f"machine.{k}"] * draw.uniform(0.85, 1.15) for k in keys}
    if plain["machine.lq_H"] < 1.1 * plain["machine.ld_H"]:
        true["machine.lq_H"] = true["machine.ld_H"] * draw.uniform(1.0, 1.03)
    rs_ohm = plain["machine.rs_ohm"]
    known = {
        f"controller.{k}": v for k, v in plain.controller_values().items() if k not in OF_THE_TIMING
    }
    setup = plain.changed(
        **{
            **true,
            "machine.start_deg": draw.uniform(-180, 180),
            "machine.cogging_Nm": plain["rated.torque_Nm"] * draw.uniform(0, 0.02),
            "machine.drs_ohm": [rs_ohm * draw.uniform(-0.03, 0.03) for _ in range(6)],
            "machine.emf_share": [draw.uniform(0, most) for most in (0.05, 0.03, 0.01, 0.005)],
            "machine.emf_deg": [draw.uniform(-180, 180) for _ in range(4)],
            **known,
            **{f"controller.{k}": 0.0 for k in UNKNOWN},
            "controller.scheme": "db-dtfc",
            "controller.rotor_start": "known",
        }
    )
    setup = disturbed(setup, number)
    if setup["inverter.vdc_V"] < 100:
        setup = setup.changed(inverter__v_switch_V=0.0, inverter__v_diode_V=0.0)
    setup = setup.changed(**changes)
    sim = SimulatedDrive(setup, 2)
    sim.load_Nm = 0.02 * setup["rated.torque_Nm"]
    return sim


class Board(SimulatedDrive):
    """A drive whose samples take a time to come, as over a line, while it goes on."""

    def captured(self, *arguments, **named):
        found = super().captured(*arguments, **named)
        self.run(0.1, record=False)
        return found


@pytest.mark.parametrize("asked, least_A, most_A", [({"then_V": None}, 0.5, 5.0), ({}, 0.0, 0.2)])
def test_no_wave_swings_the_rotor_while_samples_come(asked, least_A, most_A):
    """Unless it is to stay on. Currents decay with L_q/R_s, 22 ms at most."""
    sim = Board(setups.load("magnet-interior"), 2)
    with Excitation(sim, Limits(5.0, 0.1)) as test:
        wave = test.pulse(np.array([20.0, 0, 0, 0]), "square", 500.0, 0.012, **asked)
        left_A = []
        for _ in range(20):
            sim.run(sim.period_s, record=False)
            left_A += [abs(sim.controller.channel(name)) for name in CURRENTS]
    assert np.abs(wave.i_A).max() > 1.0
    assert least_A <= max(left_A) <= most_A


def commissioned(sim, steps=None, turns=1.0):
    return commission(sim, Limits(default_current_A(sim), 0.1), steps, turns)


def inside(sim, found):
    """Name -> whether the true value is within what is stated. The angle of a harmonic that is no
    larger than its doubt is not told."""
    m, setup = sim.machine, sim.setup
    devices = 0.5 * (setup["inverter.r_switch_ohm"] + setup["inverter.r_diode_ohm"])
    phases = m.rs_ohm + np.array(m.drs_ohm) + devices
    true = {
        "rs_ohm": phases.mean(), "ld_H": m.ld_H, "sigma_ls_H": m.lq_H, "lxy_H": m.lxy_H,
        "psi_f_Wb": m.psi_f_Wb, "rotor_zero_deg": m.start_deg,
        "emf5_share": m.emf_share[0], "emf7_share": m.emf_share[1],
        "emf5_deg": m.emf_deg[0], "emf7_deg": m.emf_deg[1],
    }  # fmt: skip
    values = found.parameters(sim)
    rows = {}
    for name, value in true.items():
        if name not in values or values[name].uncertainty > 57:
            continue
        off = values[name].value - value
        if name.endswith("deg"):
            off = (off + 180) % 360 - 180
        rows[name] = abs(off) <= values[name].uncertainty
    for k, phase in enumerate(found.resistance.rs_ohm):
        rows[f"phase {k}"] = abs(phase.value - phases[k]) <= phase.uncertainty
    return rows


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"machine__displacement_deg": 0}, "winding: its sets are 0 degrees apart"),
        ({"machine__displacement_deg": 60}, "set displacement_deg = 60"),
        ({"machine__leads": [2, 1, 4, 3, 6, 5]}, "motor lead: leg w1 feeds"),
        ({"machine__leads": [1, 4, 5, 2, 3, 6]}, "motor lead: leg u2 feeds"),
        ({"sensors__i_wires": [-1, 2, 3, 4, 5, 6]}, "current sensor u1: has the wrong sign"),
    ],
)
@pytest.mark.parametrize("name", part(BUILT_IN, 1))
def test_wrong_wiring_is_named(name, changes, words):
    found = commissioned(drawn(name, 5, **changes), ("wiring",))
    assert words in found.mistakes[0]


@pytest.mark.parametrize("displacement_deg", ["0", "60"])
def test_sets_of_other_windings_are_right_where_the_drive_knows_them(displacement_deg):
    changes = {
        "machine__displacement_deg": int(displacement_deg),
        "controller__displacement_deg": displacement_deg,
    }
    assert commissioned(drawn("magnet-24v", 5, **changes), ("wiring",)).mistakes == []


WRONG_ENCODERS = (
    ({"sensors__encoder_wires": "swapped"}, "encoder: counts backwards"),
    ({"controller__pole_pairs": 4}, "5 pole pairs, would fit"),
    ({"sensors__encoder_wires": "open"}, "encoder: counts nothing"),
)


@pytest.mark.parametrize(
    ("changes", "words"), [WRONG_ENCODERS[k] for k in part(range(len(WRONG_ENCODERS)), 1)]
)
def test_a_wrong_encoder_is_named(changes, words):
    sim = drawn("magnet-24v", 5, **changes)
    before = sim.get("rotor_zero_deg")
    found = commissioned(sim, ("alignment",))
    assert words in found.mistakes[0]
    assert sim.state == "idle" and sim.get("rotor_zero_deg") == before


@pytest.mark.parametrize("direction", ["same", "reversed"])
def test_the_angle_at_the_absolute_encoders_zero_is_measured(direction):
    sim = drawn(
        "magnet-24v", 5, sensors__absolute_counts_rev=4096, sensors__absolute_deg=77.0,
        sensors__absolute_direction=direction, controller__rotor_start="absolute",
        controller__absolute_counts_rev=4096, controller__absolute_direction=direction,
    )  # fmt: skip
    found = commissioned(sim, ("alignment",))
    assert found.mistakes == []
    zero = found.parameters(sim)["rotor_zero_deg"]
    true_deg = sim.machine.start_deg + sim.machine.pole_pairs * 77.0
    assert abs((zero.value - true_deg + 180) % 360 - 180) <= zero.uncertainty < 2.0


def test_an_index_that_has_not_passed_teaches_no_angle():
    found = alignment.Alignment((), 1.0, alignment.Value(100.0, 0.3))
    there = alignment.from_zero(found, 0.5, 300.0, 0.8)
    assert there.zero_known and there.zero_deg.value == pytest.approx(100 + 150 - 360)
    assert there.zero_deg.uncertainty == pytest.approx(0.5)
    assert not alignment.from_zero(found, 0.5, -1.0, 0.0).zero_known


@pytest.mark.skipif(not SHARE, reason="a commissioning up to the inductances: HT_WHOLE runs it")
def test_a_rotor_that_is_salient_the_other_way_is_measured_and_refused():
    sim = drawn("magnet-surface", 5, machine__lq_H=1.7e-3)
    found = commissioned(sim, ("magnets",))
    assert "the firmware drives magnets with L_d up to L_q" in found.mistakes[0]
    assert found.salient.ld_H.value == pytest.approx(sim.machine.ld_H, rel=0.02)
    assert found.salient.lq_H.value == pytest.approx(1.7e-3, rel=0.02)
    assert found.emf is None


def test_a_machine_with_magnets_is_measured_and_written():
    sim = drawn("magnet-24v", 2)
    found = commissioned(sim, ("magnets",))
    assert found.mistakes == []
    held = inside(sim, found)
    assert sum(held.values()) >= 0.85 * len(held), held
    for step in MAGNET.with_needs(("magnets",)):
        assert pictures(step, found)
    written = parse(set_up(found, sim, "f28377s", "found"), "found")
    assert written["machine.model"] == "magnet"
    assert written["machine.psi_f_Wb"] == pytest.approx(sim.machine.psi_f_Wb, rel=0.01)
    assert written["machine.lq_H"] == pytest.approx(sim.machine.lq_H, rel=0.02)
    assert written.values["machine"]["ld_H"].tag == "measured"
    # The drive believed in weaker magnets: its own speed trip is above the true ones' ceiling.
    ceiling_rpm = sim.machine.ceiling_rpm(sim.setup["inverter.vdc_V"])
    assert written["controller.speed_trip_rpm"] < ceiling_rpm < float(sim.get("speed_trip_rpm"))
    # The angle is right: the drive starts with it, and its torque turns the shaft as asked.
    sim.set_many({"speed_ref_rpm": 300.0, "control_mode": "speed", "start_mode": "drive"})
    sim.start()
    sim.run(4.5)
    assert sim.state == "run"
    assert sim.plant_state[6] * 30 / np.pi == pytest.approx(300.0, rel=0.02)


@pytest.mark.skipif(not SHARE, reason="commissionings: HT_WHOLE runs 3 of 42, HT_WHOLE=1 all")
def test_what_is_stated_holds_the_truth_in_nine_of_ten_cases():
    rows = []
    for number in range(100, 142 if WHOLE else 103):  # each takes 15 s
        sim = drawn(BUILT_IN[number % 3], number)
        rows.append(inside(sim, commissioned(sim, ("magnets",))))
    # Fewer than nine of ten may be chance, but not so few that chance has them once in a hundred.
    for name in rows[0]:
        of = [row[name] for row in rows if name in row]
        assert binom.cdf(sum(of), len(of), 0.9) > 0.01, name
