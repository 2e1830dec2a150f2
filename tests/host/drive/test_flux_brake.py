"""Flux braking: what a raised flux gains while the upper level of the dc link limits the torque,
and that it takes no drive to a trip."""

import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import scheme_choice
from campaigns import part
from scipy.optimize import brentq
from waiting import until_it_runs

from hexatorque import SetupError, SimulatedDrive, load

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "docs" / "protection.md"
SHARE = 0.5
SETUPS = {"paper-a-feasible": 1215.0, "small-2kw": 2500.0}


class Case(NamedTuple):
    setup: str
    scheme: str
    knee: float = 0.0  #: of the plant's main flux, in flux references; 0: linear
    lm: float = 1.0  #: the believed one over that of a no-load test
    rs: float = 1.0
    link_F: float = 1e-3


def braking(case, share=SHARE, **changes):
    """The set-up with a small capacitor and an upper level."""
    base = load(case.setup).changed(controller__scheme=case.scheme)
    vdc_V, machine = base["inverter.vdc_V"], {}
    if case.knee:
        knee_Wb = case.knee * float(base.parameter("flux_ref_Wb"))
        machine["machine__psi_knee_Wb"] = knee_Wb
        base = base.changed(**machine)
    lm_H = case.lm * float(base.parameter("lm_H"))
    return base.changed(
        **{
            "controller__lm_H": lm_H,
            "controller__lr_H": lm_H + base["machine.llr_H"],
            "controller__rs_ohm": case.rs * base["machine.rs_ohm"],
            "controller__vdc_high_V": 1.25 * vdc_V,
            "controller__vdc_band_V": 0.05 * vdc_V,
            "controller__vdc_max_V": min(1.4 * vdc_V, 0.94 * base["sensors.vdc_full_V"]),
            "controller__flux_brake_share": share,
            "inverter__link_F": case.link_F,
            "inverter__source_ohm": 0.02 * vdc_V / base["sensors.i_full_A"],
            **changes,
        }
    )


class Stop(NamedTuple):
    seconds: float  #: until `slow` of the speed; NaN if the drive trips or `most_s` are over
    flux_pu: float  #: largest flux reference over the parameter
    vdc_V: float
    i_A: float
    faults: list


#: The time goes with the square of the speed. Below this share of it little is left.
SLOW = 0.4
#: Without flux braking it takes longer by this at least.
GAIN = 1 / 0.97


def stopped(setup, most_s=12.0, slow=SLOW, settle_s=0.3):
    """From 90 % of the speed to a standstill, whose faults count, too; no further than `most_s`."""
    speed_rpm = SETUPS[setup.name]
    sim = SimulatedDrive(setup, samples_per_period=1)
    until_it_runs(sim)
    sim.set("speed_ref_rpm", speed_rpm)
    while not sim.faults and sim.speed_rpm < 0.98 * speed_rpm:
        assert sim.time_s < 4.0
        sim.run(0.1, record=False)
    sim.run(settle_s, record=False)
    if sim.faults:
        return Stop(math.nan, math.nan, math.nan, math.nan, sim.faults)
    sim.set("speed_ref_rpm", 0)
    begin_s, end_s, seconds, most = sim.time_s, sim.time_s + most_s, math.nan, np.zeros(3)
    while sim.time_s < end_s and not sim.faults:
        sim.run(0.02)
        if math.isnan(seconds) and abs(sim.speed_rpm) < slow * speed_rpm:
            seconds = sim.time_s - begin_s
        if end_s - sim.time_s > 0.6 and abs(sim.speed_rpm) < 0.1 * speed_rpm:
            end_s = sim.time_s + 0.6
        rec = sim.take()
        currents = [rec[f"i_{leg}_A"] for leg in ("u1", "u2", "v1", "v2", "w1", "w2")]
        now = np.max(rec["flux_ref_Wb"]), np.max(rec["vdc_V"]), np.max(np.abs(currents))
        most = np.fmax(most, now)
    most[0] /= float(setup.parameter("flux_ref_Wb"))
    return Stop(seconds, *most.tolist(), sim.faults)


