"""The drive FMU, run by FMPy: channels and true values have the simulation's bits, with a broken
leg and a changing load, and what it cannot do is refused in one line."""

import math

import numpy as np
import pytest
import shorted_machine
from example_setups import EXAMPLES

from hexatorque import firmware, setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant.loop import PLANT_CHANNELS
from hexatorque.plant.vsd import inverse

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed: pip install fmpy")
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402
from fmu_masters import COURSES, LEGS, Fmu, command, made_once, same  # noqa: E402

SHORT = {"controller.calibration_s": 0.01, "controller.build_s": 0.1}
ARC = {"inverter.arc_V": 25.0, "inverter.restrike_V_per_ms": 50.0, "inverter.bounce_ms": 2.0}
#: A scheme that bears an open leg.
BEARS = {"controller.scheme": "db-dtfc", "timing.latency": "predicted"}
SETUPS = {
    "open leg": ("paper-b", BEARS | ARC),
    "fan": ("paper-a", {"load.kind": "fan", "timing.device": "f28335"}),
    "magnets": (
        "magnet-interior",
        {
            "inverter.v_diode_V": 1.0,
            "inverter.v_switch_V": 1.2,
            "sensors.absolute_counts_rev": 1000,
            "controller.rotor_start": "absolute",
        },
    ),
    "saturating magnets": (
        "magnet-interior",
        {"machine.flux_map": str(EXAMPLES / "magnet-saturation.csv")},
    ),
    "line and brake": (
        "paper-b",
        {
            "inverter.link_F": 200e-6,
            "inverter.source_H": 1e-3,
            "inverter.line_Hz": 50.0,
            "load.holding_Nm": 4.0,
            "load.holding_open_s": 0.01,
            "load.holding_close_s": 0.01,
        },
    ),
    "shorted": (shorted_machine.NAME, shorted_machine.CHANGES),
}
TRUE = [f"plant.{name}" for name, _ in PLANT_CHANNELS]


@pytest.fixture(scope="module", params=(2, 3), ids=("fmi2", "fmi3"))
def made(request, tmp_path_factory):
    """Set-up, file and folder of an FMU; each is made once."""
    place = tmp_path_factory.mktemp("drive")
    kept = {}

    def make(what="open leg"):
        name, changes = SETUPS[what]
        setup = setups.load(name).changed(SHORT | changes)
        return made_once(kept, place, what, setup, "drive", request.param)

    return make


def course(k):
    return COURSES["drive"].get(k, {})


@pytest.mark.parametrize("what", [what for what in SETUPS if what != "shorted"])
def test_it_computes_the_bits_of_the_simulation(made, what):
    """A recording's true values are those at a period's beginning, an FMU's those at its end."""
    setup, _, folder = made(what)
    sim, fmu = SimulatedDrive(setup, 1), Fmu(folder).begin()
    channels = [f"channel.{name}" for name, _ in firmware.channels()]
    phases = inverse(setup.machine_values()["displacement_deg"])
    states, before = set(), fmu.get(*TRUE)
    for k in range(2500):
        given = course(k)
        if setup["machine.model"] == "magnet":
            given = {n: v for n, v in given.items() if n != "vdc_V"}
        command(sim, given)
        true, rows = sim.rows(1)
        fmu.set(**given)
        assert same(before, [float(x) for x in true[0][: len(TRUE)]]), k
        fmu.step()
        assert same(fmu.get(*channels), [float(x) for x in rows[0]]), k
        before = fmu.get(*TRUE)
        currents = fmu.get(*(f"plant.i_{leg}_A" for leg in LEGS))
        assert currents == pytest.approx(phases @ before[:4], abs=1e-4)
        states.add(sim.state)
    # The rotor of a machine with magnets and no absolute encoder is still being aligned.
    reached = {"idle", "calibrate", "build"} | (set() if what == "saturating magnets" else {"run"})
    assert reached <= states and not fmu.said
    assert not np.isnan(before).any()


