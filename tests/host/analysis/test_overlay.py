"""Recordings over each other: they are aligned by an event, and compared where both have
samples."""

import numpy as np
import pytest
from matplotlib.image import imread

from hexatorque import firmware
from hexatorque.analysis import overlay
from hexatorque.analysis.overlay import Trace
from hexatorque.recording.recording import Recording, RecordingError


def signal(t_s: np.ndarray) -> np.ndarray:
    """A smooth signal. Straight lines between samples 0.5 ms apart are within 0.1 % of it."""
    return np.sin(2 * np.pi * 20 * t_s) * np.exp(-5 * t_s)


def recorded(rate_Hz: float, start_s: float, event_s: float, n: int, **meta) -> Recording:
    """A recording of `signal`, which begins at event_s on the recording's own time."""
    rec = Recording(rate_Hz, {"torque_Nm": np.zeros(n)}, {"torque_Nm": "N m"}, meta, start_s)
    rec.channels["torque_Nm"] = signal(rec.time_s - event_s)
    return rec


def pair() -> list[Trace]:
    """Two recordings of the same event with different times, rates and begins."""
    return [
        Trace("sil", recorded(40e3, 0.0, 0.4, 40_000, trigger_s=0.4)),
        Trace("bench", recorded(2.5e3, 100.0, 100.3001, 1_500, trigger_s=100.3001)),
    ]


def test_alignment_by_the_trigger_puts_the_same_event_at_the_same_time():
    traces = pair()
    assert overlay.align(traces, None) == "trigger"
    assert [trace.shift_s for trace in traces] == [0.4, 100.3001]
    rms, samples = overlay.difference(*traces, "torque_Nm")
    assert rms < 1e-3
    # The bench's 0.6 s are from -0.3001 to 0.2999 s, within the other's -0.4 .. 0.6 s.
    assert samples == 1500
    traces[1].shift_s += 5e-3
    assert overlay.difference(*traces, "torque_Nm")[0] > 0.1


def test_other_alignments():
    traces = pair()
    assert overlay.align(traces, "start") == "start"
    assert [trace.begin_s for trace in traces] == [0, 0]
    overlay.align(traces, "none")
    assert [trace.begin_s for trace in traces] == [0, 100]
    assert overlay.difference(*traces, "torque_Nm") == (None, 0)
    del traces[1].rec.meta["trigger_s"]
    assert overlay.align(traces, None) == "start"
    assert overlay.align(traces[1:], None) == "none"
    with pytest.raises(RecordingError, match="bench: no trigger"):
        overlay.align(traces, "trigger")


@pytest.mark.parametrize("value", [None, "soon", float("nan"), [1]])
def test_a_trigger_without_a_time_does_not_count(value):
    assert Recording(1.0, {}, meta={"trigger_s": value}).trigger_s is None


def test_the_rms_difference_is_computed_from_the_values():
    """The recordings differ by a constant offset, and both have lost samples."""
    a = Trace("a", recorded(10e3, 0, 0, 1000))
    b = Trace("b", recorded(10e3, 0, 0, 1000))
    b.rec.channels["torque_Nm"] = a.rec["torque_Nm"] + 0.25
    a.rec.channels["torque_Nm"][100:110] = np.nan
    b.rec.channels["torque_Nm"][500:503] = np.nan
    rms, samples = overlay.difference(a, b, "torque_Nm")
    assert rms == pytest.approx(0.25)
    assert samples == 1000 - 13


def test_a_window_uses_the_aligned_time():
    traces = pair()
    overlay.align(traces, "trigger")
    for trace in overlay.cut(traces, (-0.1, 0.2)):
        assert trace.time_s[0] == pytest.approx(-0.1, abs=1 / trace.rec.rate_Hz)
        assert trace.time_s[-1] == pytest.approx(0.2, abs=1.01 / trace.rec.rate_Hz)
    with pytest.raises(RecordingError, match=r"bench: no samples in the window.*-0\.3001 to"):
        overlay.cut(traces, (0.4, 0.5))


def channels(*names: str) -> Trace:
    return Trace("x", Recording(1e3, {name: np.ones(4) for name in names}))


