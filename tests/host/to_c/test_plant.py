"""The plant in C is the plant in Python: the same bits of every sample, edge and state, in each
effect. Every line of the C runs in these courses, but those after a failure."""

import ctypes
import gzip
import itertools
import json
import shutil
import subprocess
import zlib
from functools import partial

import drawn_setups
import numpy as np
import pytest
from example_setups import EXAMPLES

from hexatorque import firmware, load
from hexatorque.drive import hardware
from hexatorque.drive.parts import pwm_map
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant import elementary
from hexatorque.plant.compiled import compiled
from hexatorque.plant.gates import GATES, gates_record, suppress_short_pulses
from hexatorque.plant.link import V
from hexatorque.plant.machines import DISPLACEMENTS_DEG, MODELS
from hexatorque.plant.pwm import PWM, PWM_MAP, pwm_record, pwm_segment
from hexatorque.to_c import library, plant
from hexatorque.to_c.translator import Translator
from hexatorque.to_c.types import INT, REAL, WORD, Array

#: So that a course is short.
SHORT = {"controller.calibration_s": 0.01, "controller.build_s": 0.1}
IRON = {"machine.iron_hysteresis_A_Wb": 0.1, "machine.iron_eddy_S": 1e-3}
DROPS = {
    "inverter.v_switch_V": 1.2,
    "inverter.v_diode_V": 1.0,
    "inverter.r_switch_ohm": 0.1,
    "inverter.r_diode_ohm": 0.05,
}
ARC = {"inverter.arc_V": 25.0, "inverter.restrike_V_per_ms": 50.0, "inverter.bounce_ms": 2.0}
HEAT = {"heat.winding_K_W": 0.5, "heat.time_lapse": 100.0}
DEVICES = {
    "heat.switch_K_W": [0.1, 0.2, 0.3, 0.4],
    "inverter.e_on_mJ": 1.0,
    "inverter.e_off_mJ": 1.0,
    "inverter.e_ref_V": 300.0,
    "inverter.e_ref_A": 10.0,
}
LINK = {"inverter.link_F": 200e-6, "inverter.source_ohm": 0.5}
LINK_H = LINK | {"inverter.source_H": 1e-3}
LINE = LINK_H | {"inverter.line_Hz": 50.0}
PRECHARGE = LINE | {
    "inverter.link_F": 2e-3,
    "inverter.precharge_ohm": 5.0,
    "controller.precharge_V": 200.0,
}
DIRECT = {"inverter.line_Hz": 0.0, "inverter.source_H": 0.0}

ABSOLUTE = {
    "sensors.absolute_counts_rev": 1000,
    "sensors.absolute_deg": 33.0,
    "sensors.absolute_direction": "reversed",
}

#: A chopper that the drive switches.
OUTPUT = {
    "inverter.chopper_ohm": 40.0,
    "controller.chopper_on_V": 307.0,
    "controller.chopper_off_V": 303.0,
}
THERMISTORS = {"sensors.winding_ntc_ohm": 10e3, "sensors.sink_ntc_ohm": 10e3}


def chopper(on_V):
    """A braking chopper that is on at times, even while the drive does not brake."""
    return {
        "inverter.chopper_ohm": 40.0,
        "inverter.chopper_on_V": on_V,
        "inverter.chopper_off_V": on_V - 2.0,
    }


#: What does not end because of what a test breaks.
BEARS = {"controller.scheme": "db-dtfc", "timing.latency": "predicted"}


def run_and_stop(sim):
    sim.start()
    sim.run(0.13)
    sim.set_many({"speed_ref_rpm": 300.0, "load_Nm": 0.5})
    sim.run(0.1)
    sim.stop()
    sim.run(0.06)


def brake_and_stop(sim, charged_V=0.0):
    if charged_V:
        sim.inverter.link.x[V] = charged_V
        sim.run(0.01)
    sim.start()
    sim.run(0.13)
    sim.set("speed_ref_rpm", 400.0)
    sim.run(0.1)
    sim.set("speed_ref_rpm", -400.0)
    sim.run(0.06)
    sim.stop()
    sim.run(0.06)


def precharge_and_run(sim):
    sim.run(0.5)
    sim.start()
    sim.run(0.13)
    sim.stop()
    sim.inverter.link.x[V] = 50.0
    sim.run(0.06)


charged = partial(brake_and_stop, charged_V=310.0)


