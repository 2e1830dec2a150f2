"""Spectra of signals whose content is known in closed form."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque import measure
from hexatorque.analysis.spectrum import (
    channel,
    fundamental_Hz,
    harmonics,
    line_amplitude,
    low_pass,
    spectrum,
    thd_inf_pct,
    thd_pct,
    whole_cycles,
)
from hexatorque.plant.vsd import PHASES
from hexatorque.recording.recording import Recording, RecordingError

RATE_HZ = 50_000.0


def tones(duration_s, *parts, rate_Hz=RATE_HZ):
    """Sum of a cos(2 pi f t + p) for (a, f, p)."""
    t = np.arange(round(duration_s * rate_Hz)) / rate_Hz
    return sum(a * np.cos(2 * np.pi * f * t + p) for a, f, p in parts)


def test_spectrum_shows_peak_amplitudes_and_the_mean():
    f_Hz, amplitude = spectrum(1.5 + tones(0.5, (3.0, 40, 0.3), (0.2, 2000, 1.0)), RATE_HZ)
    assert f_Hz == pytest.approx(np.arange(f_Hz.size) * 2.0)  # lines every 1/0.5 s
    assert f_Hz[-1] == pytest.approx(RATE_HZ / 2)
    assert amplitude[20] == pytest.approx(3.0)
    assert amplitude[1000] == pytest.approx(0.2)
    assert amplitude[0] == pytest.approx(1.5)


def test_line_amplitude_between_bins():
    signal = tones(0.5, (3.0, 41.37, 0.3), (0.2, 977.7, 1.0))
    assert line_amplitude(signal, RATE_HZ, 41.37) == pytest.approx(3.0, rel=1e-4)
    assert line_amplitude(signal, RATE_HZ, 977.7) == pytest.approx(0.2, rel=1e-3)
    assert np.isnan(line_amplitude(signal, RATE_HZ, 25_001))


@settings(max_examples=40, deadline=None)
@given(
    f1_Hz=st.floats(20, 90),
    duration_s=st.floats(0.3, 0.8),
    h5=st.floats(0, 0.4),
    h7=st.floats(0, 0.4),
    offset=st.floats(-3, 3),
)
def test_harmonics_and_thd_do_not_depend_on_window_or_offset(f1_Hz, duration_s, h5, h7, offset):
    parts = (2.0, f1_Hz, 0.4), (2 * h5, 5 * f1_Hz, 1.0), (2 * h7, 7 * f1_Hz, 2.0)
    signal = offset + tones(duration_s, *parts)
    found = harmonics(signal, RATE_HZ, f1_Hz, (1, 5, 7, 11))
    assert found[1] == pytest.approx(2.0, rel=1e-3)
    assert found[5] == pytest.approx(2 * h5, abs=4e-3)
    assert found[7] == pytest.approx(2 * h7, abs=4e-3)
    assert found[11] == pytest.approx(0, abs=4e-3)
    expected = 100 * np.hypot(h5, h7)
    for band in thd_pct(signal, RATE_HZ, f1_Hz).values():
        assert band == pytest.approx(expected, abs=0.3)


@settings(max_examples=60, deadline=None)
@given(f1_Hz=st.floats(20, 90), cycles=st.floats(2.0, 8.0), h5=st.floats(0.1, 0.4))
def test_every_recording_of_two_cycles_or_more_has_its_harmonics(f1_Hz, cycles, h5):
    """The cut to whole cycles ends within half a sample of a cycle. A second cut would lose one."""
    count = int(np.ceil(cycles * RATE_HZ / f1_Hz))
    signal = tones(count / RATE_HZ, (2.0, f1_Hz, 0.4), (2 * h5, 5 * f1_Hz, 1.0))
    whole, _ = whole_cycles(signal, RATE_HZ, f1_Hz)
    distortion = thd_pct(signal, RATE_HZ, f1_Hz)
    lines = [line_amplitude(whole, RATE_HZ, k * f1_Hz) for k in range(1, 51)]
    expected = 100 * np.hypot.reduce(lines[1:]) / lines[0]
    assert distortion["h50"] == pytest.approx(expected, rel=1e-6)


def test_thd_bands_include_all_below_their_limit():
    parts = (10.0, 40, 0), (1.0, 200, 1), (0.7, 1480, 2), (0.5, 3333, 0), (0.9, 6000, 0)
    thd = thd_pct(tones(0.5, *parts), RATE_HZ, 40.0)
    assert thd["1kHz"] == pytest.approx(10, rel=1e-6)
    assert thd["2kHz"] == pytest.approx(10 * np.hypot(1, 0.7), rel=1e-6)
    # 3333 Hz is between two bins, but its side lobes are inside the band.
    assert thd["5kHz"] == pytest.approx(10 * np.sqrt(1 + 0.49 + 0.25), rel=1e-4)
    # 1480 Hz is order 37. 3333 Hz is no harmonic.
    assert thd["h50"] == pytest.approx(10 * np.hypot(1, 0.7), rel=1e-3)


def test_interharmonics_and_subharmonics_count_in_the_bands_only():
    thd = thd_pct(tones(1.0, (10.0, 40, 0), (0.4, 25, 0), (0.3, 100, 0)), RATE_HZ, 40.0)
    assert thd["1kHz"] == pytest.approx(5, rel=1e-6)
    assert thd["h50"] == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("side", (1, -1))
def test_the_lobe_of_the_fundamental_is_three_bins_on_both_sides(side):
    """A line takes its own bin and one on each side. Two bins from the fundamental it is part of
    this one, five bins away all of it is distortion."""
    f1_Hz, bin_Hz = 50.0, 2.0
    for bins, part in ((2, 0.0), (5, 0.2)):
        signal = tones(1 / bin_Hz, (1.0, f1_Hz, 0.4), (0.2, f1_Hz + side * bins * bin_Hz, 1.1))
        assert thd_inf_pct(signal[None], RATE_HZ, f1_Hz) == pytest.approx(100 * part, abs=0.01)
        assert thd_pct(signal, RATE_HZ, f1_Hz)["1kHz"] == pytest.approx(100 * part, abs=0.6)


def test_low_pass_has_the_magnitude_of_a_butterworth_filter_and_no_phase_shift():
    parts = ((1.0, 0.0, 0.0), (1.0, 20.0, 0.3), (1.0, 100.0, 1.0), (1.0, 400.0, -1.0))
    slow = low_pass(tones(0.5, *parts), RATE_HZ, 100.0)
    wanted = [(a / np.hypot(1, (f / 100) ** 2), f, p) for a, f, p in parts]
    np.testing.assert_allclose(slow, tones(0.5, *wanted), atol=1e-9)


def test_second_harmonic_counts():
    thd = thd_pct(tones(0.5, (10.0, 40, 0), (0.8, 80, 1)), RATE_HZ, 40.0)
    assert list(thd.values()) == pytest.approx([8] * 4, rel=1e-6)


def test_two_cycles_suffice_outside_the_lobe():
    signal = 30 + tones(0.05, (10.0, 40, 0), (1.0, 200, 1))
    assert thd_pct(signal, RATE_HZ, 40.0)["1kHz"] == pytest.approx(10, rel=1e-6)


def test_a_line_at_nyquist_counts_with_its_power():
    signal = tones(1.0, (10.0, 40, 0), (0.5, 1000, 0), rate_Hz=2000)  # +0.5, -0.5, ...
    expected = 100 * 0.5 / (10 / np.sqrt(2))
    assert thd_pct(signal, 2000, 40.0)["1kHz"] == pytest.approx(expected, rel=1e-6)


def test_white_noise_adds_its_share_of_the_power():
    sigma, amplitude = 0.3, 5.0
    noise = np.random.default_rng(7).normal(0, sigma, round(4 * RATE_HZ))
    thd = thd_pct(tones(4.0, (amplitude, 40, 0)) + noise, RATE_HZ, 40.0)
    for name, limit_Hz in (("1kHz", 1e3), ("2kHz", 2e3), ("5kHz", 5e3)):
        power = sigma**2 * limit_Hz / (RATE_HZ / 2)
        assert thd[name] == pytest.approx(100 * np.sqrt(power / (amplitude**2 / 2)), rel=0.03)


def test_band_power_agrees_with_scipy():
    rng = np.random.default_rng(3)
    signal = tones(1.0, (4.0, 40, 0)) + np.cumsum(rng.normal(0, 0.02, round(RATE_HZ)))
    from scipy.signal import periodogram  # slow to load, and every process loads this file

    f_Hz, density = periodogram(signal, RATE_HZ, "hann", detrend="constant")
    lobe = np.abs(f_Hz - 40) < 3.5
    band = (f_Hz > 1.5) & (f_Hz <= 2000) & ~lobe
    expected = 100 * np.sqrt(density[band].sum() / density[lobe].sum())
    assert thd_pct(signal, RATE_HZ, 40.0)["2kHz"] == pytest.approx(expected, rel=1e-3)


def test_bands_beyond_nyquist_are_none():
    thd = thd_pct(tones(0.5, (1.0, 45, 0), rate_Hz=4000), 4000, 45.0)
    assert thd["5kHz"] is None
    assert thd["h50"] is None  # 2250 Hz
    assert thd["2kHz"] == pytest.approx(0, abs=0.05)  # its limit is Nyquist itself
    found = harmonics(tones(0.5, (1.0, 45, 0), rate_Hz=400), 400, 45.0, (1, 5))
    assert found[1] == pytest.approx(1.0, rel=5e-3)
    assert np.isnan(found[5])


def test_no_fundamental_gives_no_number():
    assert np.isnan(thd_pct(np.zeros(1000), 1000, 50.0)["h50"] or np.nan)


@pytest.mark.parametrize("duration_s", [0.05, 0.06, 0.123])
def test_whole_cycles_are_the_last_ones(duration_s):
    signal = np.arange(round(duration_s * RATE_HZ), dtype=float)
    part, cycles = whole_cycles(signal, RATE_HZ, 40.0)
    assert cycles == int(duration_s * 40)
    assert part.size == cycles * 1250
    assert part[-1] == signal[-1]


def test_too_short_is_refused_with_the_reason():
    signal = tones(0.04, (1.0, 40, 0))
    for function in (whole_cycles, thd_pct, lambda *a: harmonics(*a, (1,))):
        with pytest.raises(ValueError, match=r"0\.04 s.*1\.60 cycles.*40 Hz.*at least 2"):
            function(signal, RATE_HZ, 40.0)
    with pytest.raises(ValueError, match="does not fit"):
        whole_cycles(signal, RATE_HZ, 0.0)
    with pytest.raises(ValueError, match="does not fit"):
        whole_cycles(signal, RATE_HZ, float("nan"))
    with pytest.raises(ValueError, match="orders start at 1"):
        harmonics(tones(0.4, (1.0, 40, 0)), RATE_HZ, 40.0, (0, 1))
    with pytest.raises(ValueError, match="two samples"):
        spectrum(np.ones(1), RATE_HZ)


@pytest.mark.parametrize("f1_Hz", [41.7, -41.7, 3.9])
def test_fundamental_is_signed(make_recording, f1_Hz):
    rec = make_recording(f1_Hz=f1_Hz, duration_s=2.0)
    assert fundamental_Hz(rec) == pytest.approx(f1_Hz, rel=1e-6)


def test_fundamental_falls_back_on_the_controllers_flux(make_recording):
    rec = make_recording(f1_Hz=41.7, prefix="")
    assert fundamental_Hz(rec) == pytest.approx(41.7, rel=1e-6)


def test_true_flux_is_preferred(make_recording):
    rec = make_recording(f1_Hz=41.7)
    other = make_recording(f1_Hz=30.0, prefix="")
    rec.channels |= {k: v for k, v in other.channels.items() if k.startswith("psi_")}
    assert fundamental_Hz(rec) == pytest.approx(41.7, rel=1e-6)


def test_fundamental_refuses_standstill_and_missing_flux(make_recording):
    with pytest.raises(ValueError, match="at least 2 are needed"):
        fundamental_Hz(make_recording(f1_Hz=3.0))
    still = make_recording(f1_Hz=0.0)
    with pytest.raises(ValueError, match=r"0\.00 cycles"):
        fundamental_Hz(still)
    for bad in (0.0, np.nan):
        psi = np.full(100, bad)
        with pytest.raises(ValueError, match="no stator flux"):
            fundamental_Hz(Recording(1e3, {"psi_alpha_Wb": psi, "psi_beta_Wb": psi}))
    with pytest.raises(RecordingError, match="psi_alpha_Wb"):
        fundamental_Hz(Recording(1e3, {"torque_Nm": np.zeros(100)}))


POINTS = (("paper-b", 2500, 2), ("paper-a-feasible", 400, 10), ("paper-a-feasible", 100, 10))


@pytest.mark.parametrize("scheme", ("dtc1", "ddr", "db-dtfc"))
def test_distortion_differs_from_a_fit_by_what_the_page_tells(scheme):
    """Least squares know no bins: what is left of mean and fundamental is distortion."""
    page = (Path(__file__).parents[3] / "docs" / "model.md").read_text(encoding="utf-8")
    most_pct = float(re.search(r"its THD∞ reads up to (\d+) % too low", page)[1])
    found_pct = []
    for setup, speed_rpm, load_Nm in POINTS:
        rec = measure(setup, scheme=scheme, speed_rpm=speed_rpm, load_Nm=load_Nm).recording
        f1_Hz = abs(fundamental_Hz(rec))
        phases_A = np.stack([channel(rec, f"i_{phase}_A") for phase in PHASES])
        left = fundamental = 0.0
        for i_A in phases_A:
            x, _ = whole_cycles(i_A, rec.rate_Hz, f1_Hz)
            angle = 2 * np.pi * f1_Hz / rec.rate_Hz * np.arange(x.size)
            basis = np.stack([np.ones(x.size), np.cos(angle), np.sin(angle)], axis=1)
            fit = np.linalg.lstsq(basis, x, rcond=None)[0]
            left += np.mean((x - basis @ fit) ** 2)
            fundamental += np.hypot(fit[1], fit[2]) ** 2 / 2
        fitted_pct = 100 * np.sqrt(left / fundamental)
        found_pct.append(100 * (thd_inf_pct(phases_A, rec.rate_Hz, f1_Hz) / fitted_pct - 1))
    if scheme == "dtc1":
        assert -most_pct < min(found_pct) < 1 - most_pct and max(found_pct) < 0.5, found_pct
    else:
        assert np.abs(found_pct).max() < 1, found_pct
