"""The code around reproduced figures: verdicts, stored results, and the page for the user."""

import json
import math
import re
import threading
from html.parser import HTMLParser

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.cli.main import main
from hexatorque.drive.simulated import DriveFault
from hexatorque.evidence import kept
from hexatorque.evidence.papers import ENTRIES, Entry
from hexatorque.evidence.papers.engine import page, reproduce
from hexatorque.evidence.papers.engine.figure import Figure, beside, claim, not_printed
from hexatorque.evidence.papers.engine.job import Job
from hexatorque.experiments import operating_points
from hexatorque.experiments.operating_points import NotReached, Point
from hexatorque.recording.recording import Recording

ASKED = {
    *(f"A{n}" for n in (1, 2, 3, 5, *range(7, 16))),
    *(f"B{n}" for n in (2, 6, 7, *range(10, 20))),
    *("A-T2", "A-T3", "A-T4", "B-T1", "B-T2", "B-T3", "B-T4", "B-T6"),
}


def test_every_figure_and_table_has_an_entry():
    assert set(ENTRIES) >= ASKED


@pytest.mark.parametrize(
    ("ours", "lower", "word"),
    [
        (10.4, None, "match"),
        (9.6, True, "match"),
        (9.0, True, "better"),
        (9.0, False, "worse"),
        (11.0, True, "worse"),
        (11.0, False, "better"),
        (11.0, None, "differs"),
        (math.nan, True, "differs"),
        (None, None, "differs"),
    ],
)
def test_a_number_is_judged_by_its_distance_from_the_printed_one(ours, lower, word):
    verdict = beside("what", ours, 10.0, within=0.05, lower_is_better=lower)
    assert verdict.verdict == word
    assert bool(verdict.why) == (word != "match")  # every disagreement carries a reason
    json.dumps(verdict.ours, allow_nan=False)


def test_only_required_disagreements_break():
    assert beside("a", 20, 10, lower_is_better=True, required=True).broken
    assert claim("a", False, "x", "y", required=True).broken
    assert not claim("a", False, "x", "y").broken
    assert not claim("a", True, "x", "y", required=True).broken
    assert not beside("a", 5, 10, lower_is_better=True, required=True).broken
    assert not not_printed("a", 1.0).broken


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        ("as printed", "as printed"),
        (True, "yes"),
        (0.0, "0"),
        (90.8965, "90.90"),
        (0.001234, "0.001234"),
        (12345.6, "12346"),
        (1e9, "1e+09"),
        (-2.5, "-2.500"),
    ],
)
def test_numbers_have_four_significant_digits(value, text):
    assert page.number(value) == text


@pytest.fixture
def entry(monkeypatch):
    """An invented figure "A1" whose function can be replaced."""
    calls = []

    class Module:
        @staticmethod
        def make(job):
            calls.append(job.quick)
            return Figure(
                {"n": 1},
                [claim("holds", True, "yes", "yes"), claim("<not>", False, 1.0, 2.0)],
                lambda path: path.write_bytes(b"PNG"),
                {
                    "": Recording(10.0, {"i_A": np.arange(3.0)}),
                    "b": Recording(1.0, {"x": np.ones(2)}),
                },
                [setups.load("paper-b").changed(controller__scheme="dtc2")],
                caption="What to see.",
            )

    Module.calls = calls
    monkeypatch.setattr(reproduce, "ENTRIES", {"A1": Entry("Title & more", "fake", "make")})
    monkeypatch.setattr(reproduce, "import_module", lambda name, package: Module)
    return Module


def test_a_figure_is_written_with_all_its_data(entry, tmp_path):
    outcome = reproduce.reproduce(["A1"], tmp_path)
    data = json.loads((tmp_path / "A1.json").read_text())
    assert outcome.figures == {"A1": data}
    assert {"id", "title", "setup", "metrics", "paper", "verdicts"} <= set(data)
    assert {"what", "ours", "paper", "verdict", "why"} <= set(data["verdicts"][0])
    assert data["recordings"] == ["A1.npz", "A1-b.npz"]
    assert Recording.load(tmp_path / "A1-b.npz")["x"].tolist() == [1, 1]
    setup = data["setup"][0]
    assert setup["set"] == {"controller.scheme": "dtc2"}
    assert setup["assumed"]["controller.flux_ref_Wb"] == 0.4  # paper B prints none
    assert "machine.rs_ohm" not in setup["assumed"]  # paper B prints this one
    assert "flux_ref_Wb" in data["caption"] and "rs_ohm" not in data["caption"]


def test_the_page_shows_all_and_escapes(entry, tmp_path):
    reproduce.reproduce(["A1"], tmp_path)
    text = (tmp_path / "index.html").read_text()
    assert "Title &amp; more" in text and "&lt;not&gt;" in text and "<not>" not in text
    for target in re.findall(r'(?:src|href)="([^#"]+)"', text):
        # All files are beside the page, so it needs no server and no network.
        assert (tmp_path / target).exists(), target
    words = re.findall(r'data-v="([^"]+)"', text)
    assert sorted(set(words)) == ["differs", "match"] and len(words) == 4  # top and figure
    assert 'data-f="not printed"' in text


def test_a_setup_that_looks_like_html_is_shown_as_text(entry, tmp_path):
    data = reproduce.reproduce(["A1"], tmp_path).figures["A1"]
    name, key, why = "<b>x", '"><i>', "<script>alert(1)</script>"
    data["setup"] = [{"name": name, "set": {key: 1.0}, "assumed": {key: 2.0}}]
    text = page.write_page(tmp_path / "p.html", {"A1": data}, {"A2": why}).read_text()
    seen: list[str] = []
    parser = HTMLParser()
    parser.handle_data = seen.append
    parser.feed(text)
    shown = "".join(seen)
    assert shown.count(name) == 3  # summary, assumed values, runs
    assert shown.count(f"{key} = ") == 2 and why in shown
    assert text.count("<script>") == 1 and "<i>" not in text  # the page's own script


