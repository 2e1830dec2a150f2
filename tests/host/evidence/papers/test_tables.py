"""B-T1 to B-T4: the compiled tables are compared with the effect of each vector on torque, flux and
x-y flux, and so are the recordings of running drives, period by period."""

import dataclasses

import numpy as np
import pytest

from hexatorque.evidence.papers.engine import audit as audit_module
from hexatorque.evidence.papers.paper_b import tables

ANGLE = np.deg2rad([0, 30, 120, 150, 240, 270])
BITS = np.array([[w >> b & 1 for b in range(5, -1, -1)] for w in range(64)])
AB, XY = (BITS @ np.exp(n * 1j * ANGLE) / 3 for n in (1, 5))
LENGTH = {"large": 0.643951, "medium": 0.471405, "small": 0.172546}
FIGURES = {"b_t1": "dtc1", "b_t2": "dtc2", "b_t4": "dtc3"}


@pytest.fixture(scope="module")
def figures(job):
    return {name: getattr(tables, name)(job) for name in (*FIGURES, "b_t3")}


def groups(words):
    return np.array(
        [min(LENGTH, key=lambda g: abs(LENGTH[g] - abs(AB[w]))) for w in np.atleast_1d(words)]
    )


@pytest.mark.parametrize("name", FIGURES)
def test_compiled_cells_do_what_is_demanded(figures, name):
    """In sector s the flux points at 30 s degrees. psi x v changes the torque, psi . v the flux."""
    cells = 0
    for table in figures[name].metrics["by_sector"].values():
        for demand, row in table.items():
            level, up = int(demand.split()[1]), int(demand.split()[3])
            for s, words in enumerate(row):
                for word in words:
                    effect = AB[word] * np.exp(-1j * np.deg2rad(30 * s))
                    assert np.sign(effect.imag) == np.sign(level)
                    assert (effect.real > 0) == bool(up)
                    assert abs(effect.real) == pytest.approx(abs(AB[word]) * np.cos(np.deg2rad(75)))
                if len(words) == 2:
                    assert (XY[words[0]] * np.conj(XY[words[1]])).real < 0  # opposed
                cells += 1
    assert cells == {"b_t1": 48, "b_t2": 96, "b_t4": 96}[name]


def test_printed_cells(figures):
    first = {
        name: [[cell for row in table.values() for cell in row[0]]
               for table in figures[name].metrics["by_sector"].values()]
        for name in FIGURES
    }  # fmt: skip
    assert first["b_t1"] == [[60, 28, 35, 3]]
    assert first["b_t2"] == [[60, 28, 35, 3], [24, 44, 19, 39]]
    assert first["b_t4"] == [
        [60, 24, 28, 44, 36, 24, 26, 44, 37, 19, 27, 39, 35, 19, 3, 39]
    ]  # L3 L4 S3 S4 S10 S9 L10 L9


@pytest.mark.parametrize(("name", "scheme"), FIGURES.items())
def test_running_drive_does_what_is_demanded(figures, name, scheme):
    """The test does not use the tables. It checks the signs of psi x v, psi . v and v_xy . psi_xy
    in every period with a torque demand, with a tolerance for the flux's place in its sector."""
    rec = figures[name].recordings[""]
    assert not any(v.broken for v in figures[name].verdicts)
    level, up = rec["torque_level"], rec["flux_level"] == 1
    psi = rec["psi_alpha_Wb"] + 1j * rec["psi_beta_Wb"]
    psi_xy = rec["psi_x_Wb"] + 1j * rec["psi_y_Wb"]
    word = rec["word"]
    active = level != 0
    assert active.sum() > 1000
    lead = np.rad2deg(np.angle(AB[word] / psi))[active]
    assert (np.sign(lead) == np.sign(level[active])).all()
    # The vector is 75 or 105 degrees from the sector's middle, and the flux is within 15 degrees of
    # it.
    off = abs(lead) - np.where(up[active], 75, 105)
    assert abs(off).max() <= 15.001
    kind = groups(word[active])
    if scheme == "dtc1":
        assert (kind == "large").all()
    else:
        assert ((XY[word] * np.conj(psi_xy)).real[active] < 0).all()
        full = abs(level[active]) == (2 if scheme == "dtc3" else 1)
        assert set(kind[full]) == {"large", "medium"}
        if scheme == "dtc3":
            assert set(kind[~full]) == {"small", "medium"}
    # Without a demand there is a zero vector, or the vector nearest to a flux below 96 %
    # (flux_hold).
    idle = ~active
    hold = idle & (abs(AB[word]) > 1e-6)
    assert (hold == rec["flux_hold"].astype(bool)).all()
    assert 0 < hold.sum() < 0.03 * idle.sum()
    assert (abs(psi[hold]) < 0.96 * rec["flux_ref_Wb"][hold]).all()
    assert abs(np.rad2deg(np.angle(AB[word[hold]] / psi[hold]))).max() <= 30.001


