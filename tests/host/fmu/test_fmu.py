"""The controller FMU, run by FMPy: it computes what the simulation's controller computes, bit for
bit, and refuses what it cannot do in one line."""

import math
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shorted_machine

from hexatorque import firmware, setups
from hexatorque.results import waiting

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed: pip install fmpy")
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmu_masters import (  # noqa: E402
    COURSES,
    LEGS,
    Fmu,
    Plant,
    command,
    made_once,
    registers_of,
    same,
)

#: A start that does not take long.
SHORT = {"controller.calibration_s": 0.01, "controller.build_s": 0.1}
GATES = [f"gate_{leg}" for leg in LEGS]


@pytest.fixture(scope="module", params=(2, 3), ids=("fmi2", "fmi3"))
def made(request, tmp_path_factory):
    """Files and folders of FMUs by set-up; each is made once."""
    place = tmp_path_factory.mktemp("fmu")
    kept = {}

    def make(name="paper-a", changes=None):
        changes = changes or {}
        key = (name, *sorted(changes.items()))
        setup = setups.load(name).changed(SHORT | changes)
        return made_once(kept, place, key, setup, version=request.param)

    return make


@pytest.mark.parametrize(
    "name, changes",
    [
        ("paper-a", {}),
        ("paper-a", {"timing.device": "f28335", "controller.scheme": "db-dtfc"}),
        ("paper-b", {"controller.scheme": "dtc3", "timing.latency": "immediate"}),
    ],
)
def test_it_computes_the_bits_of_the_simulation(made, name, changes):
    """The sensors' noise, offsets and gains belong to the plant: what the FMU gets are currents
    that the readings stand for."""
    setup, _, folder = made(name, changes)
    plant, fmu = Plant(setup), Fmu(folder).begin()
    names = [n for n in fmu.variables if n.startswith("channel.")]
    states, levels = set(), set()
    for k in range(2700):
        given = COURSES["controller"].get(k, {})
        command(plant.sim, given)
        plant.step()
        fmu.set(**plant.inputs, **given)
        fmu.step()
        assert same(fmu.get(*names), plant.channels), k
        assert registers_of(fmu) == plant.registers, k
        states.add(plant.sim.state)
        levels.update(row[0] for row in plant.registers)
    assert {"idle", "calibrate", "build", "run"} <= states and levels == {False, True}
    assert plant.sim.controller.registers.violations == 0 and not fmu.said


INDEX_DEG, START_DEG = 30.0, 100.0
ENCODERS = {
    "index": {"sensors.encoder_index_deg": INDEX_DEG, "controller.rotor_start": "index"},
    "absolute": {
        "sensors.absolute_counts_rev": 1000,
        "sensors.absolute_deg": INDEX_DEG,
        "controller.rotor_start": "absolute",
    },
    "reversed": {"sensors.absolute_direction": "reversed"},
}
ENCODERS["reversed"] |= ENCODERS["absolute"]


def magnets(start, wrong_deg=0.0):
    """A machine whose d axis is at START_DEG at the first angle; its encoder's index or zero is
    INDEX_DEG of the shaft further."""
    pairs = setups.load("magnet-surface")["machine.pole_pairs"]
    zero_deg = START_DEG + INDEX_DEG * pairs + wrong_deg
    return ENCODERS[start] | {
        "machine.start_deg": START_DEG,
        "controller.rotor_zero_deg": (zero_deg + 180) % 360 - 180,
    }