def test_a_complete_figure_is_kept_until_something_changes(entry, tmp_path, monkeypatch):
    run = lambda quick=False: reproduce.reproduce(["A1"], tmp_path, quick)  # noqa: E731
    run()
    run()
    assert entry.calls == [False]
    run(quick=True)
    assert entry.calls == [False, True]
    (tmp_path / "A1-b.npz").unlink()
    run(quick=True)
    assert len(entry.calls) == 3
    (tmp_path / "A1.json").write_text("{")
    run(quick=True)
    assert len(entry.calls) == 4
    monkeypatch.setattr(reproduce, "build", lambda: "other")
    run(quick=True)
    assert len(entry.calls) == 5


@pytest.mark.parametrize("error", [DriveFault(["over-current"], 1.0), NotReached("12 r/min")])
def test_a_drive_that_fails_is_reported(entry, tmp_path, monkeypatch, error):
    def fail(job):
        raise error

    monkeypatch.setattr(entry, "make", fail)
    outcome = reproduce.reproduce(["A1"], tmp_path)
    assert outcome.failed == {"A1": str(error)} and not outcome.figures
    assert str(error) in (tmp_path / "index.html").read_text()


def test_a_programming_error_is_not_hidden(entry, tmp_path, monkeypatch):
    def fail(job):
        raise ValueError("bug")

    monkeypatch.setattr(entry, "make", fail)
    with pytest.raises(ValueError, match="bug"):
        reproduce.reproduce(["A1"], tmp_path)


def test_figures_made_in_processes_are_the_same(tmp_path):
    """Three figures without a drive, in two processes and in this one."""
    names = ["A1", "A2", "B-T1"]
    begun = []
    for folder in ("a", "b"):
        reproduce.make_folder(tmp_path / folder)
    outcome = reproduce.reproduce(names, tmp_path / "b", True, begun.append, jobs=2)
    assert outcome.figures == reproduce.reproduce(names, tmp_path / "a", True).figures
    assert list(outcome.figures) == sorted(begun) == names and not outcome.failed
    assert all((tmp_path / "b" / f"{name}.png").exists() for name in names)


def test_figures_are_chosen_in_the_papers_order():
    assert reproduce.chosen(["b-t6", "a5", "A5"]) == ["A5", "B-T6"]
    assert reproduce.chosen(["A5", "all"]) == list(ENTRIES)
    with pytest.raises(setups.SetupError, match=r"'A99'.*A15"):
        reproduce.chosen(["A99"])


def test_sweep_points_are_kept(tmp_path, monkeypatch):
    measured = []

    def measure(point, progress):
        measured.append(point.speed_rpm)
        if point.speed_rpm > 2:
            raise NotReached("no")
        return type("Run", (), {"metrics": {"speed_rpm": point.speed_rpm}})

    monkeypatch.setattr(operating_points, "measure", measure)
    setup = setups.load("paper-b")
    points = [Point(setup, speed, 1.0) for speed in (1.0, 2.0, 3.0)]
    want = [{"speed_rpm": 1.0}, {"speed_rpm": 2.0}, None]
    assert Job(False, tmp_path).metrics(points) == want
    assert Job(True, tmp_path).metrics(points) == want
    assert sorted(measured) == [1, 2, 3]
    # Another set-up, load or build makes another point. A point with an incomplete file is measured
    # again.
    Job(False, tmp_path).metrics([Point(setup, 1.0, 2.0)])
    Job(False, tmp_path).metrics([Point(setup.changed(controller__scheme="fdr"), 1.0, 1.0)])
    for path in tmp_path.iterdir():
        path.write_text('{"speed')
    assert Job(False, tmp_path).metrics(points) == want
    monkeypatch.setattr(kept, "digest", lambda: "other")
    assert Job(False, tmp_path).metrics(points[:1]) == want[:1]
    assert len(measured) == 9


def test_an_interrupt_ends_a_sweep_and_keeps_its_points(tmp_path, monkeypatch):
    begun = threading.Semaphore(0)

    def measure(point, progress):
        begun.release()
        if point.speed_rpm == 3:
            raise KeyboardInterrupt
        return type("Run", (), {"metrics": {"n": 1}})

    monkeypatch.setattr(operating_points, "measure", measure)
    setup = setups.load("paper-b")
    points = [Point(setup, float(speed), 1.0) for speed in range(200)]
    with pytest.raises(KeyboardInterrupt):
        Job(False, tmp_path).metrics(points)
    kept = len(list(tmp_path.glob("*.json")))
    assert 2 <= kept < 150 and not list(tmp_path.glob("*.part"))


def test_the_command_reports_failures_by_its_exit_code(entry, tmp_path, monkeypatch, capsys):
    assert main(["evidence", "papers", "a1", "--quick", "--json", "-o", str(tmp_path)]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["figures"]["A1"]["quick"] is True and shown["failed"] == {}

    def fail(job):
        return Figure({}, [claim("x", False, 1, 2, required=True)], lambda p: p.write_text(""), {})

    monkeypatch.setattr(entry, "make", fail)
    (tmp_path / "A1.json").unlink()
    assert main(["evidence", "papers", "A1", "-o", str(tmp_path)]) == 1
    assert "must hold" in capsys.readouterr().out
    assert main(["evidence", "papers", "A1", "-o", str(tmp_path / "A1.png" / "x")]) == 2
    assert main(["evidence", "papers", "A99", "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 2
