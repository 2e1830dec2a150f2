"""A-T2: the rows are compared with geometry, the running drive with the rows."""

import dataclasses

import numpy as np
import pytest

from hexatorque.evidence.papers.engine.job import Job
from hexatorque.evidence.papers.paper_a import virtual_vectors

ANGLE = np.deg2rad([0, 30, 120, 150, 240, 270])
BITS = np.array([[w >> b & 1 for b in range(5, -1, -1)] for w in range(64)])
AB = BITS @ np.exp(1j * ANGLE) / 3


@pytest.fixture(scope="module")
def figure(job):
    return virtual_vectors.a_t2(job)


def test_rows_are_three_consecutive_large_vectors(figure):
    for k, row in enumerate(figure.metrics["words"]):
        assert abs(AB[list(row)]) == pytest.approx(2 / 3 * np.cos(np.deg2rad(15)))
        angle = np.rad2deg(np.angle(AB[list(row)] * np.exp(-1j * np.deg2rad(15 + 30 * k))))
        assert angle == pytest.approx([-30, 0, 30])


def test_running_drive_applies_rows_that_do_what_was_asked(figure):
    """The test uses only the sign of the torque: the middle vector leads or lags the flux's sector
    accordingly, by at most 105 degrees."""
    assert not any(v.broken for v in figure.verdicts)
    rec = figure.recordings[""]
    words = np.array([rec[f"s{n}"] for n in (1, 2, 3)]).T
    rows = {tuple(row) for row in figure.metrics["words"]}
    level, sector = rec["torque_level"][:-1], rec["sector"][:-1]
    asked = np.flatnonzero(level)
    assert len(asked) > 1000
    for n in asked:
        assert tuple(words[n + 1]) in rows
        lead = np.angle(AB[words[n + 1, 1]] * np.exp(-1j * np.deg2rad(30 * sector[n])))
        assert np.sign(lead) == level[n] and abs(np.rad2deg(lead)) < 106
    assert figure.metrics["periods_in_run"] == [
        int((words == row).all(axis=1).sum()) for row in figure.metrics["words"]
    ]


def test_a_period_that_is_no_row_breaks_the_verdict(tmp_path, monkeypatch):
    setup, rec = virtual_vectors._fdr_run(Job(True, tmp_path))
    rec = dataclasses.replace(rec, channels={k: v.copy() for k, v in rec.channels.items()})
    first = np.flatnonzero(rec["torque_level"])[5] + 1
    rec["s3"][first] ^= 1
    monkeypatch.setattr(virtual_vectors, "_fdr_run", lambda job: (setup, rec))
    broken = [v.what for v in virtual_vectors.a_t2(Job(True, tmp_path)).verdicts if v.broken]
    assert broken == ["FDR running: active periods that are one of the rows"]


def test_picture(figure, tmp_path):
    assert figure.draw(tmp_path / "figure.png").stat().st_size > 30_000