def broken(*breaks, speed_rpm=200.0):
    """A course in which legs break: (phase, kind, when)."""

    def course(sim):
        if speed_rpm > 200:
            sim.plant_state[6] = speed_rpm * np.pi / 30
        sim.start()
        sim.run(0.13)
        sim.set_many({"speed_ref_rpm": speed_rpm, "load_Nm": 0.3})
        sim.run(0.05)
        for phase, kind, after_s in breaks:
            sim.break_leg(phase, kind, after_s)
        sim.run(0.08)
        sim.stop()
        sim.run(0.05)

    return course


OPEN = broken(("u1", "open", 0.01))
THREE = broken(("u1", "open", 0.01), ("u2", "open", 0.01), ("w1", "open", 0.012))
FAST = broken(("u1", "open", 0.01), ("w2", "blocked", 0.03), speed_rpm=2900.0)
SWITCHES = broken(("w1", "lower", 0.005), ("v2", "upper", 0.01), ("w1", "none", 0.03))
BLOCKED = broken(("v1", "blocked", 0.01), ("u2", "open", 0.02))
#: Functions that drawn registers go through, not all of them in these courses.
DRAWN = {f"plant_{name}" for name in (
    "pwm_segment", "leg_of_pins", "switch", "forced", "suppress_short_pulses",
    "cos", "exp", "expm1", "log", "power_of_2", "sin", "tanh", "turned",
)}  # fmt: skip
#: Functions that only the drive FMU calls; its tests hold them to the simulation.
OF_THE_FMU = {f"plant_{name}" for name in (
    "look", "current_A", "set_load", "shaft_step_s", "steepest_Nms"
)}  # fmt: skip
#: Lines that run for other firmware: this one starts the capture unit before it samples.
NEVER_RUN = {
    ("plant_capture", "se->event_tick = now;"),
    ("plant_capture", "return;"),
}
#: A brake that opens and closes at once.
HOLDING = {
    "load.holding_Nm": 4.0,
    "load.holding_open_s": 0.0,
    "load.holding_close_s": 0.01,
    "controller.brake_close_s": 0.0,
}


def hold_and_run(sim):
    """The load slips through the brake and is held again, the drive starts and stops."""
    sim.set("load_Nm", 5.0)
    sim.run(0.02)
    sim.set("load_Nm", -0.2)
    sim.run(0.05)
    run_and_stop(sim)


#: Iron that saturates.
MAP = {"machine.flux_map": str(EXAMPLES / "magnet-saturation.csv")}


def beyond(sim):
    """Fluxes that the table does not have, in either axis, with legs that float."""
    sim.start()
    sim.run(0.13)
    sim.break_leg("u1", "open", 0.0)
    sim.run(0.03)
    for flux in ((0.9, 0.02), (0.1, -0.9), (-0.9, 0.8)):
        sim.plant_state[:2] = flux
        sim.run(0.002)


