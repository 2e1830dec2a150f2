"""The list of proofs, the copy of the firmware that ESBMC reads, and how a run is judged. The
proofs themselves are run by `make prove`."""

import dataclasses
import re
import sys
from pathlib import Path

import numpy as np
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
    text = proof.bug.path().read_text()
    assert proof.bug.file.endswith((".c", ".h"))
    assert text.count(proof.bug.right) == 1
    assert proof.bug.right != proof.bug.wrong


def result(proof, verdict, seconds):
    """Of a proof that finds its bug."""
    return prove.Row(
        proof, prove.Outcome(verdict, seconds, ""), prove.Outcome(prove.WRONG, 1.0, "")
    )


def test_the_data_have_a_row_for_every_proof_and_the_page_each_that_is_open():
    kept = prove.doc_page.read_data(prove.PAGE, "proofs")[1:]
    assert prove.table(PROOFS, [], kept) == kept
    page = prove.PAGE.read_text()
    for row in kept:
        of, says = (row[k].replace("|", "\\|") for k in prove.SHOWN)
        assert (f"| `{of}` | {says} |" in page) == (row[-1] == prove.OPEN)
    proved = sum(row[-1] != prove.OPEN for row in kept)
    assert f"{proved} of {len(kept)} are proved" in page


def test_a_proof_without_a_run_is_open():
    first, second, third = PROOFS[:3]
    some = [result(first, prove.PROVED, 0.5), result(second, prove.PROVED, 3.2)]
    some.append(result(third, prove.TIME, 60.0))
    old = prove.table(PROOFS[:3], some)
    assert [row[-1] for row in old] == ["< 1", "3", "open"]
    assert prove.table(PROOFS[:3], [], old) == old
    changed = dataclasses.replace(first, inputs="others")
    assert prove.table([changed, second], [], old) == [[*prove.cells(changed), "open"], old[1]]


def judged(monkeypatch, script):
    """The verdict on a program in ESBMC's place."""
    monkeypatch.setattr(prove, "command", lambda proof, first: [sys.executable, "-c", script])
    return prove.run(PROOFS[0], ROOT).verdict


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


CALCULATES = """float f(float a, float b, const float *p);
static float twice(float a)
{
    return a * 2.0f;
}

float f(float a, float b, const float *p)
{
    static const float third = 1.0f / 3.0f;
    float c = a * b + third;
    unsigned n = (unsigned)(a - b);
    c -= p[n + 1u] / b;
    return (a < b) ? twice(c) : -c;
}
"""


def test_free_arithmetic_keeps_its_operands(tmp_path):
    """They may have checks of their own. Integers, comparisons and constants stay."""
    pytest.importorskip("clang.cindex", reason="libclang is missing: pip install libclang==18.1.1")
    source = tmp_path / "calculates.c"
    source.write_text(CALCULATES)
    text, _ = prove.checked(source, CALCULATES, free=["f"])
    assert "float c = ht_free_add(ht_free_multiply(a, b), third);" in text
    assert "(unsigned)ht_in_uint16((ht_free_subtract(a, b)))" in text
    assert "c = ht_free_subtract(c, ht_free_divide(p[n + 1u], b));" in text
    assert "third = 1.0f / 3.0f" in text and "a * 2.0f" in text and "(a < b)" in text
    text, _ = prove.checked(source, CALCULATES, free=["f:*"])
    assert "ht_free_multiply(a, b) + third" in text and "c -= p[n + 1u] / b" in text
    text, _ = prove.checked(source, CALCULATES, free=["f:+-*/:n,c"])
    assert "c = a * b + third" in text and "(a - b)" in text and "ht_free_divide(" in text
    assert "ht_free_multiply(a, 2.0f)" in prove.checked(source, CALCULATES, free=[""])[0]
    with pytest.raises(SystemExit, match="no arithmetic to free in g"):
        prove.checked(source, CALCULATES, free=["g"])


def test_a_promised_function_is_called_in_the_harness(tmp_path):
    pytest.importorskip("clang.cindex", reason="libclang is missing: pip install libclang==18.1.1")
    source = tmp_path / "calculates.c"
    source.write_text(CALCULATES)
    text, _ = prove.checked(source, CALCULATES, promised=["twice"])
    assert "static float promise_twice(float a);\nstatic float twice(float a)" in text
    assert "(a < b) ? promise_twice(c) : -c" in text
    with pytest.raises(SystemExit, match="thrice is not called there"):
        prove.checked(source, CALCULATES, promised=["thrice"])


def test_rounding_keeps_the_order():
    """The facts of tests/prove/arithmetic.h that no proof shows, on numbers of every size and on
    neighbours."""
    rng = np.random.default_rng(1)
    bits = rng.integers(0, 0x7F7FFFFF, 1_000_000, dtype=np.uint32)
    a = np.concatenate([bits, [0, 1, 0x007FFFFF, 0x00800000, 0x7F7FFFFF]]).astype(np.uint32)
    a = a.view(np.float32)
    b = rng.permutation(a)
    share = (b / np.float32(3.4028235e38)).astype(np.float32)
    with np.errstate(over="ignore", under="ignore", invalid="ignore", divide="ignore"):
        assert np.all(share * a <= a)
        large = np.maximum(b, np.float32(1.0))
        assert np.all(a / large <= a)
        beside = np.nextafter(a, np.float32(np.inf))
        for larger in (beside, np.maximum(a, b)):
            smaller = np.minimum(a, larger)
            assert np.all(smaller * smaller <= larger * larger)
            assert np.all(smaller * b <= larger * b)
