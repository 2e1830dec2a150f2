"""Spectra of equally sampled signals: fundamental, lines, THD.

Every function uses the periodic Hann window w[n] = (1 - cos(2 pi n / N)) / 2. A line of peak
amplitude A has the value A in `spectrum`. Its power spreads over three bins. Where bins are added
up, the equivalent noise bandwidth ENBW = N sum(w^2) / sum(w)^2 = 1.5 corrects this.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import numpy as np

from ..errors import InputError
from ..recording.recording import Recording

#: Upper limits of the THD bands.
BANDS_HZ = {"1kHz": 1e3, "2kHz": 2e3, "5kHz": 5e3}
#: Highest order in the harmonic-only THD "h50".
HIGHEST_ORDER = 50
#: Half width of the fundamental's main lobe.
LOBE_BINS = 3
MINIMUM_CYCLES = 2


def channel(rec: Recording, name: str) -> np.ndarray:
    """The true value "plant.<name>" if the recording has it, else the controller's `name`."""
    true = f"plant.{name}"
    return np.asarray(rec[true] if true in rec else rec[name], dtype=float)


def fundamental_Hz(rec: Recording) -> float:
    """Mean rotation rate of the stator flux in Hz; negative for reverse rotation.

    f1 = slope / (2 pi) of the least-squares line through the unwrapped angle of psi_alpha + j
    psi_beta. InputError if the recording is shorter than two cycles.
    """
    psi_Wb = channel(rec, "psi_alpha_Wb") + 1j * channel(rec, "psi_beta_Wb")
    if psi_Wb.size < 2 or not np.all(np.isfinite(psi_Wb)) or not np.any(psi_Wb):
        raise InputError("no stator flux in the recording, so no fundamental frequency")
    angle = np.unwrap(np.angle(psi_Wb))
    n = np.arange(angle.size) - (angle.size - 1) / 2
    f1_Hz = float(n @ angle / (n @ n)) * rec.rate_Hz / (2 * np.pi)
    _cycles(angle.size, rec.rate_Hz, f1_Hz)
    return f1_Hz


def _cycles(samples: int, rate_Hz: float, f1_Hz: float) -> int:
    """The number of whole cycles of f1 in that many samples. InputError if it is below
    two."""
    cycles = samples * abs(f1_Hz) / rate_Hz
    if not cycles + 1e-6 >= MINIMUM_CYCLES:
        raise InputError(
            f"the recording ({samples / rate_Hz:.4g} s) holds {cycles:.2f} cycles of the "
            f"fundamental ({abs(f1_Hz):.4g} Hz); at least {MINIMUM_CYCLES} are needed"
        )
    return int(cycles + 1e-6)


def whole_cycles(signal: np.ndarray, rate_Hz: float, f1_Hz: float) -> tuple[np.ndarray, int]:
    """The last whole cycles of f1 in `signal`, cut to half a sample, and their number."""
    signal = np.asarray(signal, dtype=float)
    if not 0 < abs(f1_Hz) < rate_Hz / 2:
        raise InputError(f"a fundamental of {f1_Hz:.4g} Hz does not fit {rate_Hz:.4g} samples/s")
    cycles = _cycles(signal.size, rate_Hz, f1_Hz)
    count = min(signal.size, round(cycles * rate_Hz / abs(f1_Hz)))
    return signal[signal.size - count :], cycles


@lru_cache(maxsize=4)
def _hann(n: int) -> np.ndarray:
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)


def spectrum(signal: np.ndarray, rate_Hz: float) -> tuple[np.ndarray, np.ndarray]:
    """(f in Hz, peak amplitude in the unit of the signal).

    A[k] = 2 |sum w x exp(-j 2 pi k n / N)| / sum w, and half of that at f = 0.
    """
    x = np.asarray(signal, dtype=float)
    if x.size < 2:
        raise InputError("a spectrum needs at least two samples")
    w = _hann(x.size)
    amplitude = 2 * np.abs(np.fft.rfft(w * x)) / w.sum()
    amplitude[0] /= 2
    return np.fft.rfftfreq(x.size, 1 / rate_Hz), amplitude


def line_amplitude(signal: np.ndarray, rate_Hz: float, f_Hz: float) -> float:
    """The peak amplitude at exactly f_Hz, on a bin or between two, over all given samples.

    A = 2 |sum w x exp(-j 2 pi f n / rate)| / sum w. Other lines must be at least two bins (2 rate /
    N) away. NaN above the Nyquist frequency.
    """
    x = np.asarray(signal, dtype=float)
    rotor = np.exp(-2j * np.pi * f_Hz / rate_Hz * np.arange(x.size))
    return _line(_hann(x.size), x, rotor) if abs(f_Hz) <= rate_Hz / 2 else float("nan")


def _line(w: np.ndarray, x: np.ndarray, rotor: np.ndarray) -> float:
    return float(2 * abs(_dot(w * x, rotor)) / w.sum())


def _dot(a: np.ndarray, b: np.ndarray) -> Any:
    """Sum of the products. `@` is not used because its threads wait for each other when several
    points are measured at once."""
    return np.einsum("n,n", a, b)