def test_channels_by_default_are_the_main_ones_that_all_have():
    bench = channels("i_u1_A", "speed_rpm", "psi_alpha_Wb", "psi_beta_Wb", "i_w1_A")
    sil = channels("plant.torque_Nm", "plant.i_u1_A", *bench.rec.channels, "torque_Nm")
    assert overlay.chosen([sil, bench], None) == ["i_u1_A", "speed_rpm", "flux_Wb"]
    true = channels("plant.torque_Nm", "plant.psi_alpha_Wb", "plant.psi_beta_Wb")
    assert overlay.chosen([sil, true], None) == ["plant.torque_Nm"]
    assert overlay.chosen([true], None) == ["plant.torque_Nm", "plant.flux_Wb"]
    other = channels("i_w1_A", "x")
    assert overlay.chosen([sil, other], None) == ["i_w1_A"]
    with pytest.raises(RecordingError, match="no channel in common"):
        overlay.chosen([true, other], None)
    assert overlay.chosen([sil, bench], ["i_w1_A", "flux_Wb", "i_w1_A"]) == ["i_w1_A", "flux_Wb"]
    with pytest.raises(RecordingError, match=r"x: no channel 'torque_Nm'; there are i_u1_A"):
        overlay.chosen([sil, bench], ["torque_Nm"])
    with pytest.raises(RecordingError, match="at most 40"):
        overlay.chosen([channels(*(f"c{n}" for n in range(41)))], [f"c{n}" for n in range(41)])


def test_flux_is_the_length_of_the_vector():
    rec = Recording(1.0, {"psi_alpha_Wb": np.array([0.3, 0]), "psi_beta_Wb": np.array([0.4, -1])})
    assert overlay.values(rec, "flux_Wb").tolist() == [0.5, 1.0]
    assert overlay.values(rec, "plant.flux_Wb") is None


def test_labels_distinguish_the_files(tmp_path):
    for folder in ("a", "b"):
        for name in ("rec.npz", f"{folder}.npz"):
            recorded(1e3, 0, 0, 10).save(tmp_path / folder / name)
    given = [str(tmp_path / f) for f in ("a/rec.npz", "b/rec.npz", "b/b.npz@1.5")]
    traces = overlay.read(given)
    assert [trace.label for trace in traces] == ["a/rec.npz", "b/rec.npz", "b.npz"]
    assert [trace.rec.trigger_s for trace in traces] == [None, None, 1.5]
    for bad in ("b/b.npz@soon", "b/b.npz@nan", "b/b.npz@"):
        with pytest.raises(RecordingError, match="after @"):
            overlay.read([str(tmp_path / bad)])
    (tmp_path / "a" / "rec.npz").rename(tmp_path / "at@1.npz")  # a name with an @ in it
    assert overlay.read([str(tmp_path / "at@1.npz")])[0].rec.trigger_s is None


def colour_share(picture: np.ndarray, colour: str) -> float:
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return float(np.mean(np.abs(picture[..., :3] - rgb).max(axis=-1) < 0.02))


def test_the_picture_shows_every_recording_and_its_gaps(tmp_path):
    traces = [*pair(), Trace("third", recorded(1e3, 0, 0.2, 1000, trigger_s=0.25))]
    traces[1].rec.channels["torque_Nm"][400:700] = np.nan
    traces[1].rec.meta |= {"lost_samples": 300, "gaps": 1, "closed": False}
    overlay.align(traces, "trigger")
    file = overlay.plot(traces, ["torque_Nm"], "trigger", tmp_path / "new" / "x.png")
    picture = imread(file)
    assert picture.shape[1] == 1500
    for colour in overlay.COLOURS[1:3]:
        assert colour_share(picture, colour) > 5e-4
    # 0.12 s of the 1 s that is shown are shaded in the second recording's colour, about a tenth.
    shade = "#f8dfcc"
    assert 0.05 < colour_share(picture, shade) < 0.12
    assert "300 samples lost" in traces[1].legend()
    assert "not closed" in traces[1].legend() and "shifted by -100.3 s" in traces[1].legend()


def test_a_recording_of_lost_samples_only_can_be_drawn(tmp_path):
    rec = Recording(1e3, {"torque_Nm": np.full(5000, np.nan)})
    trace = Trace("x", rec)
    assert overlay.plot([trace], ["torque_Nm"], "none", tmp_path / "x.png").exists()
    assert overlay.difference(trace, trace, "torque_Nm") == (None, 0)
    one = Trace("one", Recording(1e3, {"torque_Nm": np.ones(1)}))
    assert overlay.plot([one, one], ["torque_Nm"], "none", tmp_path / "y.png").exists()