CASES = [
    Case(name, scheme, knee, lm, rs)
    for name in SETUPS
    for scheme in scheme_choice.allowed(name)
    for knee in (0.0, 1.2)
    for lm, rs in ((1.0, 1.0), (0.8, 1.0), (1.2, 1.0), (1.0, 0.8), (1.0, 1.2))
]


@pytest.mark.parametrize("case", part(CASES, 10), ids=lambda case: "-".join(map(str, case)))
def test_it_stops_the_shaft_sooner_and_trips_nothing(case):
    setup, without = braking(case), braking(case, 0.0)
    found = stopped(setup)
    if found.faults == ["over-current"]:
        # It is not the flux's fault if `check` refuses the scheme: its peak is near the trip.
        assert not scheme_choice.is_ready(case.setup, case.scheme)
        return
    if found.faults and stopped(without).faults:
        pytest.skip(f"{found.faults} without flux braking, too")
    assert not found.faults
    assert found.vdc_V < float(setup.parameter("vdc_max_V"))
    assert found.i_A < float(setup.parameter("i_trip_A"))
    assert 1.0 < found.flux_pu <= 1.0 + SHARE + 1e-3
    assert math.isnan(stopped(without, GAIN * found.seconds).seconds)


def test_the_example_stops_as_soon_as_the_page_tells():
    told = re.search(r"tenth of its speed after ([\d.]+) s instead of ([\d.]+) s", PAGE.read_text())
    setup = load(ROOT / "examples" / "brake.toml")
    ((_, speed_rpm), (begin_s, _)) = setup["profile.speed_rpm"]
    for share, seconds in zip((SHARE, 0.0), told.groups()):
        sim = SimulatedDrive(setup.changed(controller__flux_brake_share=share))
        sim.run_profile(setup.profile)
        rec = sim.take()
        below = (rec.time_s > begin_s) & (rec["speed_rpm"] < 0.1 * speed_rpm)
        assert rec.time_s[below][0] - begin_s == pytest.approx(float(seconds), abs=0.06)


@pytest.mark.parametrize("name", SETUPS)
def test_a_linear_machine_takes_half_as_long_again_without_it(name):
    """To a tenth of the speed, from where everything has settled."""
    plain, found = (
        stopped(braking(Case(name, "ddr"), share), slow=0.1, settle_s=3.0) for share in (0.0, SHARE)
    )
    assert plain.seconds > 1.45 * found.seconds
    assert found.flux_pu == pytest.approx(1.0 + SHARE, rel=1e-3)


# -- steady state: what the raised flux takes up ---------------------------------------------


def copper_W(m, flux_Wb, torque_Nm):
    """By the equivalent circuit at this stator flux and torque."""

    def currents(slip):
        rotor = m.rr_ohm + 1j * slip * (m.llr_H + m.lm_H)
        matrix = [[m.lls_H + m.lm_H, m.lm_H], [1j * slip * m.lm_H, rotor]]
        i = np.linalg.solve(matrix, [flux_Wb, 0])
        return i, 3 * m.pole_pairs * (flux_Wb * i[0]).imag

    slip = brentq(lambda s: currents(s)[1] - torque_Nm, -20.0, 20.0)
    (stator, rotor), _ = currents(slip)
    return 3 * (m.rs_ohm * abs(stator) ** 2 + m.rr_ohm * abs(rotor) ** 2)


@pytest.mark.parametrize("name", SETUPS)
def test_at_an_imposed_speed_the_copper_takes_up_the_shaft_s_power(name):
    """Nothing goes into the link: its voltage stands. So the torque that is left follows from the
    loss at the raised flux. The rest is the ripple's loss."""
    omega_rad_s = 0.4 * SETUPS[name] * math.pi / 30
    found = []
    for share in (0.0, SHARE):
        setup = braking(Case(name, "db-dtfc"), share, machine__viscous_Nms=0.0)
        sim = SimulatedDrive(setup, samples_per_period=1)
        sim.start()
        sim.run(1.0, record=False)
        braking_Nm = -0.5 * float(setup.parameter("torque_limit_Nm"))
        sim.set_many({"control_mode": "torque", "torque_ref_Nm": braking_Nm})
        torques = []
        for step in range(600):
            sim.plant_state[6] = omega_rad_s
            sim.run(0.005, record=step >= 400)
            if step >= 400:
                torques.append(float(np.mean(sim.take()["plant.torque_Nm"])))
        assert not sim.faults
        raised_Wb, torque_Nm = sim.controller.channel("flux_ref_Wb"), float(np.mean(torques))
        assert -torque_Nm * omega_rad_s == pytest.approx(
            copper_W(sim.machine, raised_Wb, torque_Nm), rel=0.05
        )
        found.append((raised_Wb, -torque_Nm))
    (plain_Wb, plain_Nm), (raised_Wb, raised_Nm) = found
    assert raised_Wb > 1.4 * plain_Wb
    # Almost as the square of the flux.
    assert raised_Nm / plain_Nm == pytest.approx((raised_Wb / plain_Wb) ** 2, rel=0.05)


