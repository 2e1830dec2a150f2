"""Files with a channel each become one recording, with the command of docs/recordings.md."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.cli.main import main
from hexatorque.recording.recording import Recording
from hexatorque.twin import bench, wiring

DOCS = Path(__file__).parents[3] / "docs" / "recordings.md"
PHASES = ("u1", "w1", "u2", "w2")
STEP_S = 1e-4
TIME_S = -0.1 + STEP_S * np.arange(4000)
CURRENTS_A = {p: 5 * np.cos(2 * np.pi * 20 * TIME_S - wiring.axes_rad(30.0)[p]) for p in PHASES}


def write(path, time_s, volts):
    rows = "".join(f"{t:.9e},{v:.6e}\n" for t, v in zip(time_s, volts))
    path.write_text(f"LECROYWS424,17291,Waveform\nTime,Ampl\n{rows}")


@pytest.fixture
def command(tmp_path, monkeypatch):
    """The words of the command, in a folder with LeCroy's files of four probes of 10 mV/A."""
    monkeypatch.chdir(tmp_path)
    for n, current in enumerate(CURRENTS_A.values(), 1):
        write(Path(f"C{n}.csv"), TIME_S, 0.01 * current)
    (text,) = re.findall(r"^hexatorque (convert C1\.csv.*?)\n```", DOCS.read_text(), re.M | re.S)
    return shlex.split(text.replace("\\\n", " "))


def refused(words, capsys):
    capsys.readouterr()
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_four_files_of_a_channel_each_are_a_bench(command):
    assert main(command) == 0
    rec = Recording.load("bench.npz")
    assert (rec.rate_Hz, rec.start_s) == (1e4, -0.1)
    assert rec.units == {f"i_{p}_A": "A" for p in PHASES}
    for phase, current in CURRENTS_A.items():
        np.testing.assert_allclose(rec[f"i_{phase}_A"], current, atol=1e-5)
    found = bench.read(rec, "bench.npz", setups.load("paper-a-feasible"), speed_rpm=600)
    assert found.outside


def test_a_channel_is_called_after_its_file(command, capsys):
    assert main(["convert", "C1.csv", "C2.csv", "both.csv"]) == 0
    assert list(Recording.load("both.csv").channels) == ["C1.Ampl", "C2.Ampl"]
    said = refused(["convert", "C1.csv", "C2.csv", "b.npz", "--map", "C9.Ampl=i_u1_A"], capsys)
    assert "C1.csv and C2.csv: no channel 'C9.Ampl'; did you mean 'C" in said


@pytest.mark.parametrize(
    ("time_s", "said"),
    [
        (TIME_S[:-1], "length 3999 samples, that of C1.csv is 4000 samples"),
        (TIME_S + 0.5 * STEP_S, "start -0.09995 s, that of C1.csv is -0.1 s"),
        (-0.1 + 2 * (TIME_S + 0.1), "rate 5000 Hz, that of C1.csv is 10000 Hz"),
    ],
)
def test_files_of_other_times_are_refused(time_s, said, command, capsys):
    write(Path("C3.csv"), time_s, np.ones(len(time_s)))
    line = refused(command, capsys)
    assert line.startswith(f"hexatorque: C3.csv: {said}") and not Path("bench.npz").exists()


def test_a_start_within_the_accuracy_of_printed_times_is_the_same(command):
    write(Path("C3.csv"), TIME_S + 0.2 * STEP_S, np.ones(len(TIME_S)))
    assert main(command) == 0


def test_a_forgotten_name_replaces_no_channels_file(command, capsys):
    before = Path("C3.csv").read_bytes()
    assert "C3.csv is there already" in refused(["convert", "C1.csv", "C2.csv", "C3.csv"], capsys)
    assert Path("C3.csv").read_bytes() == before


def test_files_of_one_name_are_refused(command, capsys):
    Path("other").mkdir()
    write(Path("other/C1.csv"), TIME_S, np.ones(len(TIME_S)))
    said = refused(["convert", "C1.csv", "other/C1.csv", "both.npz"], capsys)
    assert "other/C1.csv: there is a channel C1.Ampl already" in said


def test_metadata_that_all_have_alike_are_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, more in (("a", {"gaps": 1}), ("b", {"gaps": 2, "ended": "user"})):
        meta = {"trigger_s": 0.5, **more}
        Recording(1e3, {"v": np.ones(9, np.float32)}, {"v": "V"}, meta).save(f"{name}.npz")
    assert main(["convert", "a.npz", "b.npz", "c.npz"]) == 0
    rec = Recording.load("c.npz")
    assert rec.meta == {"trigger_s": 0.5} and rec.units == {"a.v": "V", "b.v": "V"}
    assert rec["a.v"].dtype == np.float32
