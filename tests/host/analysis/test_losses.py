"""Losses and dc-link current of currents and edges whose figures are known from a formula."""

import numpy as np
import pytest

from hexatorque import load
from hexatorque.analysis import metrics
from hexatorque.analysis.losses import balance, bridge, copper_loss_W
from hexatorque.experiments.operating_points import Point, measure
from hexatorque.plant.edges import Edges
from hexatorque.plant.legs import HIGH, LOW, OFF
from hexatorque.plant.vsd import ANGLES_RAD, PHASES
from hexatorque.recording.recording import Recording

RATE_HZ = 20_000.0
PEAK_A = 3.0
F1_HZ = 50.0


def recording(phases_A, inverter=None, machine=None, vdc_V=300.0) -> Recording:
    channels = {f"plant.i_{phase}_A": i for phase, i in zip(PHASES, phases_A, strict=True)}
    channels["vdc_V"] = np.full(len(phases_A[0]), vdc_V)
    return Recording(
        RATE_HZ,
        channels,
        meta={"parameters": {"inverter": inverter or {}, "machine": machine or {}}},
    )


def sines(cycles=20):
    """Six phases over whole cycles, first and last sample at the same phase."""
    t = np.arange(round(cycles / F1_HZ * RATE_HZ) + 1) / RATE_HZ
    return np.array([PEAK_A * np.cos(2 * np.pi * F1_HZ * t - angle) for angle in ANGLES_RAD])


def edges_of(start, rows) -> Edges:
    """rows: (time, leg, new state)."""
    time_s, leg, state = zip(*sorted(rows), strict=True)
    return Edges(np.array(start), np.array(time_s), np.array(leg), np.array(state))


def direct(amperes, duration_s=0.1):
    return np.repeat(np.array(amperes, float)[:, None], round(duration_s * RATE_HZ) + 1, axis=1)


def test_copper_loss_of_sines():
    """6 R I^2/2; and a phase with a resistance of its own counts with that."""
    i = sines()[:, :-1]
    rec = recording(i, machine={"rs_ohm": 1.5})
    assert copper_loss_W(rec) == pytest.approx(6 * 1.5 * PEAK_A**2 / 2)
    rec = recording(i, machine={"rs_ohm": 1.5, "drs_ohm": [0.3, 0, 0, 0, 0, 0]})
    assert copper_loss_W(rec) == pytest.approx((6 * 1.5 + 0.3) * PEAK_A**2 / 2)
    assert np.isnan(copper_loss_W(recording(i)))


@pytest.mark.parametrize("duty", [0.137, 0.5, 0.9])
def test_dc_link_current_of_a_chopper(duty):
    """Leg 0 carries I out for a share D of every period, leg 2 returns it below: mean D I, rms
    without the mean I sqrt(D (1 - D)), whatever the samples see of the edges."""
    period_s = 1 / 7000
    rows = []
    for n in range(700):
        rows += [(n * period_s, 0, HIGH), ((n + duty) * period_s, 0, LOW)]
    figures = bridge(recording(direct([4, 0, -4, 0, 0, 0])), edges_of([LOW] * 6, rows))
    assert figures["idc_A"] == pytest.approx(4 * duty)
    assert figures["idc_ripple_A"] == pytest.approx(4 * np.sqrt(duty * (1 - duty)))
    assert np.isnan(figures["conduction_loss_W"]) and np.isnan(figures["switching_loss_W"])


def test_while_both_switches_are_off_the_current_chooses_the_diode():
    """Out of the leg: the lower diode, nothing from the dc link. Into the leg: the upper one."""
    edges = Edges(np.full(6, OFF), *(np.empty(0, int) for _ in range(3)))
    figures = bridge(recording(direct([4, 0, -3, 0, -1, 0])), edges)
    assert figures["idc_A"] == pytest.approx(-4)
    assert figures["idc_ripple_A"] == pytest.approx(0, abs=1e-6)


def edges_at_the_zeros(out_when):
    """Each leg is in the state `out_when` while its current flows out, and in the other one while
    it flows in."""
    rows = []
    for leg, angle in enumerate(ANGLES_RAD):
        for cycle in range(-1, 21):
            zero = (cycle + (angle + np.pi / 2) / (2 * np.pi)) / F1_HZ  # the current falls
            rows += [(zero, leg, LOW if out_when == HIGH else HIGH)]
            rows += [(zero + 0.5 / F1_HZ, leg, out_when)]
    return edges_of([LOW] * 6, rows)


@pytest.mark.parametrize("device, out_when", [("switch", HIGH), ("diode", LOW)])
def test_conduction_loss_of_sines(device, out_when):
    """Every leg is high while its current flows out: only the switches conduct, and each leg loses
    V 2 I/pi + R I^2/2. The other way round only the diodes conduct."""
    i, edges = sines(), edges_at_the_zeros(out_when)
    other = "diode" if device == "switch" else "switch"
    inverter = {f"v_{device}_V": 0.8, f"r_{device}_ohm": 0.05, f"v_{other}_V": 0.0}
    each_W = 0.8 * 2 * PEAK_A / np.pi + 0.05 * PEAK_A**2 / 2
    figures = bridge(recording(i, inverter), edges)
    assert figures["conduction_loss_W"] == pytest.approx(6 * each_W, rel=1e-3)
    inverter = {f"v_{other}_V": 0.8, f"r_{other}_ohm": 0.05}
    figures = bridge(recording(i, inverter), edges)
    assert figures["conduction_loss_W"] == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("leg", range(6))
