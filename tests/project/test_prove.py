"""The list of proofs, the copy of the firmware that ESBMC reads, and how a run is judged. The
proofs themselves are run by `make prove`."""

import dataclasses
import re
import sys
from pathlib import Path

import prove
import pytest

ROOT = Path(__file__).resolve().parents[2]
PROOFS = prove.read_proofs()


def test_every_proof_has_a_name_of_its_own():
    names = [proof.name for proof in PROOFS]
    assert sorted(set(names)) == sorted(names)


def test_every_harness_is_listed_and_every_row_has_one():
    found = {
        (path.name, name)
        for path in prove.HARNESSES.glob("*.c")
        for name in re.findall(r"^void prove_(\w+)\(void\)$", path.read_text(), re.M)
    }
    assert found == {(proof.harness, proof.name) for proof in PROOFS}


@pytest.mark.parametrize("proof", PROOFS, ids=lambda proof: proof.name)
def test_a_seeded_bug_changes_the_code(proof):
    """A bug whose text no longer stands in the code, or twice, would be found by nothing."""
    text = (ROOT / "firmware" / proof.bug.file).read_text()
    assert proof.bug.file.endswith(".c")
    assert text.count(proof.bug.right) == 1
    assert proof.bug.right != proof.bug.wrong


def result(proof, verdict, seconds):
    """Of a proof that finds its bug."""
    return prove.Row(
        proof, prove.Outcome(verdict, seconds, ""), prove.Outcome(prove.WRONG, 1.0, "")
    )


def test_the_page_has_a_line_for_every_proof():
    table = prove.PAGE.read_text().split(prove.BEGIN)[1].split(prove.END)[0].strip()
    assert prove.table(PROOFS, [], table).strip() == table


def test_a_proof_without_a_run_is_open():
    first, second, third = PROOFS[:3]
    some = [result(first, prove.PROVED, 0.5), result(second, prove.PROVED, 3.2)]
    some.append(result(third, prove.TIME, 60.0))
    old = prove.table(PROOFS[:3], some)
    assert [line.rsplit("|", 2)[1] for line in old.splitlines()[2:]] == [" < 1 ", " 3 ", " open "]
    assert prove.table(PROOFS[:3], [], old) == old
    changed = dataclasses.replace(first, inputs="others")
    now = prove.table([changed, second], [], old).splitlines()[2:]
    assert now == [f"{prove.cells(changed)}open |", old.splitlines()[3]]


def judged(monkeypatch, script):
    """The verdict on a program in ESBMC's place."""
    monkeypatch.setattr(prove, "command", lambda proof, first: [sys.executable, "-c", script])
    return prove.run(PROOFS[0]).verdict


@pytest.mark.parametrize(
    "script, verdict",
    [
        ("print('VERIFICATION SUCCESSFUL')", prove.PROVED),
        ("print('VERIFICATION SUCCESSFUL'); raise SystemExit(1)", prove.BROKEN),
        ("print('VERIFICATION FAILED'); raise SystemExit(1)", prove.WRONG),
        ("print('VERIFICATION FAILED')", prove.BROKEN),
        ("print('VERIFICATION UNKNOWN')", prove.BROKEN),
        ("print('Out of memory'); raise SystemExit(2)", prove.MEMORY_OUT),
        ("import os, signal; os.kill(os.getpid(), signal.SIGXCPU)", prove.TIME),
    ],
)
def test_only_a_success_with_exit_status_0_is_a_proof(monkeypatch, script, verdict):
    assert judged(monkeypatch, script) == verdict


def test_a_proof_counts_only_if_it_finds_its_bug():
    holds, fails, late = (
        prove.Outcome(v, 1.0, "") for v in (prove.PROVED, prove.WRONG, prove.TIME)
    )
    assert prove.Row(PROOFS[0], holds, fails).good
    assert not prove.Row(PROOFS[0], holds, holds).good
    assert not prove.Row(PROOFS[0], holds, late).good
    assert not prove.Row(PROOFS[0], fails, fails).good


def test_conversions_are_checked_by_type(tmp_path):
    """Of all casts only those from float to integer; an unsigned has 16 bits on the DSP."""
    pytest.importorskip("clang.cindex", reason="libclang is missing: pip install libclang==18.1.1")
    source = tmp_path / "casts.c"
    text = """#include <stdint.h>
typedef struct { float v[2]; } some;
uint16_t a(float f, uint32_t n, const some *p);
uint16_t a(float f, uint32_t n, const some *p)
{
    float g = (float)n;
    uint32_t m = (uint32_t)(f + g);
    unsigned u = (unsigned)f;
    (void)g;
    return (uint16_t)(m + u + (uint16_t)n + (uint16_t)(int16_t)p->v[(uint16_t)g]);
}
"""
    source.write_text(text)
    wrapped, count = prove.checked(source, text)
    assert count == 4
    assert "(uint32_t)ht_in_uint32((f + g))" in wrapped
    assert "(unsigned)ht_in_uint16(f)" in wrapped
    assert "(int16_t)ht_in_int16(p->v[(uint16_t)ht_in_uint16(g)])" in wrapped
    assert "(float)n" in wrapped and "(uint16_t)n" in wrapped and "(void)g" in wrapped