def test_a_trip_above_the_ceiling_of_magnets_short_circuits_the_machine(made):
    """The current of the shorted machine is the simulation's, and so is its end."""
    setup, _, folder = made("shorted")
    sim, fmu = SimulatedDrive(setup, 1), Fmu(folder).begin()
    channels = [f"channel.{name}" for name, _ in firmware.channels()]
    name, value = shorted_machine.TRIPS
    course = {
        20: {"run": True},
        1200: {"speed_ref_rpm": shorted_machine.ABOVE_RPM},
        3000: {f"parameter__{name}": value},
    }
    seen, largest_A = [], 0.0
    for k in range(12_000):
        given = course.get(k, {})
        command(sim, given)
        if k == 3000:
            sim.set(name, value)
        _, rows = sim.rows(1)
        fmu.set(**given)
        fmu.step()
        assert same(fmu.get(*channels), [float(x) for x in rows[0]]), k
        (bits,) = fmu.get("warnings")
        on = shorted_machine.WARNING in firmware.warnings(int(bits))
        if on:
            largest_A = max(largest_A, *map(abs, fmu.get(*(f"plant.i_{leg}_A" for leg in LEGS))))
        if k >= 3000 and seen[-1:] != [on]:
            seen.append(on)
        if seen[-2:] == [True, False]:
            break
    assert seen == [False, True, False]
    settled_A = sim.machine.psi_f_Wb / sim.machine.ld_H
    assert settled_A < largest_A < 2.5 * settled_A


def test_a_reset_a_kept_state_and_a_second_instance_give_the_same_bits(made):
    _, _, folder = made()

    def go_on(fmu, begin, end):
        found = []
        for k in range(begin, end):
            fmu.set(**course(k))
            fmu.step()
            found.append(fmu.outputs)
        return found

    fmu, other = Fmu(folder).begin(), Fmu(folder).begin()
    first = go_on(fmu, 0, 1720)
    raw = fmu.bytes_of(fmu.fmu.getFMUState())
    later = go_on(fmu, 1720, 1800)
    go_on(other, 0, 30)
    other.go_back(raw)
    assert go_on(other, 1720, 1800) == later
    fmu.fmu.reset()
    fmu.time_s = 0.0
    fmu.begin()
    assert go_on(fmu, 0, 200) == first[:200]


def test_a_leg_that_is_whole_again_stays_whole_though_its_contact_still_bounced(made):
    """A contact bounces for 2 ms: 20 periods. All six may break in one step."""
    fmu = Fmu(made()[2]).begin()
    fmu.set(**{f"break_{leg}": 1 for leg in LEGS})
    fmu.step()
    fmu.set(**{f"break_{leg}": 0 for leg in LEGS})
    for _ in range(30):
        fmu.step()
    fmu.set(run=True, speed_ref_rpm=200.0)
    for _ in range(1500):
        fmu.step()
    state, faults = fmu.get("state", "faults")
    assert (state, faults) == (firmware.lib.HT_STATE_RUN, 0) and not fmu.said


def test_fmpy_finds_nothing_wrong(made):
    _, path, _ = made()
    assert validate_fmu(str(path)) == []


@pytest.mark.parametrize(
    "values, line",
    [
        ({"break_v1": 5}, "break_v1 = 5: allowed range is 0 .. 4"),
        ({"load_Nm": float("inf")}, "load_Nm = inf: a finite number is needed"),
    ],
)
def test_a_mistake_is_one_line_and_changes_nothing(made, values, line):
    fmu = Fmu(made()[2]).begin()
    with pytest.raises(FMICallException):
        fmu.set(**values)
    assert fmu.said == [("discard", line)]
    assert fmu.get(*values) == [0]


@pytest.mark.parametrize("periods", (1.5, 0.5, 0.0, -1.0, 1.001, math.nan, math.inf))
def test_a_step_that_is_no_multiple_of_the_period_is_refused(made, periods):
    """One line and a status; the machine and the time stand still, as if nobody had asked."""
    _, _, folder = made()
    asked, other = Fmu(folder).begin(), Fmu(folder).begin()
    for fmu in (asked, other):
        fmu.set(run=True, speed_ref_rpm=100.0)
        fmu.step(20 * fmu.period_s)
    before, now_s = asked.get(*TRUE), asked.time_s
    with pytest.raises(FMICallException):
        asked.step(periods * asked.period_s)
    ((status, line),) = asked.said
    assert status == "discard" and "\n" not in line
    assert line.startswith("communication step = ") and f"allowed is {asked.period_s!r} s" in line
    assert same(asked.get(*TRUE), before)
    asked.time_s = now_s
    for fmu in (asked, other):
        fmu.step(3 * fmu.period_s)
    assert same(asked.get(*TRUE), other.get(*TRUE))