# -- its bounds ------------------------------------------------------------------------------


def unbounded(monkeypatch, **changes):
    """Every drive of `stopped` has these values in the rule's configuration."""
    honest = SimulatedDrive.set

    def changed(self, *given):
        honest(self, *given)
        self.run(3 * self.period_s, record=False)  # until the configuration is in force
        for name, value in changes.items():
            setattr(self.controller.drive.config.flux_brake, name, value)

    monkeypatch.setattr(SimulatedDrive, "set", changed)


SATURATED = Case("paper-a-feasible", "foc", 1.2, 1.2)


def test_a_flux_that_saturation_does_not_bound_trips_the_check_of_the_flux(monkeypatch):
    unbounded(monkeypatch, per_check=0.0)
    assert stopped(braking(SATURATED)).faults == ["flux estimate cannot be right"]


# -- when it acts ----------------------------------------------------------------------------


def flux_Wb(sim):
    return sim.controller.channel("flux_ref_Wb")


def slowing(share=SHARE, **changes):
    """A drive that brakes into its capacitor."""
    setup = braking(Case("paper-a-feasible", "ddr"), share, **changes)
    sim = SimulatedDrive(setup, samples_per_period=1)
    sim.start()
    sim.set("speed_ref_rpm", 1215)
    sim.run(4.0, record=False)
    sim.set("speed_ref_rpm", 0)
    sim.run(1.5, record=False)  # at first the voltage limits the flux
    assert not sim.faults
    return sim


def test_the_flux_comes_back_when_the_level_no_longer_limits():
    sim = slowing()
    most_Wb = float(sim.setup.parameter("flux_ref_Wb"))
    assert flux_Wb(sim) > 1.2 * most_Wb
    sim.set("speed_ref_rpm", sim.speed_rpm)
    sim.run(1.0, record=False)
    assert flux_Wb(sim) == pytest.approx(most_Wb)


def test_it_wins_over_the_flux_of_least_loss():
    sim = slowing(controller__flux_least_loss="on", controller__flux_wait_s=0.1)
    assert flux_Wb(sim) > 1.2 * float(sim.setup.parameter("flux_ref_Wb"))


def test_a_hot_winding_ends_it():
    sim = slowing(
        controller__winding_K_W=0.5, controller__ambient_degC=100.0,
        controller__winding_limit_degC=100.5, controller__winding_trip_degC=300.0,
        controller__winding_s=0.1, controller__frame_s=2.0,
    )  # fmt: skip
    sim.run(0.6, record=False)
    assert sim.controller.channel("winding_degC") > 100.5
    assert flux_Wb(sim) == pytest.approx(float(sim.setup.parameter("flux_ref_Wb")))


def test_a_share_without_a_braking_changes_no_bit():
    states = []
    for share in (0.0, SHARE):
        setup = braking(Case("paper-a-feasible", "ddr"), share)
        sim = SimulatedDrive(setup, samples_per_period=1)
        sim.start()
        sim.set("speed_ref_rpm", 600)
        sim.run(1.5, record=False)
        states.append(sim.plant_state.copy())
    assert np.array_equal(*states)


def test_magnets_refuse_it_in_one_line():
    with pytest.raises(SetupError) as refused:
        load("magnet-interior").changed(
            controller__flux_brake_share=0.3, controller__vdc_high_V=400.0
        )
    (line,) = str(refused.value).splitlines()
    assert "flux_brake_share = 0.3" in line and "with magnets it must be 0" in line
