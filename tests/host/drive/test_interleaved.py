"""db-ipwm in the simulated drive: what it promises at equal switching frequency, its knob and its
clamped legs, and the ways through start, steps, weakening and reversal.
"""

import numpy as np
import pytest
from campaigns import part

from hexatorque import firmware, setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.methods.bench import measure
from hexatorque.evidence.methods.places import PLACES
from hexatorque.evidence.studies.fault_checks import shoot_through
from hexatorque.firmware import FirmwareError
from hexatorque.plant.vsd import PHASES
from hexatorque.setups import review
from hexatorque.setups.review import PEAK

#: Near 4 kHz, from the f_isr of 12 samples in a whole number of counts.
QUARTER_HZ, HALF_HZ = 150e6 / 9384, 150e6 / 18756


def at(place, scheme, f_isr_Hz, **values):
    clock_Hz = 150e6 if place.base["timing.device"] == "f28335" else 200e6
    counts = 12 * round(clock_Hz / (12 * f_isr_Hz))
    f_isr_Hz = clock_Hz / counts
    values |= {"f_isr_Hz": f_isr_Hz, "f_slow_Hz": f_isr_Hz / round(f_isr_Hz / 100)}
    found = measure(scheme, values, place, build_s=place.base.parameter("build_s"))
    assert found is not None
    return found


@pytest.mark.parametrize(
    "place", part(list(PLACES), 3), ids=lambda place: f"{place.setup} {place.speed_rpm:g}"
)
def test_both_ends_of_the_knob_against_the_deadbeat_law(place):
    """At the switching frequency of db-dtfc it has half of its torque ripple at one end, and no
    more distortion at the other. What set 2's turns add to f_sw, 1.5 % at most, counts: distortion
    goes with 1/f_sw."""
    theirs = at(place, "db-dtfc", HALF_HZ)
    smooth = at(place, "db-ipwm", QUARTER_HZ, thd_share=0.0)
    assert smooth["f_sw_Hz"] <= 1.01 * theirs["f_sw_Hz"]
    assert smooth["td_Nm"] <= 0.5 * theirs["td_Nm"]
    clean = at(place, "db-ipwm", QUARTER_HZ, thd_share=1.0)
    more = clean["f_sw_Hz"] / theirs["f_sw_Hz"]
    assert more < 1.016
    assert more * clean["thd_inf_pct"] <= 1.02 * theirs["thd_inf_pct"]


#: The distortion's end with clamped legs, and what it is compared with; both above 0.4 V_dc.
CLAMPED = {"thd_share": 1.0, "clamp": "alternating", "kappa_from_pu": 0.36}
DEADBEAT = {"kappa_from_pu": 0.36, "clamp": "alternating", "carrier_turn": "always"}


@pytest.mark.parametrize(
    "place", part(list(PLACES[1::2]), 2), ids=lambda place: f"{place.setup} {place.speed_rpm:g}"
)
def test_clamped_legs_have_the_least_distortion_at_medium_voltage(place):
    """At one switching frequency: as little as that of db-dtfc with the same legs clamped, and less
    than with centred legs, by the 6 % and more that docs/schemes.md states of them."""
    clamped = at(place, "db-ipwm", 1.5 * QUARTER_HZ, **CLAMPED)
    theirs = at(place, "db-dtfc", 1.5 * HALF_HZ, **DEADBEAT)
    centred = at(place, "db-ipwm", QUARTER_HZ, thd_share=1.0)
    assert clamped["f_sw_Hz"] <= 1.01 * min(theirs["f_sw_Hz"], centred["f_sw_Hz"])
    assert clamped["thd_inf_pct"] <= 1.015 * theirs["thd_inf_pct"]
    assert clamped["thd_inf_pct"] <= 0.95 * centred["thd_inf_pct"]


