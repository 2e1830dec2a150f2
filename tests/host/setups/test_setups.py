"""Set-ups and scenarios: what is refused, and with which message."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque import firmware, setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.setups import Profile, SetupError, new, schema
from hexatorque.setups.keys import needed

BASE = 'setup = "paper-b"\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[machine]\nrs_ohms = 1\n", ("machine.rs_ohms", "rs_ohm")),
        ("[machine]\nrs_ohm = -1\n", ("machine.rs_ohm", "0.0001 .. 1000 ohm")),
        ("[machine]\nrs_ohm = nan\n", ("machine.rs_ohm", "allowed range")),
        ("[machine]\nrs_ohm = inf\n", ("machine.rs_ohm", "allowed range")),
        ("[machine]\nrs_ohm = true\n", ("machine.rs_ohm", "number")),
        ('[machine]\nrs_ohm = "six"\n', ("machine.rs_ohm", "number")),
        ("[machine]\npsi_knee_Wb = 1e-200\n", ("machine.psi_knee_Wb", "0 (linear)", "0.001 Wb")),
        ("[machine]\npole_pairs = 1.5\n", ("machine.pole_pairs", "whole")),
        ("[machine]\ndrs_ohm = [1, 2]\n", ("machine.drs_ohm", "six")),
        ("[machine]\ndrs_ohm = [-7, 0, 0, 0, 0, 0]\n", ("machine.drs_ohm", "above 0")),
        ("[machina]\nrs_ohm = 1\n", ("machina", "machine")),
        ("machine = 3\n", ("machine", "table")),
        ("[machine]\nrs_ohm = { value = 6, tag = 'guess' }\n", ("machine.rs_ohm", "tag")),
        ("[machine]\nrs_ohm = { valu = 6 }\n", ("machine.rs_ohm", "value")),
        ('[timing]\nlatency = "late"\n', ("timing.latency", "predicted")),
        ('[controller]\nscheme = "ddt"\n', ("controller.scheme", "ddr-ml")),
        ("[controller]\npredict = 1\n", ("controller.predict", "timing.latency")),
        ("[controller]\nflux_ref_Wb = 1e9\n", ("controller.flux_ref_Wb", "0.001 .. 100 Wb")),
        ("[controller]\nkp_xy = 1\n", ("controller.kp_xy", "kp_xy_pu_A")),
        ("[profile]\nduration_s = 0\n", ("profile.duration_s", "allowed range")),
        ("[profile]\nspeed_rpm = [[1, 2], [1, 3]]\n", ("profile.speed_rpm", "ascend")),
        ("[profile]\nspeed_rpm = 'fast'\n", ("profile.speed_rpm", "pairs")),
        ("[profile]\nset = [[1, 'f_isr_Hz', 5000]]\n", ("f_isr_Hz", "while the drive runs")),
        ("[profile]\nsamples_per_period = 3\n", ("samples_per_period", "choose")),
        ("[profile]\nsamples_per_period = 4.0\n", ("samples_per_period", "choose")),
        ("[profile]\nsamples_per_period = true\n", ("samples_per_period", "choose")),
        ("[profile]\nbroken = [[1, 'u3', 'open']]\n", ("profile.broken = 'u3'", "u1, u2")),
        ("[profile]\nbroken = [[1, 'u1', 'lost']]\n", ("profile.broken = 'lost'", "blocked")),
        ("[profile]\nbroken = [[1, 'u1']]\n", ("profile.broken", "[time_s, phase, kind]")),
        ("[profile]\nbroken = [[1, 'u1', 'open']]\n", ("profile.broken", "1 s", "ends")),
        ("[inverter]\narc_V = 0.9\n", ("inverter.arc_V = 0.9", "1 .. 50000 V")),
        ("[inverter]\nbounce_ms = 101\n", ("inverter.bounce_ms = 101", "0 .. 100 ms")),
        (
            "[inverter]\nrestrike_V_per_ms = -1\n",
            ("inverter.restrike_V_per_ms = -1", "0 .. 100000 V/ms"),
        ),
        ("[profile]\nspeeds = 3\n", ("profile.speeds", "speed_rpm")),
        ("[inverter]\nvdc_V = 600\n", ("inverter.vdc_V", "vdc_full_V")),
        ("[inverter]\ne_off_mJ = 0.2\n", ("inverter.e_off_mJ", "e_ref_V and", "e_ref_A above 0")),
        ("x = [\n", ("TOML",)),
    ],
)
def test_refused_with_the_name_and_the_range(text, words):
    with pytest.raises(SetupError) as error:
        setups.parse(text if text.startswith("machine") else BASE + text, "test")
    for word in words:
        assert word in str(error.value)


MISTAKES = [
    "machine.drs_ohm = 'two'",
    "machine.drs_ohm = 4e+09",
    "machine.rs_ohm = -1",
    "profile.speed_rpm time = -1",
    "title = 3",
    "unknown key controller.schem; did you mean 'scheme'?",
    r"unknown key machine.'a\nb'; known",
]


def test_all_mistakes_of_a_file_are_reported_together(tmp_path, capsys):
    from hexatorque.cli.main import main

    file = tmp_path / "bad.toml"
    file.write_text(
        "title = 3\n" + BASE + '[machine]\nrs_ohm = -1\n"a\\nb" = 1\ndrs_ohm = [1, "two", 3, 4e9]\n'
        "[controller]\nschem = 'ddr'\n[profile]\nspeed_rpm = [[-1, 0], [2]]\n"
    )
    assert main(["setups", str(file)]) == 2
    lines = capsys.readouterr().err.splitlines()
    begin = f"hexatorque: {file}: "
    assert all(line.startswith(begin) for line in lines)
    assert sorted(line.removeprefix(begin).split(":")[0] for line in lines) == MISTAKES


def test_mistakes_over_several_values_are_reported_together():
    with pytest.raises(SetupError) as error:
        setups.load("paper-a").changed(
            inverter__vdc_V=9000.0, machine__drs_ohm=(-100.0, 0, 0, 0, 0, 0)
        )
    assert [line.split(":")[0] for line in str(error.value).splitlines()] == [
        "machine.drs_ohm",
        "inverter.vdc_V is above sensors.vdc_full_V",
    ]


def test_wrong_and_missing_values_are_reported_together():
    with pytest.raises(SetupError) as error:
        setups.parse("[machine]\nrs_ohm = 0\n", "test")
    lines = str(error.value).splitlines()
    assert lines[0].startswith("machine.rs_ohm = 0: allowed range")
    missing = [line.split(" is missing")[0] for line in lines[1:]]
    assert missing == [
        f"{section}.{key}"
        for section, keys in setups.KEYS.items()
        for key in keys
        if needed(section, key, "induction") and (section, key) != ("machine", "rs_ohm")
    ]


@pytest.mark.parametrize(
    "text", ["1e400", "9" * 400, "-9e999", "'1.2,3'", "true", "[1]", "{ x = 1 }"]
)
def test_no_number_ends_in_a_traceback(text):
    with pytest.raises(SetupError, match=r"^machine\.rs_ohm"):
        setups.parse(f"{BASE}[machine]\nrs_ohm = {text}\n", "test")


VALUES = st.recursive(
    st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just("ddr"),
    lambda inner: (
        st.lists(inner, max_size=7)
        | st.dictionaries(st.sampled_from(["value", "tag", "note", "x"]), inner, max_size=3)
    ),
    max_leaves=8,
)
PLACES = st.sampled_from(
    [
        *((section, key) for section, keys in setups.KEYS.items() for key in [*keys, "x"]),
        *(("controller", name) for name in firmware.parameters()),
        *(("profile", name) for name in Profile.__dataclass_fields__),
        *((section, None) for section in (*setups.KEYS, "controller", "profile", "title", "x")),
    ]
)


@settings(max_examples=100, deadline=None)
@given(PLACES, VALUES)
def test_whatever_stands_there_is_taken_or_refused_in_a_line(place, value):
    section, key = place
    data = {section: value if key is None else {key: value}}
    try:
        schema.check(data)
    except SetupError as error:
        for line in str(error).split("\n"):
            assert section in line and line.isprintable()


def test_spellings_of_a_choice():
    """A choice that looks like a boolean or a number may be written as one in TOML."""
    text = "[controller]\nzero_hold = false\ntorque_levels = 3\n"
    values = setups.parameters(setups.parse(BASE + text, "test"))
    assert (values["zero_hold"], values["torque_levels"]) == ("off", "3")
    for text in ("zero_hold = 1", "torque_levels = 4", "torque_levels = 3.0"):
        with pytest.raises(SetupError, match="choose one of"):
            setups.parse(f"{BASE}[controller]\n{text}\n", "test")


def test_importing_takes_no_library():
    """A command that needs no set-up does not wait for pydantic, numpy or the firmware."""
    code = (
        "import sys; import hexatorque.setups as s; s.builtin_names();"
        "assert not {'pydantic', 'numpy', 'hexatorque.firmware'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_missing_values_are_named():
    with pytest.raises(SetupError, match=r"machine\.pole_pairs is missing"):
        setups.parse("[inverter]\nvdc_V = 100\n", "test")


def test_unknown_set_up_and_file(tmp_path):
    with pytest.raises(SetupError, match="did you mean 'paper-b'"):
        setups.load("paper-bb")
    with pytest.raises(SetupError, match="No such file"):
        setups.load(tmp_path / "none.toml")
    (tmp_path / "r.toml").touch()
    (tmp_path / "motor.toml").touch()
    with pytest.raises(SetupError, match=r"No such file or directory$"):
        setups.load(tmp_path / "nothere.toml")
    with pytest.raises(SetupError, match=r"; did you mean '.*motor\.toml'\?"):
        setups.load(tmp_path / "moter.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SetupError, match="not a text file"):
        setups.load(tmp_path / "binary.toml")


@pytest.mark.parametrize("name", setups.builtin_names())
def test_every_built_in_value_is_tagged(name):
    setup = setups.load(name)
    for section, values in setup.values.items():
        for key, value in values.items():
            if (section, key) != ("controller", "scheme"):
                assert value.tag in setups.TAGS, f"{section}.{key}"


def test_controller_follows_the_machine_unless_told_otherwise():
    setup = setups.load("paper-b")
    assert setup.controller_values()["rs_ohm"] == 6.0
    mismatched = setup.changed(controller__rs_ohm=7.0)
    assert mismatched.controller_values()["rs_ohm"] == 7.0
    assert mismatched["machine.rs_ohm"] == 6.0
    assert setup.changed(machine__rs_ohm=5.0).controller_values()["rs_ohm"] == 5.0


def test_the_x_y_inductance_follows_the_stator_leakage_unless_it_is_given():
    for name in ("paper-a", "paper-b"):
        setup = setups.load(name)
        assert setup["machine.lxy_H"] == setup["machine.lls_H"]
    own = setups.parse(BASE + "[machine]\nlls_H = 5e-3\n", "test")
    assert own["machine.lxy_H"] == own.machine_values()["lxy_H"] == 5e-3
    assert setups.parameters(own)["lxy_H"] == pytest.approx(5e-3)
    assert setups.describe(own)["machine"]["lxy_H"]["tag"] == "derived"
    both = setups.parse(BASE + "[machine]\nlls_H = 5e-3\nlxy_H = 4e-3\n", "test")
    assert both["machine.lxy_H"] == 4e-3
    assert both.changed(machine__lls_H=6e-3)["machine.lxy_H"] == 4e-3


def test_an_x_y_inductance_that_nobody_measured_is_half_way_between_what_machines_have():
    """0.3 to 1 times the leakage. The x-y current of a law that predicts becomes unstable where the
    law takes L_xy for 3.5 times what it is: it takes away 40 % of the current in a period, and
    knows what the period before did with the wrong L_xy. With the leakage itself for L_xy, and 30 %
    wrong, it may be 4.3 times."""
    own = setups.parse(BASE + 'defaults = "derived"\n[machine]\nlls_H = 5e-3\n', "test")
    assert own["machine.lxy_H"] == pytest.approx(math.sqrt(0.3 * 1.0) * 5e-3, rel=0.01)
    assert setups.parameters(own)["lxy_H"] == pytest.approx(own["machine.lxy_H"])
    text = new.from_circuit(
        "pole_pairs=2,rs_ohm=1.1,rr_ohm=0.9,lls_H=7e-3,llr_H=7e-3,lm_H=0.21,current_A=5.9,vdc_V=600",
        "test",
    )
    believed_H = setups.parse(text, "test")["machine.lxy_H"]

    def left(true_H: float) -> float:
        """Largest eigenvalue of current and voltage, one period to the next."""
        told = np.array([[1, 1], [-0.4 * believed_H / true_H, -0.4]])
        return abs(np.linalg.eigvals(told)).max()

    assert left(0.3 * 7e-3 / 1.3) < 1 < left(believed_H / 3.6)


def test_drops_that_would_stop_time_are_refused():
    from hexatorque.drive.simulated import SimulatedDrive

    setup = setups.load("paper-b").changed(inverter__v_switch_V=10.0)
    SimulatedDrive(setup)
    with pytest.raises(SetupError, match=r"inverter\.v_switch_V.*0\.1 us"):
        SimulatedDrive(setup.changed(machine__lls_H=1e-6))


def test_a_machine_too_fast_for_the_integration_gives_no_numbers():
    from hexatorque.drive.simulated import SimulatedDrive

    fast = setups.load("paper-b").changed(machine__lxy_H=1e-6, machine__rs_ohm=1000.0)
    sim = SimulatedDrive(fast)
    sim.start()
    with pytest.raises(ArithmeticError, match="diverged"):
        sim.run(0.4)


@pytest.mark.parametrize(
    "changes",
    [
        {"torque_inner_Nm": 0.6},
        {"torque_band_Nm": 0.1},
        {"flux_min_Wb": 0.7},
        {"vdc_min_V": 450.0, "vdc_max_V": 440.0},
        {"flux_trip_Wb": 0.3},
        {"i_trip_A": 40.0},
        {"i_ab_trip_A": 2000.0},
        {"vdc_max_V": 499.0},
        {"f_slow_Hz": 300.0},
        {"f_isr_Hz": 1000.0, "f_slow_Hz": 100.0},
        {"torque_release_Nm": -9.0},
        {"rr_ohm": 1000.0, "lr_H": 0.01},
        {"lost_legs": 32, "i_rated_A": 5.0},
        {"ride_through": "most-torque"},
        {"f_isr_Hz": 50_000.0, "min_pulse_us": 8.0},
    ],
    ids=lambda changes: ", ".join(changes),
)
def test_what_does_not_fit_together_is_refused_with_the_firmwares_own_reason(changes):
    setup = setups.load("paper-a")
    values = {**setups.parameters(setup), **changes}
    with pytest.raises(firmware.FirmwareError) as refused:
        firmware.Controller(setup["timing.device"], values)
    with pytest.raises(SetupError) as caught:
        setup.changed({f"controller.{name}": value for name, value in changes.items()})
    reason = str(refused.value).split("do not fit together: ")[1]
    assert str(caught.value).startswith(f"controller.{reason}") and "\n" not in str(caught.value)


def test_the_line_says_where_each_value_is_from(tmp_path):
    """The set-up gives one of them; the other one has the firmware's default, or follows a rule."""
    for text, source in (
        ("defaults = 'firmware'\n[controller]\ntorque_band_Nm = 0.1", "the firmware's default"),
        (
            "[controller]\nvdc_min_V = 580\n[sensors]\nvdc_full_V = 610",
            "derived: 1.4 Vdc, but at most 94 % of the sensor's",
        ),
    ):
        file = tmp_path / "mine.toml"
        file.write_text(f'setup = "small-2kw"\n{text}\n')
        with pytest.raises(SetupError) as caught:
            setups.load(file)
        line = str(caught.value)
        assert line.startswith(f"{file}: controller.") and line.count("\n") == 0
        assert f" is {source}" in line


