"""Figures are written, have the stated width, are not blank, and leave no global state."""

import itertools
import struct
import subprocess
import sys

import numpy as np
import pytest

from hexatorque.analysis import plots
from hexatorque.evidence.methods import pictures as fsw
from hexatorque.evidence.papers.printed_values import PAPER


def size(path):
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    return struct.unpack(">II", data[16:24])


def drawn(path):
    """Share of pixels that are not white."""
    from matplotlib.image import imread

    return float(np.mean(np.any(imread(path)[..., :3] < 0.95, axis=-1)))


#: Linear sRGB to the cones' L, M, S, and to X, Y, Z.
TO_LMS = np.array(
    [[17.8824, 43.5161, 4.11935], [3.45565, 27.1554, 3.86714], [0.0299566, 0.184309, 1.46709]]
)
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def seen_without(colour, cone):
    """A colour as a reader sees it who lacks a kind of cones, in CIE L*a*b*. Viénot, Brettel and
    Mollon 1999, in linear sRGB. Lack of the short cones is rare."""
    rgb = np.array([int(colour[n : n + 2], 16) / 255 for n in (1, 3, 5)])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    lost = np.eye(3)
    if cone == "long":
        lost[0] = (0, 2.02344, -2.52581)
    if cone == "middle":
        lost[1] = (0.494207, 0, 1.24827)
    linear = np.clip(np.linalg.inv(TO_LMS) @ lost @ TO_LMS @ linear, 0, 1)
    xyz = TO_XYZ @ linear / (0.9505, 1.0, 1.089)
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("cone", ("none", "long", "middle"))
@pytest.mark.parametrize("palette", (plots.PHASE_COLOUR, plots.LATENCY_COLOUR, fsw.INK))
def test_colours_of_one_panel_differ_for_every_reader(palette, cone):
    """By ten times what a reader just notices, which is about 1."""
    for a, b in itertools.combinations(palette.values(), 2):
        assert np.linalg.norm(seen_without(a, cone) - seen_without(b, cone)) > 10, (a, b)


@pytest.fixture
def runs(make_run):
    pairs = [("dtc1", "predicted"), ("fdr", "none"), ("fdr", "shadow"), ("fdr", "predicted")]
    return [make_run(scheme=scheme, latency=latency) for scheme, latency in pairs]


def bars(runs, path):
    return plots.bars(runs, path, PAPER)


@pytest.mark.parametrize("draw", [plots.waveforms, plots.spectra, bars])
@pytest.mark.parametrize("count", [1, 4])
def test_figure_is_written(draw, count, runs, tmp_path):
    path = draw(runs[:count], tmp_path / "new" / "figure.png")
    assert path == tmp_path / "new" / "figure.png"
    width, height = size(path)
    assert 1400 <= width <= 1600 and 300 < height < 2000
    assert 0.01 < drawn(path) < 0.9


@pytest.mark.parametrize("draw", [plots.waveforms, plots.spectra, bars])
def test_no_runs_are_refused(draw, tmp_path):
    with pytest.raises(ValueError, match="no runs"):
        draw([], tmp_path / "x.png")


def test_missing_values_and_references_do_not_stop_a_figure(make_run, tmp_path):
    run = make_run(rate_Hz=3000.0, prefix="", meta={})
    del run.recording.channels["torque_ref_Nm"]
    for draw in (plots.waveforms, plots.spectra, bars):
        assert size(draw([run], tmp_path / "x.png"))[0] == 1500


def test_waveforms_of_a_short_recording_show_all_of_it(make_run, tmp_path):
    run = make_run()
    run.recording = run.recording.window(0.0, 0.03)
    assert drawn(plots.waveforms([run], tmp_path / "x.png")) > 0.01


def test_bars_mark_what_the_paper_measured(make_run, tmp_path):
    runs = [make_run(scheme=scheme) for scheme in ("dtc1", "dtc3")]
    with_paper = plots.bars(runs, tmp_path / "a.png", PAPER).read_bytes()
    assert plots.bars(runs, tmp_path / "b.png", {}).read_bytes() != with_paper


def test_bar_markers_stand_at_the_papers_values(make_run):
    runs = [make_run(scheme=scheme, meta={"f_sw_Hz": 1500.0}) for scheme in ("dtc1", "dtc3")]
    for key, scale, expected in (
        ("thd_pct", 1.0, [23.5, 12.9]),
        ("torque_ripple_Nm", 1.0, [0.2617, 0.1063]),
        ("f_sw_Hz", 1e-3, [1.5, 3.0]),  # relative to our DTC1
        ("delta_i_A", 1.0, []),
    ):
        _, axes = plots.new_figure(1, 1, 2.0)
        plots._bar_panel(axes[0, 0], runs, key, scale, PAPER)
        marks = [float(line.get_ydata()[0]) for line in axes[0, 0].lines]
        assert marks == pytest.approx(expected)
        heights = [bar.get_height() for bar in axes[0, 0].patches]
        values = [run.metrics[key] for run in runs]
        values = [v["5kHz"] if key == "thd_pct" else v for v in values]
        assert heights == pytest.approx([scale * v for v in values])


def test_thinning_keeps_the_extremes_and_the_span():
    t = np.arange(100_003) / 1e5
    y = np.random.default_rng(1).normal(size=t.size)
    y[[17, 50_001, 100_002]] = 9.0, -9.0, 8.0
    thin_t, thin_y = plots.thin(t, y)
    assert thin_y.max() == 9.0 and thin_y.min() == -9.0
    assert thin_y[-1] == 8.0 and thin_t[-1] == t[-1]
    assert np.all(np.diff(thin_t) >= 0)
    assert thin_t.size < 4000
    # The padding does not change the last, incomplete bucket.
    y += 100
    y[100_001] = 50.0
    assert plots.thin(t, y)[1].min() == 50.0


def test_matplotlib_loads_on_first_use_only():
    code = (
        "import sys, hexatorque.analysis.plots as p; assert 'matplotlib' not in sys.modules;"
        "p.new_figure(1, 1, 2.0); assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_cells_hold_their_texts(tmp_path):
    figure, axes = plots.new_figure(1, 1, 2)
    texts = [["a\n1", "b"], ["c", "d\n4"]]
    plots.cells(axes[0, 0], ["r1", "r2"], ["c1", "c2"], texts, [["#0072b2"] * 2] * 2)
    shown = {(t.get_text(), round(t.get_position()[0]), round(t.get_position()[1]))
             for t in axes[0, 0].texts if t.get_text()}  # fmt: skip
    assert shown == {("a", 0, 0), ("1", 0, 0), ("b", 1, 0), ("c", 0, 1), ("d", 1, 1), ("4", 1, 1)}
    low, high = sorted(axes[0, 0].get_ylim())
    assert axes[0, 0].get_ylim()[0] > axes[0, 0].get_ylim()[1]  # the first row is on top
    assert low < 0 and high > 1
    assert drawn(plots.save(figure, tmp_path / "cells.png")) > 0.05


def test_thinning_keeps_extremes_beside_lost_samples():
    """Each bucket of 10 has a peak, a trough and a lost sample. One whole bucket is lost."""
    y = np.tile([0.0, 9.0, np.nan, -9.0, 0, 0, 0, 0, 0, 0], 1500)
    y[70:80] = np.nan
    t, kept = plots.thin(np.arange(y.size), y)
    assert kept.size == 3000 and np.all(np.diff(t) >= 0)
    assert np.flatnonzero(np.isnan(kept)).tolist() == [14, 15]
    assert np.all(np.delete(kept, [14, 15]).reshape(-1, 2) == [9, -9])