@pytest.mark.parametrize(
    "start, way, wrong_deg",
    [
        ("index", 1, 0.0),
        ("index", -1, 0.0),
        ("index", 1, 180.0),
        ("absolute", 1, 0.0),
        ("reversed", -1, 0.0),
        ("absolute", -1, 180.0),
    ],
)
def test_index_and_absolute_encoder_have_the_bits_of_the_simulation(made, start, way, wrong_deg):
    """The shaft is turned by hand over the index, from either side, and held. A wrong angle is
    found before the shaft has turned by a quarter of an electrical turn."""
    setup, _, folder = made("magnet-surface", magnets(start, wrong_deg))
    plant, fmu = Plant(setup), Fmu(folder).begin()
    names = [n for n in fmu.variables if n.startswith("channel.")]
    start_at = 1100
    for k in range(5000):
        given = {"run": True, "speed_ref_rpm": way * 300.0} if k == start_at else {}
        if k < start_at:
            turns = k < (150 if way > 0 else 1000)
            plant.sim.plant_state[6] = way * 60.0 if turns else 0.0
            begun_rad = plant.sim.plant_state[7]
        command(plant.sim, given)
        plant.step()
        fmu.set(**plant.inputs, **given)
        fmu.step()
        assert same(fmu.get(*names), plant.channels), k
        if k > start_at and plant.sim.faults:
            break
    assert not fmu.said
    way_rad = plant.sim.plant_state[7] - begun_rad
    if wrong_deg:
        assert plant.sim.faults == ["encoder against flux speed"]
        assert abs(way_rad) * setup["machine.pole_pairs"] < math.pi / 2
    else:
        assert fmu.get("state") == [firmware.lib.HT_STATE_RUN]
        assert abs(fmu.get("channel.speed_rpm")[0] - way * 300) < 15


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("start", ENCODERS)
def test_index_and_absolute_zero_are_fixed_to_the_shaft(made, start, way):
    """Whatever the first angle, where the counter is 0, both are where the set-up tells. An index
    pulse may be a line wide, four counts, and a reading tells no more than its step."""
    setup, _, folder = made("magnet-surface", magnets(start))
    counts_rev = 4 * setup["sensors.encoder_ppr"]
    reading = counts_rev / 1000 if start != "index" else 0
    for first_rad in (0.0, 1.0, -9.0, 100.0):
        fmu = Fmu(folder).begin(vdc_V=setup["inverter.vdc_V"], position_rad=first_rad)
        assert fmu.get("channel.zero_counts") == [-1]
        for k in range(4000):
            fmu.set(position_rad=first_rad + way * 7.0 * min(k / 3000, 1))
            fmu.step()
        zero = (math.radians(INDEX_DEG) - first_rad) / (2 * math.pi) * counts_rev
        off = (fmu.get("channel.zero_counts")[0] - zero + counts_rev / 2) % counts_rev
        assert abs(off - counts_rev / 2) <= 4 + reading, first_rad


def test_without_an_index_and_without_readings_the_drive_does_not_start(made):
    _, _, folder = made("magnet-surface", magnets("index"))
    fmu = Fmu(folder).begin(vdc_V=60.0, run=True)
    fmu.step()
    ((status, line),) = fmu.said
    assert status == "warning" and line.startswith("run: the index has not passed"), line
    _, _, folder = made(
        "magnet-surface", magnets("absolute") | {"sensors.absolute_fault": "silent"}
    )
    fmu = Fmu(folder).begin(vdc_V=60.0, run=True)
    for _ in range(round(0.2 / fmu.period_s)):
        fmu.step()
        assert not any(fmu.get(*GATES))
    assert fmu.get("state") == [firmware.lib.HT_STATE_FAULT] and not fmu.said
    assert firmware.causes(int(fmu.get("faults")[0])) == ["absolute encoder"]


@pytest.fixture(scope="module")
def running(made):
    """An FMU whose drive runs, as bytes, and what the sensors of its plant see in the next
    periods."""
    setup, _, folder = made()
    plant, fmu = Plant(setup), Fmu(folder).begin()
    command(plant.sim, {"run": True, "speed_ref_rpm": 200.0})
    fmu.set(run=True, speed_ref_rpm=200.0)
    for _ in range(1300):
        plant.step()
        fmu.set(**plant.inputs)
        fmu.step()
    assert plant.sim.state == "run"
    inputs = []
    for _ in range(300):
        plant.step()
        inputs.append(dict(plant.inputs))
    return fmu.bytes_of(fmu.fmu.getFMUState()), inputs


@pytest.fixture
def in_run(made, running):
    """Such an FMU, and the inputs to come."""
    raw, inputs = running
    fmu = Fmu(made()[2]).begin()
    fmu.go_back(raw)
    return fmu, inputs