def test_a_set_up_can_be_mended_in_one_step():
    narrow = {"controller.torque_band_Nm": 0.1, "controller.torque_inner_Nm": 0.05}
    assert setups.load("paper-b").changed(narrow)["controller.torque_band_Nm"] == 0.1


def test_step_follows_the_machine():
    """A machine whose windings are faster than the usual step gets a shorter step."""
    usual = SimulatedDrive(setups.load("paper-b"))
    fast = SimulatedDrive(setups.load("paper-b").changed(machine__lxy_H=0.3e-3))
    assert usual._timing.max_step == round(100e-6 * usual._timing.clock_Hz)
    longest_s = fast._timing.max_step / fast._timing.clock_Hz
    assert longest_s == pytest.approx(0.1 * 0.3e-3 / 6.0, rel=0.1)


@pytest.mark.parametrize("us", (0.0, 1.9, 45.0, math.nan))
def test_a_pulse_that_no_board_allows_is_named_with_the_boards_range(us):
    said = rf"controller\.min_pulse_us = {us:g}: allowed range is 2 \.\. 20 us"
    with pytest.raises(setups.SetupError, match=said):
        setups.load("paper-a").changed(controller__min_pulse_us=us)


@pytest.mark.parametrize("us", (0.0, 0.1, 7.0))
def test_dead_time_that_the_board_does_not_allow_is_named(us):
    said = rf"inverter\.dead_time_us = {us:g}: allowed range is 1 \.\. 6\.82 us"
    with pytest.raises(setups.SetupError, match=said):
        setups.load("paper-a").changed(inverter__dead_time_us=us)


@pytest.mark.parametrize("name", ("paper-a", "paper-a-feasible", "paper-b", "paper-b-fitted"))
def test_dead_times_of_the_papers_are_whole_counts(name):
    """2.3 us at 150 MHz (paper A) and 2.0 us at 100 MHz: rounding up adds nothing."""
    sim = SimulatedDrive(setups.load(name))
    m, words = sim.controller.map, sim.controller.register_words()
    counts = {(2.3, 150e6): 345, (2.0, 100e6): 200}[
        sim.setup["inverter.dead_time_us"], m.pwm_clock_Hz
    ]
    assert words[m.epwm + m.dbred] == words[m.epwm + m.dbfed] == counts
