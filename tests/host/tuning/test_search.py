"""The study of a tuning, on objectives whose optimum is known."""

import math
import statistics

import pytest

from hexatorque.setups import SetupError
from hexatorque.tuning import search
from hexatorque.tuning.search import Judged, open_study
from hexatorque.tuning.space import Knob

optuna = pytest.importorskip("optuna")

KNOBS = [Knob("band", 1.0, 0.25, 4.0, log=True), Knob("kappa", 0.5, 0.0, 1.0, log=False)]
BEST = {"band": 2.0, "kappa": 0.8}
TRIALS = 40


def bowl(values):
    """Its only minimum is at BEST. A band above 3.5 loses an operating point."""
    if values["band"] > 3.5:
        return Judged(search.LOST, {"lost": "tripped"})
    away = math.log(values["band"] / BEST["band"]), values["kappa"] - BEST["kappa"]
    return Judged(math.hypot(*away), {"lost": ""})


def run(study, judge=bowl, trials=TRIALS, **more):
    return search.search(study, KNOBS, judge, trials, seed=3, **more)


@pytest.fixture(scope="module")
def whole():
    return run(open_study(None, {}, False))


def test_the_optimum_is_found(whole):
    """A circle of 0.1 around it is 1.1 % of the space: 40 random draws miss it in 64 % of cases.
    The study learns: its last candidates are better than those that it draws at random first."""
    assert [one.number for one in whole] == list(range(TRIALS))
    assert whole[0].values == {"band": 1.0, "kappa": 0.5}
    best = min(whole, key=lambda one: one.aim)
    assert best.aim < 0.1
    aims = [one.aim for one in whole]
    assert statistics.median(aims[-15:]) < 0.7 * statistics.median(aims[1 : search.AT_RANDOM])


def test_the_number_of_workers_does_not_matter(whole):
    assert run(open_study(None, {}, False), jobs=3) == whole


def test_another_seed_tries_others(whole):
    other = search.search(open_study(None, {}, False), KNOBS, bowl, 4, seed=4)
    assert other[0].values == whole[0].values
    assert all(a.values != b.values for a, b in zip(other[1:], whole[1:]))


@pytest.mark.parametrize("calls", (1, 13, 16))
def test_an_interrupted_study_goes_on_as_if_nothing_had_been(calls, tmp_path, whole):
    file, left = tmp_path / "study.journal", [calls]

    def dies(values):
        if left[0] == 0:
            raise KeyboardInterrupt
        left[0] -= 1
        return bowl(values)

    with pytest.raises(KeyboardInterrupt):
        run(open_study(file, {"seed": 3}, False), dies)
    with file.open("a") as journal:
        journal.write('{"op_code":5,"worker')  # killed while it wrote
    judged = []

    def counted(values):
        judged.append(values)
        return bowl(values)

    assert run(open_study(file, {"seed": 3}, True), counted) == whole
    assert len(judged) == TRIALS - calls  # nothing is simulated twice
    assert run(open_study(file, {"seed": 3}, True), dies) == whole  # nor is anything again


def test_a_study_is_not_mixed_with_another(tmp_path):
    file = tmp_path / "study.journal"
    with pytest.raises(SetupError, match="no study"):
        open_study(file, {}, True)
    open_study(file, {"seed": 1, "points": [[1000.0, 5.0]]}, False)
    with pytest.raises(SetupError, match="is there already; --resume"):
        open_study(file, {"seed": 1}, False)
    with pytest.raises(SetupError, match=r"another study, which differs in points; -o"):
        open_study(file, {"seed": 1, "points": [[900.0, 5.0]]}, True)
    for text in ("my notes\n", '{"a": 1}\n', "[]\n"):
        file.write_text(text)
        with pytest.raises(SetupError, match="not a study of"):
            open_study(file, {}, True)