@pytest.mark.parametrize("kappa_from_pu", (0.0, 0.38))
def test_no_jump_where_clamping_begins(kappa_from_pu):
    """The voltage goes through the threshold and back under load. Torque and x-y current stay
    within their ripple on either side; a leg's clamping all at once moves no set's mean."""
    base = (
        setups.load("paper-a-feasible")
        .with_scheme(
            "db-ipwm",
            controller__f_isr_Hz=24e3,
            controller__control_mode="torque",
            timing__latency="predicted",
            machine__inertia_kgm2=1e3,
            machine__viscous_Nms=0.0,
            load__kind="constant",
            **{f"controller__{name}": value for name, value in CLAMPED.items()},
        )
        .changed(controller__kappa_from_pu=kappa_from_pu)
    )
    sim = started(base, 8)
    sim.set("torque_ref_Nm", 10.0)
    parts = []
    for rpm in (*np.linspace(0, 480, 40), *np.linspace(480, 800, 60), *np.linspace(800, 480, 60)):
        sim.plant_state[6] = rpm * np.pi / 30
        sim.run(0.01)
        rec = sim.take()
        xy_A = np.hypot(rec["plant.i_x_A"], rec["plant.i_y_A"])
        parts.append((np.abs(rec["plant.torque_Nm"] - 10.0).max(), xy_A.max()))
    sim.check()
    torque_Nm, xy_A = np.array(parts[42:]).T
    assert torque_Nm.max() < 0.06 * 10.0
    assert np.abs(np.diff(torque_Nm)).max() < 0.3
    assert xy_A.max() < 0.3


def started(setup, samples_per_period=1):
    """The drive, a tenth of a second after its flux is built up."""
    sim = SimulatedDrive(setup, samples_per_period)
    sim.start()
    sim.run(setup.parameter("build_s") + 0.1, record=False)
    return sim


@pytest.mark.parametrize("setup", ("paper-a-feasible", "paper-b", "small-2kw", "large-110kw"))
@pytest.mark.parametrize("thd_share", (0.0, 0.5, 1.0))
def test_a_start_a_reversal_and_a_load(setup, thd_share):
    base = setups.load(setup).with_scheme("db-ipwm", controller__thd_share=thd_share)
    sim = started(base)
    speed_rpm, load_Nm = base["point.speed_rpm"], base["point.load_Nm"]
    for speed, load in (
        (speed_rpm, load_Nm),
        (-speed_rpm, load_Nm),
        (-speed_rpm, -load_Nm),
        (0, 0),
    ):
        sim.set("load_Nm", 0.0)
        sim.set("speed_ref_rpm", float(speed))
        sim.run(3.0, record=False)
        sim.set("load_Nm", float(load))
        sim.run(1.0, record=False)
        sim.check()
        assert sim.speed_rpm == pytest.approx(speed, abs=0.02 * abs(speed_rpm) + 3)


@pytest.mark.parametrize(("setup", "speed_rpm"), [("paper-a-feasible", 2700), ("paper-b", 5000)])
def test_twice_base_speed_and_back(setup, speed_rpm):
    sim = SimulatedDrive(setups.load(setup).with_scheme("db-ipwm"), 1)
    sim.start()
    for speed, time_s in ((0, 0.4), (speed_rpm, 2.0), (-speed_rpm, 3.0), (0, 2.0)):
        sim.set("speed_ref_rpm", speed)
        sim.run(time_s, record=False)
        sim.check()
        assert sim.speed_rpm == pytest.approx(speed, abs=0.01 * speed_rpm)


@pytest.mark.parametrize("f_isr_Hz", (10e3, 20e3))
@pytest.mark.parametrize("scheme", ("db-ipwm", "foc"))
def test_a_run_up_beyond_the_reach_with_the_full_flux_trips_nothing(scheme, f_isr_Hz):
    """The flux is short of its reference there, and turns as fast as the shaft. A shaft that is
    told half as fast is found."""
    base = setups.load("paper-b").with_scheme(
        scheme,
        controller__f_isr_Hz=f_isr_Hz,
        controller__field_weakening="off",
        timing__latency="predicted",
    )
    sim = started(base)
    sim.set("speed_ref_rpm", 4600.0)
    sim.run(1.5, record=False)
    sim.check()
    assert sim.speed_rpm > 4200
    sim.sensors.hold[7] = 1
    sim.run(0.1, record=False)
    assert "encoder" in ", ".join(sim.faults)