#: What is computed -> set-up, its changes, course.
COURSES = {
    "linear": {
        "whole": ("paper-b", {}, run_and_stop),
        "immediate load": ("paper-a", {}, run_and_stop),
        "sensors": (
            "paper-b",
            {
                "sensors.i_noise_A": 0.05,
                "sensors.i_filter_Hz": 5e3,
                "sensors.encoder_error_cycles": 0.02,
                "sensors.encoder_index_deg": 0.5,
                "sensors.adc_bits": 10,
                "inverter.min_pulse_us": 1.5,
            },
            run_and_stop,
        ),
        "open": ("paper-b", BEARS, OPEN),
        "switches": ("paper-b", BEARS, SWITCHES),
        "blocked": ("paper-b", BEARS, BLOCKED),
        "arc": ("paper-b", BEARS | ARC, OPEN),
        "drops": ("paper-b", BEARS | DROPS, SWITCHES),
        "drops and arc": ("paper-a", DROPS | ARC, BLOCKED),
        "friction": ("paper-b", {"load.kind": "friction"}, run_and_stop),
        "brake": ("paper-b", {"load.kind": "brake"}, run_and_stop),
        "fan": ("paper-b", {"load.kind": "fan"}, run_and_stop),
        "swapped": ("paper-b", {"sensors.encoder_wires": "swapped"}, run_and_stop),
        "one open": ("paper-b", {"sensors.encoder_wires": "one open"}, run_and_stop),
        "open wires": ("paper-b", {"sensors.encoder_wires": "open"}, run_and_stop),
        "absolute": ("paper-b", ABSOLUTE | {"sensors.absolute_fault": "flickers"}, run_and_stop),
        "absolute, stuck": (
            "paper-b",
            ABSOLUTE | {"sensors.absolute_fault": "stuck"},
            run_and_stop,
        ),
        "absolute, silent": (
            "paper-b",
            ABSOLUTE | {"sensors.absolute_fault": "silent"},
            run_and_stop,
        ),
        "fast": ("paper-b", BEARS, FAST),
        "fast, arc": ("paper-b", BEARS | ARC, FAST),
        "symmetrical": ("symmetrical", {}, run_and_stop),
        "iron": ("paper-b", BEARS | IRON, OPEN),
        "heat": ("paper-b", IRON | HEAT, run_and_stop),
        "devices": ("paper-b", BEARS | DROPS | DEVICES, SWITCHES),
        "devices, arc": ("paper-b", BEARS | DROPS | DEVICES | ARC | LINK, OPEN),
        "holding": ("paper-b", HOLDING, hold_and_run),
        "link": ("paper-b", BEARS | LINK, OPEN),
        "link, inductance": ("paper-b", BEARS | LINK_H, brake_and_stop),
        "link, chopper": (
            "paper-b",
            BEARS | LINK_H | {"inverter.link_F": 30e-6} | chopper(303.0),
            charged,
        ),
        "link, chopper of the drive": ("paper-b", BEARS | LINK | OUTPUT, charged),
        "thermistors": ("paper-b", THERMISTORS, run_and_stop),
        "thermistors by turns": ("paper-a", THERMISTORS, run_and_stop),
        "rectifier": ("paper-b", BEARS | LINE, OPEN),
        "rectifier, gaps": ("paper-b", LINE | {"inverter.link_F": 20e-6}, run_and_stop),
        "precharge": ("paper-b", PRECHARGE, precharge_and_run),
        "precharge, direct": ("paper-b", PRECHARGE | DIRECT, precharge_and_run),
    },
    "saturable": {
        "whole": ("paper-b", {"machine.psi_knee_Wb": 0.8}, run_and_stop),
        "open": ("paper-b", BEARS | {"machine.psi_knee_Wb": 0.8}, OPEN),
        "drops": ("paper-b", BEARS | DROPS | ARC | {"machine.psi_knee_Wb": 0.8}, BLOCKED),
        "iron": ("paper-b", IRON | {"machine.psi_knee_Wb": 0.8}, run_and_stop),
        "link": ("paper-b", BEARS | LINK_H | {"machine.psi_knee_Wb": 0.8}, run_and_stop),
        "heat": ("paper-b", IRON | HEAT | {"machine.psi_knee_Wb": 0.8}, run_and_stop),
    },
    "magnet": {
        "whole": ("magnet-interior", {}, run_and_stop),
        "drops": ("magnet-interior", DROPS | ARC, BLOCKED),
        "open": ("magnet-surface", IRON, OPEN),
        "fast": ("magnet-surface", {}, FAST),
        "salient": ("magnet-interior", {}, BLOCKED),
        # legs that float while the axes lie so that the rows of their equations change places
        "salient, open": ("magnet-interior", {}, THREE),
        "link": ("magnet-interior", LINK, run_and_stop),
        "heat": ("magnet-interior", IRON | HEAT, run_and_stop),
        "devices": ("magnet-interior", DROPS | DEVICES, run_and_stop),
        "holding": ("magnet-interior", HOLDING, hold_and_run),
    },
    "magnet, saturable": {
        "whole": ("magnet-interior", MAP, run_and_stop),
        "drops": ("magnet-interior", MAP | DROPS | ARC, BLOCKED),
        "open": ("magnet-interior", MAP | IRON, THREE),
        "fast": ("magnet-interior", MAP, FAST),
        "link": ("magnet-interior", MAP | LINK, run_and_stop),
        "heat": ("magnet-interior", MAP | IRON | HEAT, run_and_stop),
        "beyond": ("magnet-interior", MAP, beyond),
    },
}


def counting(files, folder):
    """A library of translated functions that counts how often each line runs."""
    compiler = shutil.which("gcc")
    if not (compiler and shutil.which("gcov")):
        pytest.skip("gcc and gcov are missing: apt-get install gcc")
    text = "void __gcov_dump(void);\nint dump(void);\nint dump(void)\n{\n    __gcov_dump();\n"
    (folder / "dump.c").write_text(f"{text}    return 0;\n}}\n")
    return library.build(files, folder, compiler, "-O0", "--coverage", "dump.c")