def test_the_summary_names_files_shifts_and_differences():
    traces = pair()
    overlay.align(traces, "trigger")
    summary = overlay.summary(traces, ["torque_Nm"], "trigger")
    assert [file["shift_s"] for file in summary["files"]] == [-0.4, -100.3001]
    assert [file["samples"] for file in summary["files"]] == [40_000, 1_500]
    rms = overlay.difference(*traces, "torque_Nm")[0]
    assert summary["channels"]["torque_Nm"] == {
        "unit": "N m", "rms_difference": [None, rms], "samples_compared": [0, 1500],
    }  # fmt: skip


def tripped(**meta) -> Recording:
    """Torque and speed of a drive that runs from 0.1 s on and trips at 0.6 s."""
    over_speed = next(bit for bit, name in firmware.FAULTS.items() if name == "over-speed")
    rec = Recording(1e3, {"faults": np.zeros(1000)}, {}, meta, 0.0)
    rec.channels["faults"][600:] = over_speed
    runs = (rec.time_s > 0.1 - 1e-6) & (rec.time_s < 0.6 - 1e-6)
    for name, value in (("torque_ref_Nm", 3.0), ("flux_ref_Wb", 0.5)):
        rec.channels[name] = np.where(runs, value, np.nan)
    rec.channels |= {"torque_Nm": np.ones(1000), "speed_rpm": np.ones(1000)}
    return rec


def test_references_are_what_was_asked_while_the_drive_ran():
    rec = tripped(speed_ref_rpm=[[0.0, 100.0], [0.4, -50.0]])
    speed = overlay.reference(rec, "speed_rpm")
    assert np.isnan(speed[[99, 600]]).all()
    assert speed[[100, 399, 400, 599]].tolist() == [100, 100, -50, -50]
    assert overlay.reference(rec, "plant.torque_Nm")[[100, 599]].tolist() == [3, 3]
    assert np.isnan(overlay.reference(rec, "flux_Wb")[600])
    assert overlay.reference(rec, "faults") is None
    # A board's recording has no speed reference, and another program may mean something else by it.
    for meta in ({}, {"speed_ref_rpm": 100.0}, {"speed_ref_rpm": [[1, 2, 3]]}):
        assert overlay.reference(tripped(**meta), "speed_rpm") is None


def test_a_trip_is_marked_at_its_time_with_its_faults():
    rec = tripped()
    assert overlay.trips(rec) == [(pytest.approx(0.6), "over-speed")]
    assert overlay.trips(rec.window(0.0, 0.5)) == [] == overlay.trips(Recording(1.0, {}))


def drawn(traces: list[Trace], names: list[str], monkeypatch):
    monkeypatch.setattr(overlay, "save", lambda figure, path: figure)
    return overlay.plot(traces, names, "none", None)


def test_the_picture_has_title_references_and_trips(monkeypatch):
    rec = tripped(title="Too fast", speed_ref_rpm=[[0.0, 100.0]])
    figure = drawn([Trace("x", rec)], ["torque_Nm", "speed_rpm", "faults"], monkeypatch)
    assert figure.get_suptitle() == "Too fast"
    assert [text.get_text() for ax in figure.axes for text in ax.texts] == ["trip: over-speed"]
    for ax, wanted in zip(figure.axes, (3.0, 100.0, None)):
        dashed = [line for line in ax.lines if line.get_gid() == overlay.REFERENCE]
        assert [np.nanmax(line.get_ydata()) for line in dashed] == [wanted] * (wanted is not None)
        assert any(line.get_linestyle() == ":" for line in ax.lines)  # the trip, in every panel
    texts = [text.get_text() for text in figure.legends[0].texts]
    assert texts == ["x  (1000/s)", "reference"]


def test_titles_that_differ_are_in_the_legend(monkeypatch):
    traces = [Trace("a", tripped(title="One")), Trace("b", tripped(title="Two"))]
    figure = drawn([*traces, Trace("c", tripped())], ["torque_Nm"], monkeypatch)
    texts = [text.get_text() for text in figure.legends[0].texts]
    assert texts == ["a: One  (1000/s)", "b: Two  (1000/s)", "c  (1000/s)", "reference"]
    assert not figure.get_suptitle()


def test_a_missing_file_names_the_one_that_was_meant(tmp_path):
    recorded(1e3, 0, 0, 10).save(tmp_path / "reversal.npz")
    with pytest.raises(RecordingError, match=r"did you mean '.*reversal\.npz'\?$"):
        overlay.read([str(tmp_path / "reversl.npz")])
    for name in ("other.npz", "reversl.csv", "nowhere/reversal.npz"):
        with pytest.raises(RecordingError) as refused:
            overlay.read([str(tmp_path / name)])
        assert "did you mean" not in str(refused.value)