@pytest.mark.parametrize("f_isr_Hz", (10e3, 20e3))
@pytest.mark.parametrize("share", (0.0, 0.5, 1.0))
def test_a_reversal_from_beyond_the_reach_trips_nothing(share, f_isr_Hz):
    """The sets decide one after the other. The first asks for a torque that brakes, with all
    that the link has, while the second still drives with as much."""
    base = setups.load("paper-b").with_scheme(
        "db-ipwm",
        controller__f_isr_Hz=f_isr_Hz,
        controller__thd_share=share,
        controller__field_weakening="off",
        timing__latency="predicted",
    )
    sim = started(base)
    for rpm in (4600.0, -4600.0, 2500.0):
        sim.set("speed_ref_rpm", rpm)
        sim.run(1.8, record=False)
        sim.check()
        assert sim.speed_rpm == pytest.approx(rpm, rel=0.08)


OTHERS = [scheme for scheme in firmware.schemes() if scheme != "db-ipwm"]
#: Machine, share: those of the set-ups, a small and a large one, and two with magnets.
CHANGING = [
    ("paper-a-feasible", 0.0), ("paper-b", 1.0), ("small-2kw", 0.0), ("large-110kw", 1.0),
    ("magnet-surface", 0.0), ("magnet-24v", 1.0), ("paper-a-feasible", 0.5),
]  # fmt: skip
#: Its x-y current alone trips the drive.
TRIPS = {("small-2kw", "dtc1")}


def seen(sim):
    """Least and largest torque, and the largest current of a phase, of what was recorded."""
    rec = sim.take()
    torque_Nm = rec["plant.torque_Nm"]
    peak_A = max(np.abs(rec[f"plant.i_{phase}_A"]).max() for phase in PHASES)
    return np.array([torque_Nm.min(), torque_Nm.max(), peak_A])


@pytest.mark.parametrize(("name", "share"), CHANGING)
def test_every_scheme_may_come_before_it_and_after_it(name, share):
    """From every other scheme and to it, at each of the four periods of a carrier, at standstill,
    motoring and generating. No gate pulse is too short, no leg changes over without its dead time.
    The torque stays near what both schemes have in steady state, and the current as well."""
    sim = started(setups.load(name).with_scheme("db-ipwm", controller__thd_share=share), 4)
    speed, load = sim.setup["point.speed_rpm"], sim.setup["point.load_Nm"]
    others = [one for one in OTHERS if (name, one) not in TRIPS]
    for speed_rpm, load_Nm in ((0, load / 2), (speed, load), (speed, -load), (-speed, load)):
        sim.set_many({"load_Nm": 0.0, "speed_ref_rpm": float(speed_rpm)})
        sim.run(1.0, record=False)
        sim.set("load_Nm", float(load_Nm))
        sim.run(0.5, record=False)
        for other in others:
            steady = []
            for scheme in (other, "db-ipwm"):
                sim.set("scheme", scheme)
                sim.run(0.02, record=False)
                sim.run(0.02)
                steady.append(seen(sim))
            least_Nm, (_, most_Nm, peak_A) = np.min(steady, axis=0)[0], np.max(steady, axis=0)
            legs = np.array(sim.inverter.leg)
            sim.log_edges(20_000)
            for periods in range(40, 44):
                for scheme in (other, "db-ipwm"):
                    sim.set("scheme", scheme)
                    sim.run(periods * sim.period_s)
            assert sim.state == "run", (other, sim.faults)
            assert shoot_through(sim, legs) == "", other
            sim.log_edges(0)
            low_Nm, high_Nm, top_A = seen(sim)
            assert low_Nm > least_Nm - 0.25 * load and high_Nm < most_Nm + 0.25 * load, other
            assert top_A < min(1.4 * peak_A, sim.setup.parameter("i_trip_A")), other