@pytest.mark.parametrize("scheme", ["dtc2", "dtc3"])
def test_selection_takes_xy_flux_away(figures, scheme):
    selection = np.array(figures["b_t3"].metrics["selection"])
    large = [w for w in range(64) if groups(w)[0] == "large" and abs(AB[w]) > 0.6]
    large.sort(key=lambda w: np.angle(AB[w]) % (2 * np.pi))
    for k, word in enumerate(large):
        for j in range(12):
            grows = (XY[word] * np.exp(-1j * np.deg2rad(30 * j))).real > 0
            assert selection[k, j] == (2 if grows else 1)
    rec = figures["b_t3"].recordings[scheme]
    active = rec["torque_level"] != 0
    word, psi_xy = rec["word"][active], (rec["psi_x_Wb"] + 1j * rec["psi_y_Wb"])[active]
    j = np.floor((np.rad2deg(np.angle(psi_xy)) + 15) / 30).astype(int) % 12
    k = np.round((np.rad2deg(np.angle(AB[word])) - 15) / 30).astype(int) % 12
    assert (selection[k, j] == np.where(groups(word) == "medium", 2, 1)).all()


def test_the_sentence_of_section_iv_a_is_wrong_in_every_sector(figures):
    """With the x-y flux in v to x, V24 would raise it and V60 lowers it. Elsewhere it is the
    opposite."""
    for j in range(12):
        psi_xy = np.exp(1j * np.deg2rad(30 * j))
        said = 24 if 4 <= j <= 9 else 60
        assert (XY[said] * np.conj(psi_xy)).real > 0
    (verdict,) = [v for v in figures["b_t3"].verdicts if v.what.startswith("the sentence")]
    assert verdict.verdict == "differs" and verdict.ours.startswith("0 of ")
    assert not any(v.broken for v in figures["b_t3"].verdicts)


def test_a_wrong_word_breaks_the_verdict(job, monkeypatch):
    right = audit_module.audit(job, "dtc1")
    word = right.word.copy()
    word[np.flatnonzero(~right.idle)[7]] ^= 1
    wrong = dataclasses.replace(right, word=word)
    monkeypatch.setattr(tables, "audit", lambda job, scheme: wrong)
    broken = [v.what for v in tables.b_t1(job).verdicts if v.broken]
    assert broken == ["DTC1 running: the table's vector is on the legs"]


@pytest.mark.parametrize(("own", "other"), (("large", "medium"), ("medium", "large")))
def test_a_wrong_choice_breaks_table_iii(job, monkeypatch, own, other):
    """One period has the other vector of its pair."""
    right = audit_module.audit
    mine, others = (
        [w for w in range(64) if abs(abs(AB[w]) - LENGTH[g]) < 1e-4] for g in (own, other)
    )

    def wrong(job, scheme):
        run = right(job, scheme)
        word = run.word.copy()
        n = next(n for n in range(500, len(word)) if word[n] in mine)
        word[n] = min(others, key=lambda w: abs(np.angle(AB[w] / AB[word[n]])))
        return dataclasses.replace(run, word=word)

    monkeypatch.setattr(tables, "audit", wrong)
    broken = [v.what for v in tables.b_t3(job).verdicts if v.broken]
    assert broken == ["DTC2 and DTC3 running: the choice is Table III's"]


def test_a_wrong_compiled_table_breaks_the_verdicts(job, monkeypatch):
    right = tables.Law.words
    monkeypatch.setattr(
        tables.Law, "words", lambda law, s, level, up, psi=0j: right(law, s, level, not up, psi)
    )
    for name in FIGURES:
        assert any("printed" in v.what for v in getattr(tables, name)(job).verdicts if v.broken)


def test_words_of_a_period_that_changes_are_not_taken():
    """The gates have two bits per leg, where 2 is off. The samples are at 0, 1/4, 1/2 and 3/4 of
    the period."""
    high, low, off = 0b01 << 10, 0, 0b10 << 10
    gates = np.array([low, high, high, high, high, high, low, low, low, low, off, low], float)
    assert audit_module.words_of(gates).tolist() == [32, -1, -1]


@pytest.mark.parametrize("name", [*FIGURES, "b_t3"])
def test_picture(figures, name, tmp_path):
    assert figures[name].draw(tmp_path / "figure.png").stat().st_size > 30_000