@pytest.mark.parametrize("amperes", [4.0, -4.0])
def test_switching_loss_counts_the_edges_that_commutate(amperes, leg):
    """Low, off, high, off, low, 500 times: of the four edges of a cycle the two of the switch that
    carries the current cost energy, in proportion to current and voltage."""
    rows, cycle_s = [], 0.1 / 500
    for n in range(500):
        for share, state in ((0.1, OFF), (0.12, HIGH), (0.6, OFF), (0.62, LOW)):
            rows.append(((n + share) * cycle_s, leg, state))
    data = {"e_on_mJ": 0.3, "e_off_mJ": 0.2, "e_ref_V": 600.0, "e_ref_A": 10.0}
    currents = np.roll([amperes, 0, -amperes, 0, 0, 0], leg)
    figures = bridge(recording(direct(currents), data), edges_of([LOW] * 6, rows))
    energy_J = 0.5e-3 * (300 / 600) * (4 / 10)
    assert figures["switching_loss_W"] == pytest.approx(500 * energy_J / 0.1)


def test_a_long_recording_has_the_figures_of_a_short_one():
    period_s = 1 / 7000
    duration_s = 6.0
    rows = []
    for n in range(round(duration_s / period_s)):
        rows += [(n * period_s, 0, HIGH), ((n + 0.3) * period_s, 0, LOW)]
    rec = recording(direct([4, 0, -4, 0, 0, 0], duration_s), {"v_switch_V": 1.0, "v_diode_V": 1.0})
    figures = bridge(rec, edges_of([LOW] * 6, rows))
    assert figures["idc_A"] == pytest.approx(1.2, rel=1e-4)
    assert figures["conduction_loss_W"] == pytest.approx(8.0)


@pytest.mark.parametrize(
    ("idc_A", "torque_Nm", "efficiency_pct"),
    [(2.0, 5.0, 100 * 500 / 600), (-1.0, -5.0, 100 * 300 / 500), (1.0, -5.0, np.nan)],
)
def test_efficiency_is_in_the_direction_of_the_power(idc_A, torque_Nm, efficiency_pct):
    """At 100 rad/s and 300 V. When both sides give power, all is lost and there is none."""
    rec = recording(direct([0.0] * 6))
    rec.channels["plant.speed_rpm"] = np.full(len(rec), 100 * 30 / np.pi)
    rec.channels["plant.torque_Nm"] = np.full(len(rec), torque_Nm)
    figures = balance(rec, {"idc_A": idc_A, "switching_loss_W": np.nan})
    assert figures["loss_W"] == pytest.approx(300 * idc_A - 100 * torque_Nm)
    assert figures["efficiency_pct"] == pytest.approx(efficiency_pct, nan_ok=True)


def test_friction_does_not_arrive_at_the_shaft():
    rec = recording(direct([0.0] * 6), machine={"viscous_Nms": 0.01})
    rec.channels["plant.speed_rpm"] = np.full(len(rec), 100 * 30 / np.pi)
    rec.channels["plant.torque_Nm"] = np.full(len(rec), 5.0)
    figures = balance(rec, {"idc_A": 2.0, "switching_loss_W": 10.0})
    assert figures["shaft_W"] == pytest.approx(500 - 0.01 * 100**2)
    assert figures["input_W"] == pytest.approx(610)


def test_without_edges_there_is_no_figure_of_the_inverter(make_recording):
    m = metrics(make_recording())
    assert m["idc_A"] is None and m["idc_ripple_A"] is None and m["switching_loss_W"] is None


@pytest.mark.parametrize("scheme", ["dtc1", "db-dtfc"])
def test_power_from_the_dc_link_is_power_of_the_machine(scheme):
    """Power balance of a steady state: V_dc I_dc = air-gap power T w_s + stator copper loss +
    conduction loss. What the harmonics heat the rotor by is left out: below 1 % here."""
    setup = load("paper-b").changed(
        controller__scheme=scheme,
        timing__latency="predicted",
        inverter__v_switch_V=1.0,
        inverter__v_diode_V=0.8,
        inverter__e_on_mJ=0.3,
        inverter__e_off_mJ=0.2,
        inverter__e_ref_V=600.0,
        inverter__e_ref_A=10.0,
    )
    m = measure(Point(setup, 1500.0, 2.0), samples_per_period=4).metrics
    air_gap_W = m["torque_Nm"] * 2 * np.pi * m["f1_Hz"] / setup["machine.pole_pairs"]
    given_W = setup["inverter.vdc_V"] * m["idc_A"]
    assert given_W == pytest.approx(
        air_gap_W + m["copper_loss_W"] + m["conduction_loss_W"], rel=0.02
    )
    # The rest of the balance is the rotor's copper: slip times the air gap's power.
    slip = 1 - m["speed_rpm"] * np.pi / 30 * setup["machine.pole_pairs"] / (2 * np.pi * m["f1_Hz"])
    lost_W = m["copper_loss_W"] + m["conduction_loss_W"] + m["switching_loss_W"] + slip * air_gap_W
    assert m["loss_W"] == pytest.approx(lost_W, abs=0.02 * given_W)
    assert m["input_W"] - m["loss_W"] == pytest.approx(m["shaft_W"])
    assert m["efficiency_pct"] == pytest.approx(100 * m["shaft_W"] / m["input_W"])
    # A leg commutates 2 f_sw times a second, with the mean of |i| of a sine or less.
    mean_A = 2 / np.pi * m["i1_A"] * 1.2
    most_W = 6 * m["f_sw_Hz"] * 0.5e-3 * (setup["inverter.vdc_V"] / 600) * mean_A / 10
    assert 0.3 * most_W < m["switching_loss_W"] < most_W