def test_a_drive_that_is_sampled_too_slowly_for_it_says_so_and_goes_on():
    """The change is refused in one line, with the sampling frequency that is allowed."""
    base = setups.load("small-2kw").with_scheme("db-dtfc", controller__f_isr_Hz=7e3)
    sim = started(base)
    with pytest.raises(FirmwareError) as told:
        sim.set("scheme", "db-ipwm")
    line = str(told.value)
    assert line.startswith("scheme = db-ipwm: ") and "\n" not in line
    assert "f_isr_Hz = 7000 Hz" in line and "allowed is 1.254e+04 Hz and more: the ripple" in line
    sim.run(0.1, record=False)
    sim.check()
    assert (sim.state, sim.get("scheme")) == ("run", "db-dtfc")


@pytest.mark.parametrize("clamp", ("largest", "alternating"))
@pytest.mark.parametrize("setup", ("paper-a-feasible", "paper-b"))
def test_the_knob_moves_while_the_drive_runs(setup, clamp):
    """While the sets join and part, without a dip of the torque beyond its ripple."""
    base = setups.load(setup).with_scheme(
        "db-ipwm",
        controller__f_isr_Hz=10e3,
        controller__clamp=clamp,
        controller__kappa_from_pu=0.3,
    )
    sim = started(base, 4)
    speed_rpm, load_Nm = (700, 8.0) if setup == "paper-a-feasible" else (2300, 2.0)
    sim.set("speed_ref_rpm", speed_rpm)
    sim.run(1.5, record=False)
    sim.set("load_Nm", load_Nm)
    sim.run(1.0, record=False)
    sim.discard()
    for share in (0.0, 1.0, 0.0, 0.1, 0.8, 0.5, 1.0):
        sim.set("thd_share", share)
        sim.run(0.05)
    sim.check()
    torque_Nm = sim.take()["plant.torque_Nm"]
    assert np.abs(torque_Nm - torque_Nm.mean()).max() < 0.3 * load_Nm


@pytest.mark.parametrize("thd_share", (0.0, 0.5, 1.0))
def test_what_a_torque_step_adds_to_the_current_is_what_check_says(thd_share):
    """Sampled as slowly as the firmware lets it, at a voltage near its trip: a quarter of the trip
    for ripple is enough, because the step of one set before the other takes twice as much."""
    base = setups.load("small-2kw")
    setup = base.with_scheme(
        "db-ipwm",
        controller__f_isr_Hz=12.8e3,
        controller__thd_share=thd_share,
        controller__vdc_max_V=base.parameter("vdc_max_V"),
        controller__torque_limit_Nm=base.parameter("torque_limit_Nm"),
        inverter__vdc_V=0.97 * base.parameter("vdc_max_V"),
        sensors__i_noise_A=0.04,
    )
    (told,) = (f for f in review.review(setup, ["db-ipwm"], steady=False) if f.subject == PEAK)
    sim = started(setup, 4)
    limit_Nm = setup.parameter("torque_limit_Nm")
    sim.set_many({"control_mode": "torque", "torque_ref_Nm": limit_Nm})
    for step in range(30):
        sim.set("torque_ref_Nm", limit_Nm * (-1) ** step)
        sim.run(0.0173)
    sim.check()
    rec = sim.take()
    peak_A = max(np.abs(rec[f"plant.i_{phase}_A"]).max() for phase in PHASES)
    assert 0.6 * told.value < peak_A < 1.05 * told.value
    assert told.verdict == "ok"


def test_the_share_follows_the_machine():
    """Where x-y has little inductance beside the leakage, and nowhere else; and check says so."""
    shares = {n: setups.load(n).parameter("thd_share") for n in ("small-2kw", "large-110kw")}
    assert shares == {"small-2kw": 1.0, "large-110kw": 0.0}
    for name, changes, verdict in (
        ("small-2kw", {}, "ok"),
        ("small-2kw", {"controller__thd_share": 0.0}, "note"),
        ("large-110kw", {}, "ok"),
        ("large-110kw", {"machine__lxy_H": 2.5e-4}, "ok"),
    ):
        setup = setups.load(name).with_scheme("db-ipwm", **changes)
        found = review.review(setup, ["db-ipwm"], steady=False)
        (told,) = (f for f in found if f.subject.startswith("sigma_ls_H over lxy_H"))
        assert told.verdict == verdict, (name, changes)
    assert setup.parameter("thd_share") == 1.0
