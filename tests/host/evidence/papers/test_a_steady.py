"""Paper A in steady state and with schemes exchanged while running: the figures are computed again
from the recordings, and the claims must fail if the x-y regulator is off."""

import math

import numpy as np
import pytest

from hexatorque.evidence.papers.paper_a import common, inflight, steady


@pytest.fixture(scope="module")
def a7(job):
    return steady.a7(job)


@pytest.fixture(scope="module")
def a9(job):
    return inflight.a9(job)


def verdict(figure, text):
    found = [v for v in figure.verdicts if text in v.what]
    assert found, text
    return found


def circle_A(rec, order, f1_Hz):
    """The radius of the x-y current's component that turns at +order f1 or -order f1, whichever is
    larger, by correlation with a turning vector over whole cycles."""
    count = round(math.floor(rec.duration_s * f1_Hz) * rec.rate_Hz / f1_Hz)
    z = rec["plant.i_x_A"][:count] + 1j * rec["plant.i_y_A"][:count].astype(float)
    turn = np.exp(2j * np.pi * order * f1_Hz * np.arange(count) / rec.rate_Hz)
    return max(abs(np.mean(z * turn)), abs(np.mean(z * turn.conj())))


def f1_of(rec):
    """f1 from the zero crossings of a phase current behind a moving mean."""
    n = round(rec.rate_Hz / 100)
    y = np.convolve(rec["plant.i_u1_A"], np.ones(n) / n, "valid")
    ups = np.nonzero((y[:-1] < 0) & (y[1:] >= 0))[0]
    ups = ups[np.insert(np.diff(ups) > rec.rate_Hz / 20, 0, True)]
    return rec.rate_Hz * (len(ups) - 1) / (ups[-1] - ups[0])


def test_lines_are_in_the_recording(a7):
    """Order 1 comes from the difference of the sets and turns against the flux. Order 5 turns with
    the flux, order 7 against it."""
    for scheme in ("fdr", "ddr"):
        rec = a7.recordings[scheme]
        for order in (1, 5, 7):
            radius = circle_A(rec, order, f1_of(rec))
            noise = 0.002
            assert a7.metrics[scheme]["xy_line_A"][str(order)] == pytest.approx(
                radius, rel=0.1, abs=noise
            )


def test_no_load_current_is_the_magnetising_one(a7):
    """|psi| = L_s |i| without load: 0.6 Wb / 294 mH."""
    setup = common.setup("ddr")
    ls = setup["machine.lls_H"] + setup["machine.lm_H"]
    assert a7.metrics["ddr"]["i1_A"] == pytest.approx(0.6 / ls, rel=0.02)


def test_claims_of_a7_hold(a7):
    for v in (*verdict(a7, "gone under DDR"), *verdict(a7, "unequal phase currents")):
        assert v.verdict == "match", v
    assert a7.draw and set(a7.recordings) == {"fdr", "ddr"}


def test_claims_fail_without_the_regulator(job, monkeypatch):
    real = common.setup
    monkeypatch.setattr(common, "setup", lambda scheme, *a, **k: real("fdr", *a, **k))
    figure = steady.a7(job)
    assert {v.verdict for v in verdict(figure, "gone under DDR")} == {"differs"}
    assert {v.verdict for v in verdict(figure, "unequal phase")} == {"differs"}


def test_the_printed_rated_point_is_limited_by_the_voltage(job, tmp_path):
    """The vectors without x-y mean must provide omega psi + R i. So the speed is between the limit
    by V_dc/sqrt 3 minus the drop and the limit by the large vectors' dodecagon."""
    figure = steady.a8(job)
    rpm_per_V = 60 / (2 * math.pi) / 2 / 0.6
    for scheme in ("fdr", "ddr"):
        held = figure.metrics[scheme]["as_printed"]
        low = (250 / math.sqrt(3) - 2 * 1.92 * 4.3) * rpm_per_V
        assert low < held["speed_rpm"] < 0.622 * 250 * rpm_per_V
        assert held["state"] == "run"
        assert held["torque_Nm"] == pytest.approx(
            10 + 0.0033 * held["speed_rpm"] * math.pi / 30, rel=0.02
        )
    for v in verdict(figure, "as printed"):
        assert v.verdict == "differs" and "169.6 V" in v.why and "144.3 V" in v.why
    assert {v.verdict for v in verdict(figure, "with field weakening")} == {"match"}
    for k in (1, 5, 7):
        [v] = verdict(figure, f"x–y current at {k} f₁")
        assert v.verdict == "match"
    path = figure.draw(tmp_path / "a8.png")
    assert path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 50_000


def xy_below_1_kHz_A(rec):
    """Rms of the x-y current, as a mean over 1 ms shows it."""
    n = round(rec.rate_Hz / 1000)
    x, y = (np.convolve(rec[f"plant.i_{c}_A"], np.ones(n) / n, "valid") for c in "xy")
    return np.sqrt(np.mean(x**2 + y**2))


def test_schemes_exchanged_while_running(a9):
    """The test checks the recording itself: scheme, commands and x-y current before, between and
    after the changes."""
    rec = a9.recordings[""]
    off_s, on_s, end_s = a9.metrics["instants_s"]
    t = rec.time_s
    fdr = (t >= off_s) & (t < on_s)
    assert len(np.unique(rec["scheme"][fdr])) == len(np.unique(rec["scheme"][~fdr])) == 1
    assert not rec["v_x_pu"][fdr].any() and not rec["v_y_pu"][fdr].any()
    assert rec["v_x_pu"][~fdr].std() > 1e-3
    spans_s = ((0, off_s), (off_s, on_s), (on_s + 0.2, end_s))
    before, between, after = (xy_below_1_kHz_A(rec.window(*span_s)) for span_s in spans_s)
    assert between > 2.5 * before and between > 2.5 * after
    assert all(v.verdict == "match" for v in a9.verdicts)


def test_exchange_claims_fail_the_other_way_round(a9):
    figures = {part: a9.metrics[part] for part in inflight.PARTS}
    turned = {"ddr": figures["fdr"], "fdr": figures["ddr"], "ddr again": figures["fdr"]}
    assert all(v.verdict == "differs" and v.broken for v in inflight._verdicts(turned))


def test_extract_keeps_time_and_rate(a9):
    rec = a9.recordings[""]
    part = common.extract(rec, ("plant.i_x_A",), 1.0, 1.5, every=4)
    assert part.rate_Hz == rec.rate_Hz / 4 and part.start_s == pytest.approx(1.0)
    assert np.array_equal(part["plant.i_x_A"], rec.window(1.0, 1.5)["plant.i_x_A"][::4])
