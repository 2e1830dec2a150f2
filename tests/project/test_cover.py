"""What the coverage and mutation tools make of what they are told. The tools themselves are run by
`make coverage` and `make mutate`."""

import multiprocessing

import cover
import mutants
import mutate
import mutate_python
import pytest


def told(branches=(), decisions=()):
    """As clang tells a file: line, ..., times true, times false; line, ..., conditions shown."""
    return {
        "filename": str(cover.ROOT / "firmware" / "core" / "ht_duty.c"),
        "branches": [[line, 1, line, 9, *taken, 0, 0, 4] for line, *taken in branches],
        "mcdc_records": [[line, 1, line, 9, *rest] for line, *rest in decisions],
    }


def test_what_is_missed_is_named_once_a_line():
    file = told(
        branches=[(10, 5, 0), (11, 0, 3), (12, 2, 2), (13, 0, 0), (21, 1, 0)],
        decisions=[(11, [True, False]), (12, [True, True])],
    )
    found = cover.misses(file, lines=[20, 21, 30])
    assert [(m.line, m.what) for m in found] == [
        (10, "never false"),
        (11, "MC/DC, never true"),
        (20, "not run"),
        (30, "not run"),
    ]


def test_every_miss_needs_a_reason_and_every_reason_a_miss():
    miss = cover.Miss("core/ht_duty.c", 3, "not run")
    fits = cover.Reason(miss.file, cover.code_of(miss), "because")
    stale = cover.Reason(miss.file, "no such line", "because")
    assert cover.explained([miss], [fits]) == ([(miss, "because")], [])
    _, wrong = cover.explained([miss], [stale])
    assert len(wrong) == 2 and "no reason" in wrong[0] and "covered" in wrong[1]


def test_a_reason_is_that_of_a_line_in_the_code():
    for reason in cover.reasons():
        lines = (cover.ROOT / "firmware" / reason.file).read_text().splitlines()
        assert reason.code in [line.strip() for line in lines], reason


@pytest.mark.parametrize(
    "covered, count, text", [(2, 2, "100 % of 2"), (1999, 2000, "99.9 % of 2000"), (0, 0, "–")]
)
def test_only_all_is_100_percent(covered, count, text):
    assert cover.percent(covered, count) == text


def test_time_outs_and_equivalent_mutants_are_not_kills():
    def result(n, verdict):
        return mutants.Result(mutants.Mutant("core/ht_duty.c", n, f"a{n}", f"b{n}"), verdict, "")

    verdicts = ("killed", "time-out", "alive", "alive", "unbuilt", "same")
    results = [result(n, verdict) for n, verdict in enumerate(verdicts)]
    known = {mutants.Mutant("core/ht_duty.c", 0, "a2", "b2"): "equivalent: it is the same"}
    rooms, left = mutants.tables(results, known, ("core", "app"))
    assert rooms[0] == ["core", "4", "1", "1", "1", "1", "33.3 %"]
    assert rooms[1] == ["app", "0", "0", "0", "0", "0", "–"]
    assert rooms[2][:2] == ["**all**", "4"]
    assert [row[-1] for row in left] == ["time-out", "equivalent: it is the same", "–"]
    page = mutants.page_of(rooms, "a file")
    assert "| core | 4 | 1 | 1 | 1 | 1 | 33.3 % |" in page and "a file" in page


def test_a_verdict_lasts_as_long_as_what_it_depends_on(tmp_path, monkeypatch):
    """A kill: the source and the test. A mutant that lives: the source and all tests. One that only
    the first tests have seen is judged again, and counts as alive until then."""
    monkeypatch.setattr(mutants, "ROOT", tmp_path)
    monkeypatch.setattr(mutants, "WORK", tmp_path)
    for name in ("source/a.c", "tests/test_one.py", "tests/test_two.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)

    def book():
        return mutants.Book(mutate.FIRMWARE, mutants.States("source", "tests"))

    rows = {
        "one": (mutants.KILLED, "tests/test_one.py::test_a"),
        "two": (mutants.KILLED, "tests/test_two.py::test_b[1]"),
        "lives": (mutants.ALIVE, ""),
        "so far": (mutants.ALIVE, mutants.FIRST),
        "no C": (mutants.UNBUILT, ""),
    }
    first = book()
    for text, verdict in rows.items():
        mutant = mutants.Mutant("core/a.c", 1, "right", text)
        first.done[mutant] = mutants.Result(mutant, *verdict)
    first.save()
    assert {m.wrong for m in book().done} == rows.keys() - {"so far"}
    (tmp_path / "tests/test_one.py").write_text("changed")
    assert {m.wrong for m in book().done} == {"two", "no C"}
    assert {m.wrong for m in book().alive_so_far} == {"so far"}
    (tmp_path / "source/a.c").write_text("changed")
    assert not book().done


def test_what_a_compiler_would_refuse_is_known_without_one():
    for text in ("x = (2+1)u;", "y = 0.(3-1)f;", "z = 1.-1f;", "uint-1_t n;", "int0_t k;"):
        assert mutate.NEVER_C.search(text), text
    for path in (mutants.ROOT / "firmware").rglob("*.c"):
        assert not mutate.NEVER_C.search(path.read_text()), path


def test_a_text_for_the_reader_has_no_meaning():
    code = '"""What it does."""\ndef f(x):\n    """More."""\n    return x + 1  # one\n'
    assert mutate_python.meaning(code.replace("More", "Less")) == mutate_python.meaning(code)
    assert mutate_python.meaning(code.replace("one", "two")) == mutate_python.meaning(code)
    assert mutate_python.meaning(code.replace("+ 1", "- 1")) != mutate_python.meaning(code)
    assert mutate_python.meaning(code.replace("+ 1", "+* 1")) is None


def test_a_module_as_it_is_lives_and_a_wrong_one_is_killed(tmp_path):
    """The process that runs the tests of a changed module names the test that fails."""
    multiprocessing.set_forkserver_preload(mutate_python.LOADED)
    bench = mutate_python.Bench(0)
    bench.folder = tmp_path / "mutant"
    file = "analysis/response.py"
    right = (mutate_python.PYTHON.base / file).read_text()
    verdict, by = bench.tested(file, right, True)
    assert verdict == mutants.ALIVE, (bench.folder / "log.txt").read_text()
    verdict, by = bench.tested(file, right.replace("return ", "return None and "), True)
    assert verdict == mutants.KILLED
    assert by.startswith("tests/host/analysis/test_response.py::")