def result(setup, course, run_periods):
    """Sums over all bits that a course leaves, and what it returns."""
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hardware, "run_periods", run_periods)
        sim = SimulatedDrive(setup)
        if setup["sensors.encoder_wires"] != "straight":  # a frozen sensor beside it
            sim.sensors.hold[6:] = 1
        sim.log_edges(100_000)
        found["course"] = course(sim)
        recording = sim.take()
        for channel in recording.channels:
            found[channel] = zlib.crc32(np.ascontiguousarray(recording[channel]).tobytes())
    parts = ("plant_state", "_machine", "inverter", "sensors", "edges", "_pwm", "_gates")
    for part in (*parts, "_registers"):
        found[part] = zlib.crc32(getattr(sim, part).tobytes())
    return found, sim


def ran(folder, made):
    """(function, line) of the C -> whether it has run, without what only a failure runs."""
    made.call("dump")
    command = ["gcov", "--json-format", "--object-directory", ".", "libplant.so-ht_plant.gcda"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    (report,) = folder.glob("*.gcov.json.gz")
    (file,) = (f for f in json.loads(gzip.decompress(report.read_bytes()))["files"]
               if f["file"].endswith("ht_plant.c"))  # fmt: skip
    text = [line.strip() for line in (folder / "ht_plant.c").read_text().splitlines()]
    found = {}
    for line in file["lines"]:
        here, before = text[line["line_number"] - 1], text[line["line_number"] - 2]
        if "*failed" not in here and "*failed" not in before:
            row = line.get("function_name", ""), here.replace(", failed)", ")")
            found[row] = found.get(row, False) or line["count"] > 0
    return found


def test_every_sample_edge_and_state_has_the_bits_of_the_compiled_python(tmp_path):
    numba = hardware.run_periods
    lines = {}
    for kind, courses in COURSES.items():
        made = None
        for what, (name, changes, course) in courses.items():
            setup = load(name).changed(SHORT | changes)
            wanted, sim = result(setup, course, numba)
            if made is None:
                (tmp_path / kind).mkdir()
                made = counting(plant.translate(sim._machine.dtype), tmp_path / kind)
            got, _ = result(setup, course, made.run_periods)
            assert got == wanted, f"{kind}, {what}"
        for line, done in ran(tmp_path / kind, made).items():
            lines[line] = lines.get(line, False) or done
    elsewhere = DRAWN | OF_THE_FMU
    missed = {row for row, done in lines.items() if not done and row[0] not in elsewhere}
    assert sorted(missed - NEVER_RUN) == []
    assert missed == NEVER_RUN


#: So many that each effect is on and off beside each other one.
DRAWN_CASES, DRAWN_PERIODS = 180, 350
#: But not these: one of them needs the other.
NEED_EACH_OTHER = {
    frozenset((f"inverter.{needs}", f"inverter.{needed}"))
    for needs, needed in (
        *itertools.product(("line_Hz", "precharge_ohm", "chopper_ohm"), ("link_F",)),
        *itertools.product(("e_on_mJ", "e_off_mJ"), ("e_ref_V", "e_ref_A")),
        ("line_Hz", "source_H"),
    )
}


def test_drawn_set_ups_and_faults_have_the_bits_of_the_compiled_python(tmp_path):
    """Each effect on and off beside each other one, every scheme, every winding of both kinds of
    machine, and every event."""
    numba = hardware.run_periods
    rng = np.random.default_rng(2)
    made, cases, seen, machines = {}, [], set(), set()
    for seed in range(DRAWN_CASES):
        setup, on = drawn_setups.drawn(rng)
        course = partial(drawn_setups.course, seed=seed, periods=DRAWN_PERIODS)
        wanted, sim = result(setup, course, numba)
        kind = sim._machine.dtype
        if kind not in made:
            folder = tmp_path / str(len(made))
            folder.mkdir()
            made[kind] = library.build(plant.translate(kind), folder, "cc", "-O1")
        got, _ = result(setup, course, made[kind].run_periods)
        assert got == wanted, f"case {seed}: {setup.name}, {sorted(on)}, {wanted['course']}"
        cases.append((set(setup), on))
        seen.update(wanted["course"], [setup["controller.scheme"]])
        machines.add((setup["machine.model"], setup["machine.displacement_deg"]))
    assert seen >= {"run", "fault", "short circuit", *firmware.parameters()["scheme"].choices}
    assert seen >= {event.__name__ for event in drawn_setups.EVENTS}
    assert len(machines) == len(MODELS) * len(DISPLACEMENTS_DEG) and len(made) == len(COURSES)
    for a, b in itertools.permutations(drawn_setups.EFFECTS, 2):
        found = {(a in on, b in on) for paths, on in cases if {a, b} <= paths}
        both = frozenset((a, b)) in NEED_EACH_OTHER
        assert not found or both or found >= {(True, False), (True, True), (False, False)}, (a, b)


PERIOD = 60


def drawn_registers(rng, map_, registers):
    """Writes of any kind to the modules of all legs."""
    for leg in range(6):
        base = map_.epwm + leg * map_.stride
        for name, bits in (
            ("cmpctl", 0x5F), ("aqctla", 0xFFF), ("aqsfrc", 7), ("dbctl", 0xF), ("tzctl", 0xF)
        ):  # fmt: skip
            if rng.random() < 0.5:
                registers[base + map_[name]] = rng.integers(0, 0x10000) & bits
        for name in ("cmpa", "cmpb", "dbred", "dbfed"):
            registers[base + map_[name]] = rng.integers(0, PERIOD + 4) * rng.integers(0, 2)
        if map_.aqctl >= 0:
            registers[base + map_.aqctl] = rng.integers(0, 32)
        if rng.random() < 0.5:
            registers[base + map_.cmpctl] = 0
        registers[base + map_.tbprd] = PERIOD - 1
        registers[base + map_.tzflg] = 4 * (rng.random() < 0.2)


def test_modules_of_the_pwm_and_gate_drivers_have_the_same_bits_for_drawn_registers(tmp_path):
    t = Translator(lambda function, kinds: function)
    pm, ps, gd = (t.record(*row) for row in (
        (PWM_MAP, "plant_map"), (PWM, "plant_pwm"), (GATES, "plant_gates")
    ))  # fmt: skip
    words = Array(WORD, (None,))
    t.function(pwm_segment, [pm, words, ps, INT, INT, INT], "segment")
    t.function(suppress_short_pulses, [gd, pm, words, ps, INT, INT, INT, INT], "suppress")
    made = counting(plant.files(t), tmp_path)
    rng = np.random.default_rng(1)
    edges = 0
    for map_ in (firmware.lib.ht_f28335, firmware.lib.ht_f28377s):
        pm = pwm_map(map_, min_pulse_us=0.1)
        two = [(pwm_record(), gates_record(7), np.zeros(0x8000, np.uint16)) for _ in range(2)]
        for period in range(300):
            drawn = np.zeros(0x8000, np.uint16)
            drawn_registers(rng, pm, drawn)
            n, c0 = 0, 0
            for c1 in (*sorted(rng.integers(0, PERIOD, 1)), PERIOD):
                results = []
                for (ps, gd, registers), segment, suppress in zip(
                    two, (pwm_segment, partial(made.call, "segment")),
                    (suppress_short_pulses, partial(made.call, "suppress")),
                ):  # fmt: skip
                    if c0 == 0:
                        registers[:] = drawn
                    count = segment(pm, registers, ps, c0, c1, n)
                    count = suppress(gd, pm, registers, ps, c0, c1, n, count)
                    results.append((count, ps.tobytes(), gd.tobytes(), registers.tobytes()))
                assert results[0] == results[1], f"period {period}, counts {c0} to {c1}"
                n, c0 = results[0][0], c1
            edges += n
    assert edges > 1000
    assert {row for row, done in ran(tmp_path, made).items() if not done} == set()


@compiled
def six_functions(x, found):
    found[0] = elementary.cos(x)
    found[1] = elementary.exp(x)
    found[2] = elementary.expm1(x)
    found[3] = elementary.log(abs(x))
    found[4] = elementary.sin(x)
    found[5] = elementary.tanh(x)


def test_elementary_functions_have_the_same_bits_for_drawn_numbers(tmp_path):
    t = Translator(lambda function, kinds: function)
    t.function(six_functions, [REAL, Array(REAL, (None,))], "six_functions")
    made = counting(plant.files(t), tmp_path)
    rng = np.random.default_rng(1)
    wanted, got = np.zeros(6), np.zeros(6)
    for exponent in (-300, -8, -1, 0, 1, 2, 2.5, 3, 6):
        for x in (rng.uniform(-1, 1, 200) * 10.0**exponent).tolist():
            six_functions(x, wanted)
            made.call("six_functions", ctypes.c_double(x), got)
            assert got.tobytes() == wanted.tobytes(), x
    assert {row for row, done in ran(tmp_path, made).items() if not done} == set()