def harmonics(
    signal: np.ndarray, rate_Hz: float, f1_Hz: float, orders: Iterable[int]
) -> dict[int, float]:
    """Order -> peak amplitude, as `line_amplitude` defines it, at order * f1 over the last whole
    cycles of f1. NaN above the Nyquist frequency."""
    x, _ = whole_cycles(signal, rate_Hz, f1_Hz)
    return _harmonics(x, rate_Hz, f1_Hz, orders)


def _harmonics(
    x: np.ndarray, rate_Hz: float, f1_Hz: float, orders: Iterable[int]
) -> dict[int, float]:
    """`harmonics` over all of x. Whole cycles that are cut once more could lose one: they end
    within half a sample of the last cycle's end."""
    w = _hann(x.size)
    base = np.exp(-2j * np.pi * abs(f1_Hz) / rate_Hz * np.arange(x.size))
    rotor, at, found = np.ones_like(base), 0, {}
    for order in sorted(set(orders)):
        if order < 1:
            raise InputError(f"harmonic order {order}: orders start at 1")
        if order * abs(f1_Hz) > rate_Hz / 2:
            found[order] = float("nan")
            continue
        while at < order:  # exp(-j order phi), without computing an exponential for each order
            rotor *= base
            at += 1
        found[order] = _line(w, x, rotor)
    return found


def low_pass(signal: np.ndarray, rate_Hz: float, corner_Hz: float) -> np.ndarray:
    """Filter with a second-order Butterworth magnitude 1/sqrt(1 + (f/corner)^4), without phase
    shift. It gives the picture that an oscilloscope's filter shows. The signal is taken as
    periodic: give whole cycles, or ignore the ends."""
    x = np.asarray(signal, dtype=float)
    f_Hz = np.fft.rfftfreq(x.size, 1 / rate_Hz)
    return np.fft.irfft(np.fft.rfft(x) / np.sqrt(1 + (f_Hz / corner_Hz) ** 4), x.size)


def thd_pct(
    signal: np.ndarray, rate_Hz: float, f1_Hz: float, h50: bool = True
) -> dict[str, float | None]:
    """Total harmonic distortion in % of the fundamental, by band.

    "1kHz", "2kHz", "5kHz": everything up to that frequency, inter- and subharmonics
    included, except DC (the mean and bin 1) and the fundamental (bins k1 - 3 .. k1 + 3):
        100 sqrt( sum_band P / sum_lobe P ),  P[k] = 2 |rfft(w x)[k]|^2 / (N sum w^2).
    "h50": harmonics only, 100 sqrt(A_2^2 + ... + A_50^2) / A_1 (see `harmonics`); None without
    `h50`, because it takes longer than all others. None where the limit is above Nyquist.
    Computed over the last whole cycles of f1; use five or more, else the 2nd harmonic is within
    the lobe.
    """
    x, k1 = whole_cycles(signal, rate_Hz, f1_Hz)
    power = _power(x)
    f_Hz = np.fft.rfftfreq(x.size, 1 / rate_Hz)
    lobe = slice(max(1, k1 - LOBE_BINS), k1 + LOBE_BINS + 1)
    fundamental = power[lobe].sum()
    power[lobe] = 0
    power[:2] = 0

    nyquist_Hz = rate_Hz / 2
    result: dict[str, float | None] = {}
    for name, limit_Hz in BANDS_HZ.items():
        content = power[f_Hz <= limit_Hz].sum()
        result[name] = _percent(content, fundamental) if limit_Hz <= nyquist_Hz else None
    result["h50"] = None
    if h50 and HIGHEST_ORDER * abs(f1_Hz) <= nyquist_Hz:
        line = _harmonics(x, rate_Hz, f1_Hz, range(1, HIGHEST_ORDER + 1))
        content = sum(a * a for order, a in line.items() if order > 1)
        result["h50"] = _percent(content, line[1] ** 2)
    return result


def thd_inf_pct(signals: np.ndarray, rate_Hz: float, f1_Hz: float) -> float:
    """Distortion of several phases together in %, over the whole recorded spectrum.

    100 sqrt(sum P / sum_lobe P), both sums over all rows of `signals` (phases, samples): everything
    but DC (the mean and bin 1) and the fundamental (bins k1 - 3 .. k1 + 3), up to the Nyquist
    frequency. Over the last whole cycles of f1."""
    content = fundamental = 0.0
    for signal in signals:
        x, k1 = whole_cycles(signal, rate_Hz, f1_Hz)
        power = _power(x)
        lobe = slice(max(1, k1 - LOBE_BINS), k1 + LOBE_BINS + 1)
        fundamental += power[lobe].sum()
        power[lobe] = 0
        content += power[2:].sum()
    return _percent(content, fundamental)


def _power(x: np.ndarray) -> np.ndarray:
    """Mean square of each bin, without the mean."""
    w = _hann(x.size)
    mean, square = _dot(w, x) / w.sum(), _dot(w, w)
    power = 2 * np.abs(np.fft.rfft(w * (x - mean))) ** 2 / (x.size * square)
    if x.size % 2 == 0:
        power[-1] /= 2  # the Nyquist bin has no mirror
    return power


def _percent(content: float, fundamental: float) -> float:
    """100 sqrt(content / fundamental); NaN if the fundamental is 0."""
    return float(100 * np.sqrt(content / fundamental)) if fundamental > 0 else float("nan")
