"""Channels of a table renamed and scaled (`--map`), and its times shifted (`--shift`)."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexatorque.cli.main import main
from hexatorque.recording import mapping
from hexatorque.recording.recording import Recording, RecordingError


def scope(**units):
    units = units or {"CH1": "V", "CH2": "V"}
    channels = {name: np.array([1.0, -2.0, np.nan]) * (n + 1) for n, name in enumerate(units)}
    return Recording(1000.0, channels, units, {"trigger_s": 0.25}, 0.5)


def mapped(rec, *maps, shift_s=None):
    (new,) = mapping.mapped(["scope.csv"], [rec], maps, shift_s)
    return new


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("CH1=i_u1_A", [1, -2]),
        ("CH1=i_u1_A*100", [100, -200]),
        ("CH1=i_u1_A*-100", [-100, 200]),
        ("CH1=i_u1_A/0.01", [100, -200]),
        ("CH1=i_u1_A*2,5", [2.5, -5]),
        ("CH1=i_u1_A+1e-1", [1.1, -1.9]),
        ("CH1=i_u1_A-0,5", [0.5, -2.5]),
        ("CH1 = i_u1_A * 10 + 3", [13, -17]),
        ("CH1=i_u1_A+3*10", [40, 10]),
    ],
)
def test_a_scale_and_an_offset_from_left_to_right(text, wanted):
    rec = mapped(scope(), text)
    np.testing.assert_allclose(rec["i_u1_A"], [*wanted, np.nan])
    assert rec.units == {"CH2": "V", "i_u1_A": "A"} and "CH1" not in rec


@given(st.floats(-1e3, 1e3).filter(lambda k: abs(k) > 1e-3), st.floats(-1e3, 1e3))
def test_any_scale_and_offset(k, offset):
    rec = mapped(
        scope(), f"CH2=vdc_V*{k!r}+{offset!r}" if offset >= 0 else f"CH2=vdc_V*{k!r}{offset!r}"
    )
    np.testing.assert_allclose(
        rec["vdc_V"][:2], np.array([2, -4]) * k + offset, rtol=1e-12, atol=1e-9
    )


def test_an_own_name_has_the_unit_of_its_source_until_it_is_scaled():
    rec = mapped(scope(), "CH1=probe", "CH2=heat_sink*50")
    assert rec.units == {"probe": "V", "heat_sink": ""}


def test_a_name_that_is_a_number_or_has_a_blank():
    rec = mapped(scope(**{"1": "V", "Channel A": ""}), "1=i_u1_A", "Channel A=i_w1_A/2")
    assert list(rec.channels) == ["i_u1_A", "i_w1_A"]


def test_the_shift_moves_samples_and_trigger():
    rec = mapped(scope(), shift_s=-0.125)
    assert (rec.start_s, rec.trigger_s) == (0.375, 0.125)
    own = Recording(1000.0, {"i_u1_A": np.ones(3)}, {"i_u1_A": "A"}, {}, 0.0)
    files = mapping.mapped(["a", "b"], [scope(), own], ["CH1=i_u1_A"], 2.0)
    assert [rec.start_s for rec in files] == [2.5, 0.0]  # only the file that has CH1


@pytest.mark.parametrize(
    ("units", "maps", "said"),
    [
        ({}, ["CH3=i_u1_A"], "no channel 'CH3'; did you mean 'CH"),
        ({}, ["foo=i_u1_A"], "no channel 'foo'; known: CH1, CH2"),
        ({}, ["CH1"], "write OLD=NEW"),
        ({}, ["CH1="], "write OLD=NEW"),
        ({}, ["=i_u1_A"], "write OLD=NEW"),
        ({}, ["CH1=i_u1_A*"], "write OLD=NEW"),
        ({}, ["CH1=i_u1_A*1.234,5"], "write OLD=NEW"),
        ({}, ["CH1=i_u1_A*nan"], "write OLD=NEW"),
        ({}, ["CH1=i_u1_A**2"], "write OLD=NEW"),
        ({}, ["CH1=i_u1_A*0"], "none of 0 as a factor"),
        ({}, ["CH1=i_u1_A/0,0"], "none of 0 as a factor"),
        ({}, ["CH1=i_u1_A*1e999"], "a finite number is needed"),
        ({}, ["CH2=i_u1_A*1e308"], "i_u1_A becomes larger than"),
        ({}, ["CH1=i_u1_a"], "no channel 'i_u1_a'; did you mean 'i_u1_A'"),
        ({}, ["CH1=i_u3_A"], "no channel 'i_u3_A'; did you mean 'i_u"),
        ({}, ["CH1=time_s"], "name of the time base"),
        ({}, ["CH1=i_u1_A", "CH2=i_u1_A"], "there is a channel i_u1_A already"),
        ({}, ["CH1=i_u1_A", "CH1=i_u1_A*2"], "given twice"),
        ({"CH1": "s"}, ["CH1=i_u1_A*100"], "CH1 is in s, a time; i_u1_A is in A: allowed are A, V"),
        ({"CH1": "ms"}, ["CH1=speed_rpm"], "speed_rpm is in r/min: allowed are r/min, V or no"),
        ({"CH1": "W"}, ["CH1=torque_Nm"], "CH1 is in W; torque_Nm is in N m"),
        ({"CH1": "rad/s"}, ["CH1=speed_rpm"], "and rad/s with a factor"),
        ({"CH1": "A"}, ["CH1=state"], "state needs V or no unit"),
        ({"CH1": "A"}, ["CH1=vdc_V"], "vdc_V is in V: allowed are V or no unit"),
    ],
)  # fmt: skip
def test_refusals_are_one_line_that_names_the_option(units, maps, said):
    with pytest.raises(RecordingError, match=said.replace("(", r"\(")) as caught:
        mapped(scope(**units), *maps)
    assert "\n" not in str(caught.value)
    assert said.startswith("name of") or f"--map {maps[-1]}" in str(caught.value)


@pytest.mark.parametrize("unit", ["", "V", "A"])
def test_units_that_fit(unit):
    assert mapped(scope(CH1=unit), "CH1=i_u1_A").units == {"i_u1_A": "A"}
    speed = mapped(scope(CH1="Hz"), "CH1=speed_rpm*30")
    assert speed.units == {"speed_rpm": "r/min"} and speed["speed_rpm"][1] == -60
    assert mapped(scope(CH1="rpm"), "CH1=speed_rpm").units == {"speed_rpm": "r/min"}


@pytest.mark.parametrize("text", ["soon", "nan", "1e7", "inf", "1.234,5", ""])
def test_a_shift_is_a_number_of_seconds(text):
    with pytest.raises(RecordingError, match="seconds are needed, allowed range is -1e\\+06"):
        mapping.shift(text)


def test_convert_and_plot(tmp_path, capsys, monkeypatch):
    """A probe of 10 mV/A, read in mV."""
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{k},{10 * k},{-5 * k}\n" for k in range(20))
    (tmp_path / "scope.csv").write_text(f"Time,A,B\n(ms),(mV),(mV)\n\n{rows}")
    maps = ["--map", "A=i_u1_A*100", "--map", "B=i_w1_A*100"]
    assert main(["convert", "scope.csv", "scope.npz", *maps, "--shift", "-0,5"]) == 0
    capsys.readouterr()
    rec = Recording.load("scope.npz")
    assert rec.start_s == -0.5 and rec.units == {"i_u1_A": "A", "i_w1_A": "A"}
    np.testing.assert_allclose(rec["i_u1_A"], np.arange(20))
    assert main(["plot", "scope.npz", "scope.csv", *maps, "--shift", "-0.5", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["channels"]["i_u1_A"]["rms_difference"] == [None, 0]
    for command in (["convert", "scope.csv", "b.npz"], ["plot", "scope.csv"]):
        assert main([*command, "--map", "D=i_u1_A"]) == 2
        (said,) = capsys.readouterr().err.strip().splitlines()
        assert "--map D=i_u1_A: scope.csv: no channel 'D'; known: A, B" in said
    assert not (tmp_path / "b.npz").exists()