def answers(fmu, inputs):
    """All outputs after each period."""
    found = []
    for given in inputs:
        fmu.set(**given)
        fmu.step()
        found.append(fmu.outputs)
    return found


def test_two_instances_do_not_disturb_each_other(made, in_run):
    fmu, inputs = in_run
    inputs = inputs[:50]
    other, alone = (Fmu(made()[2]).begin() for _ in range(2))
    idle = {"i_u1_A": 1.0, "vdc_V": 250.0}
    kept = fmu.fmu.getFMUState()
    expected = answers(fmu, inputs), answers(alone, [idle] * len(inputs))
    fmu.fmu.setFMUState(kept)
    mixed = [], []
    for given in inputs:
        mixed[0].extend(answers(fmu, [given]))
        mixed[1].extend(answers(other, [idle]))
    assert mixed == expected and mixed[0] != mixed[1]


def test_a_kept_state_continues_with_the_same_bits(made, running):
    """In the instance that has kept it, from bytes in another one, and in another process."""
    raw, inputs = running
    folder = made()[2]
    fmu = Fmu(folder).begin()
    fmu.go_back(raw)
    kept = fmu.fmu.getFMUState()
    assert fmu.bytes_of(kept) == raw
    expected = answers(fmu, inputs)
    assert len(set(expected)) == len(inputs)  # it computes something
    fmu.fmu.setFMUState(kept)
    fmu.fmu.freeFMUState(kept)
    assert answers(fmu, inputs) == expected
    program = (
        "import sys, pickle; sys.path[:0] = pickle.load(sys.stdin.buffer); "
        "from fmu_masters import Fmu; from test_fmu import answers; "
        "folder, raw, inputs = pickle.load(sys.stdin.buffer); fmu = Fmu(folder).begin(); "
        "fmu.go_back(raw); pickle.dump(answers(fmu, inputs), sys.stdout.buffer)"
    )
    folders = [str(Path(of.__file__).parent) for of in (sys.modules[__name__], shorted_machine)]
    sent = pickle.dumps(folders) + pickle.dumps((str(folder), raw, inputs))
    done = subprocess.run([sys.executable, "-c", program], input=sent, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    assert pickle.loads(done.stdout) == expected


def test_a_stop_after_a_restored_state_is_a_falling_edge(made, running):
    """The inputs belong to the state: `run` was true there."""
    raw, inputs = running
    fmu = Fmu(made()[2]).begin()
    fmu.go_back(raw)
    fmu.set(run=False)
    assert answers(fmu, inputs[:3])
    assert fmu.get("state") == [0] and not any(fmu.get(*GATES))


def test_a_state_of_another_fmu_is_refused(made, running):
    _, _, folder = made("paper-b", {"controller.scheme": "dtc3", "timing.latency": "immediate"})
    other = Fmu(folder).begin()
    with pytest.raises(FMICallException):
        other.go_back(running[0])
    assert other.said == [("error", "the kept state is of another FMU")]


@pytest.mark.parametrize("share", [0, 0.002, 0.5, 1])
def test_a_state_that_is_damaged_is_refused(made, running, share):
    raw = bytearray(running[0])
    raw[round(share * (len(raw) - 1))] ^= 0x40
    fmu = Fmu(made()[2]).begin()
    before = fmu.outputs
    with pytest.raises(FMICallException):
        fmu.go_back(bytes(raw))
    assert fmu.said == [("error", "the kept state is damaged")] and fmu.outputs == before


def test_a_reset_begins_anew(made):
    _, _, folder = made()
    steady = [{"i_u1_A": 0.3, "vdc_V": 250.0, "run": True}] * 150
    fmu = Fmu(folder).begin(parameter__kp_speed_Nms_rad=0.125)
    first = answers(fmu, steady)
    fmu.fmu.reset()
    assert fmu.get("run", "i_u1_A") == [False, 0.0]
    assert fmu.get("parameter.kp_speed_Nms_rad") != [0.125]
    assert fmu.get("parameter.kp_speed_Nms_rad") == Fmu(folder).get("parameter.kp_speed_Nms_rad")
    fmu.begin(parameter__kp_speed_Nms_rad=0.125)
    assert answers(fmu, steady) == first


def test_a_step_may_be_several_periods(made):
    """Inputs that stand still give the same in one step of ten periods as in ten."""
    _, _, folder = made()
    one, ten = Fmu(folder).begin(), Fmu(folder).begin()
    for fmu in (one, ten):
        fmu.set(vdc_V=250.0, run=True)
    for k in range(200):
        if k:
            one.step(10 * one.period_s)
            for _ in range(10):
                ten.step()
        assert one.outputs == ten.outputs
    assert one.get("state") != [0]


@pytest.mark.parametrize("periods", (1.5, 0.5, 0.0, -1.0, 1.001, math.nan, math.inf))
def test_a_step_that_is_no_multiple_of_the_period_is_refused(made, periods):
    _, _, folder = made()
    fmu = Fmu(folder).begin()
    with pytest.raises(FMICallException):
        fmu.step(periods * fmu.period_s)
    ((status, line),) = fmu.said
    assert status == "discard" and "\n" not in line
    assert line.startswith("communication step = ") and f"allowed is {fmu.period_s!r} s" in line
    fmu.time_s = 0.0
    fmu.step()  # nothing is lost


@pytest.mark.parametrize(
    "given, line",
    [
        ({"parameter__rs_ohm": 5000.0}, "rs_ohm = 5000: allowed range is 0 .. 1000 ohm"),
        ({"parameter__rs_ohm": math.nan}, "rs_ohm = nan: allowed range is 0 .. 1000 ohm"),
        ({"speed_ref_rpm": 1e5}, "speed_ref_rpm = 100000: allowed range is -60000 .. 60000 r/min"),
        ({"i_u1_A": math.inf}, "i_u1_A = inf: a finite number is needed"),
        ({"parameter__dead_time_us": 3.0}, "dead_time_us: not allowed in state run"),
        ({"parameter__f_isr_Hz": 5000.0}, "f_isr_Hz: not allowed in state run"),
    ],
)
def test_a_value_that_is_refused_is_told_and_changes_nothing(in_run, given, line):
    """Structural parameters are refused at run time, by the firmware's own message."""
    fmu, inputs = in_run
    (name,) = (name.replace("__", ".") for name in given)
    before = fmu.get(name), fmu.outputs
    with pytest.raises(FMICallException):
        fmu.set(**given)
    assert fmu.said == [("discard", line)]
    assert (fmu.get(name), fmu.outputs) == before
    answers(fmu, inputs[:1])
    assert fmu.get("state") == [3]


def test_parameters_that_do_not_fit_together_are_refused(made):
    _, _, folder = made()
    fmu = Fmu(folder)
    with pytest.raises(FMICallException):
        fmu.begin(parameter__vdc_min_V=400.0, parameter__vdc_max_V=300.0)
    ((status, line),) = fmu.said
    assert status == "error"
    assert line.startswith("parameters do not fit together: vdc_min_V = 400 V: must be below 300 V")


def test_a_trip_takes_the_gates_off_and_a_clear_is_refused_while_it_lasts(in_run):
    fmu, _ = in_run
    assert all(fmu.get(*GATES))
    fmu.set(trip=True)
    fmu.step()
    assert not any(fmu.get(*GATES)) and fmu.get("state", "faults") == [4, 0x10]
    fmu.set(clear=True, run=False)
    fmu.step()
    ((status, line),) = fmu.said
    assert (status, line[:27]) == ("warning", "clear: the trip pin is low ")
    fmu.set(clear=False, trip=False)
    fmu.step()
    fmu.set(clear=True)
    fmu.step()
    assert fmu.get("state", "faults") == [0, 0]
    fmu.step()  # `clear` is still true: that is no command any more
    assert len(fmu.said) == 1
    fmu.set(parameter__restart_count=1, run=True)
    fmu.step()
    assert fmu.said[1:] == [("warning", f"run: {waiting(60)}")]


def test_a_trip_above_the_ceiling_of_magnets_short_circuits_the_legs(made):
    """Up to the short circuit the registers are the simulation's. Then the gates are enabled and
    low: a plant that follows the outputs shorts its machine as the trip zone does. After it the
    gates are off."""
    setup, _, folder = made(shorted_machine.NAME, shorted_machine.CHANGES)
    plant, fmu = Plant(setup), Fmu(folder).begin()
    channels = [n for n in fmu.variables if n.startswith("channel.")]
    low = [(False, 1.0, 1.0, True)] * 6
    name, value = shorted_machine.TRIPS
    run_at, speed_at, trip_at, seen = 20, 1200, 3000, []
    for k in range(12_000):
        if k == run_at:
            plant.sim.start()
            fmu.set(run=True)
        if k == speed_at:
            plant.sim.set("speed_ref_rpm", shorted_machine.ABOVE_RPM)
            fmu.set(speed_ref_rpm=shorted_machine.ABOVE_RPM)
        if k == trip_at:
            assert plant.sim.state == "run"
            assert plant.sim.speed_rpm > shorted_machine.ABOVE_RPM / 1.1
            plant.sim.set(name, value)
            fmu.set(**{f"parameter__{name}": value})
        plant.step()
        fmu.set(**plant.inputs)
        fmu.step()
        assert same(fmu.get(*channels), plant.channels), k
        on = bool(plant.sim.controller.drive.short_circuit.on)
        assert registers_of(fmu) == (low if on else plant.registers), k
        if k >= trip_at and seen[-1:] != [on]:
            seen.append(on)
        if seen[-2:] == [True, False]:
            break
    assert seen == [False, True, False] and [row[3] for row in registers_of(fmu)] == [False] * 6


def test_a_description_of_another_set_up_is_refused(made):
    _, _, folder = made()
    with pytest.raises(Exception, match="instantiate"):
        Fmu(folder, guid="{0}")


def test_fmpy_finds_no_mistake(made):
    from fmpy.validation import validate_fmu

    _, path, _ = made()
    assert validate_fmu(str(path)) == []


def test_fmpy_simulates_it(made):
    """The whole way of a user, with FMPy's own master. At standstill without currents the drive
    stops by itself in the build-up or goes on; here only the calibration is long enough."""
    _, path, _ = made()
    signals = np.array(
        [(0.0, 250.0, False), (0.005, 250.0, True)],
        dtype=[("time", "f8"), ("vdc_V", "f8"), ("run", "?")],
    )
    result = fmpy.simulate_fmu(
        str(path), stop_time=0.01, output_interval=1e-4, input=signals, output=["state", "duty_u1"]
    )
    assert result["state"][0] == 0 and result["state"][-1] == 1


def test_start_values_are_the_set_ups(made):
    setup, _, folder = made("paper-b", {"controller.scheme": "dtc3", "timing.latency": "immediate"})
    fmu = Fmu(folder).begin()
    table = setups.parameters(setup)
    rows = firmware.parameters(setup["timing.device"])
    assert len([n for n in fmu.variables if n.startswith("parameter.")]) == len(table) - 2
    for name, value in table.items():
        path = name if name in ("speed_ref_rpm", "torque_ref_Nm") else f"parameter.{name}"
        number = np.float32(rows[name].parse(value))
        assert np.float32(fmu.get(path)[0]) == number, name
        assert np.float32(float(fmu.variables[path].start)) == number, name


def test_the_encoders_zero_is_the_first_angle(made):
    """As an incremental encoder's: a shaft that stands at another angle does not seem to turn. The
    numbers are sums of powers of two, so their differences are exact."""
    found = []
    for offset_rad in (0.0, 64.0):
        fmu = Fmu(made()[2]).begin()
        turning = [{"position_rad": offset_rad + k / 1024} for k in range(450)]
        found.append(answers(fmu, turning))
        assert abs(fmu.get("channel.speed_rpm")[0] - 10000 / 1024 * 30 / math.pi) < 1
    assert found[0] == found[1]
