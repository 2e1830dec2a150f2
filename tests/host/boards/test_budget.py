"""The budget: its numbers are right, and its limits hold."""

import copy
import json
import re
import subprocess
from pathlib import Path

import pytest

from hexatorque import firmware
from hexatorque.boards import emulator_process, tools
from hexatorque.cli.main import main
from hexatorque.evidence.cost import budget, count, stack

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def measured(paper_a, need):
    need("mps2-an386")
    return budget.measure(paper_a)


def test_within_limits(measured):
    assert budget.exceeded(measured, budget.limits()) == []


def test_every_limit_can_be_exceeded(measured):
    """Each number in turn is set just above its limit, which must fail."""
    limit = budget.limits()
    machine = limit["mps2-an386"]
    cases = [(("mps2-an386", s, kind), machine[kind][s] + 1, f"{s}, {kind} instructions")
             for kind in ("mean", "max") for s in machine[kind]]  # fmt: skip
    cases += [(("mps2-an386", f"{what}_bytes"), machine[f"{what}_bytes"] + 4, f"{what}, bytes")
              for what in ("stack", "image")]  # fmt: skip
    cases += [(("mps2-an386", "library_calls"), ["memcpy"], "calls memcpy")]
    cases += [(("sizes", target, what), most + 1, f"{target}, {what}")
              for target, rows in limit["sizes"].items() for what, most in rows.items()
              if target in measured["sizes"]]  # fmt: skip
    cases += [(("mps2-an386", "magnets", s, "max"), machine["longest"][s] + 1, f"{s}, longest")
              for s in measured["mps2-an386"]["magnets"]]  # fmt: skip
    cases += [(("mps2-an386", "placed", n, "max"), machine["longest"][s] + 1, f"{s}, longest")
              for n, s in enumerate(("smooth", "clean"))]  # fmt: skip
    cases += [(("c28x_estimate", s, "high_cycles"), most + 1, f"{s}, C28x cycles")
              for s, most in limit["c28x_cycles"].items()]  # fmt: skip
    assert {s for s in machine["mean"]} == {s for s in machine["max"]} == set(firmware.schemes())
    for path, value, said in cases:
        changed = copy.deepcopy(measured)
        place = changed
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
        assert any(said in line for line in budget.exceeded(changed, limit)), path
    changed = copy.deepcopy(measured)
    changed["mps2-an386"]["fdr"]["mean"] = measured["mps2-an386"]["ddr"]["mean"] / 1.26
    assert any("ddr over fdr" in line for line in budget.exceeded(changed, limit))


def test_published_page_is_current(measured):
    """docs/budget.json is current, except for numbers that depend on the host's compiler."""
    published = json.loads((ROOT / "docs/budget.json").read_text())
    if published["compiler"] != measured["compiler"]:
        pytest.skip(f"published with {published['compiler']}")
    for key in ("mps2-an386", "c28x_estimate", "setup"):
        assert published[key] == measured[key], "run `make budget`"
    page = (ROOT / "docs/budget.md").read_text()
    for scheme in firmware.schemes():
        row = measured["mps2-an386"][scheme]
        assert re.search(rf"^\| {scheme} \| {row['mean']:.0f} \|.* {row['max']} \|", page, re.M)
    for row in measured["mps2-an386"]["placed"]:
        assert f"{row['mean']:.0f}" in page and str(row["max"]) in page


def test_positions_and_sets_that_decide_together_take_instructions(measured):
    """Paper A's point is at a tenth of V_dc, where no pulse moves; at one end of the knob both sets
    decide in every second interrupt, and none in the others."""
    machine = measured["mps2-an386"]
    smooth, clean = machine["placed"]
    assert smooth["mean"] > machine[budget.PLACING]["mean"] + 50
    assert clean["mean"] < smooth["mean"] and clean["max"] > smooth["max"] + 200


def test_an_image_without_xcp_has_none_of_it(need):
    """The drive alone has no function, no data and no text of XCP, and the image with XCP has."""
    need("mps2-an386")
    folder = tools.build(emulator_process.MACHINES["mps2-an386"], "count", "board")
    found = {}
    for image in ("count", "board"):
        listed = subprocess.run(
            ["arm-none-eabi-nm", folder / count.IMAGE.with_name(image)],
            capture_output=True, text=True,
        )  # fmt: skip
        assert listed.returncode == 0, listed.stderr
        found[image] = [line for line in listed.stdout.splitlines() if "xcp" in line.lower()]
    assert found["count"] == []
    assert len(found["board"]) > 20


def test_counts_repeat(paper_a, tmp_path, need):
    need("mps2-an386")
    runs = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        runs.append(count._replay(paper_a, "mps2-an386", tmp_path / name)["isr"])
    assert (runs[0] == runs[1]).all()


def test_count_against_the_log_of_instructions(paper_a, tmp_path, need):
    """Two ways to count: the emulator's clock, and its list of executed instructions, in
    the same interrupts."""
    need("mps2-an386")
    counts = count._replay(paper_a, "mps2-an386", tmp_path)["isr"]
    every = len(counts) // (2 * count.SAMPLES)
    sampled = [n for n in range(len(counts) - every * count.SAMPLES, len(counts))
               if (n + 1) % every == 0]  # fmt: skip
    _, executed = count.executed(paper_a)
    assert executed.total() / count.SAMPLES == pytest.approx(counts[sampled].mean(), abs=3)


def test_stack_used_is_within_the_computed_one(measured):
    """The bytes that were overwritten on a filled stack, compared with the compiler's numbers. Both
    contain the deepest path."""
    row = measured["mps2-an386"]
    computed = row["stack"]["fast interrupt"]["bytes"]
    assert 0.8 * computed <= row["stack_used_bytes"] <= computed


def test_stack_of_a_path_is_the_sum_of_its_functions(measured):
    """By the compiler's own files, each function's largest entry. A function that jumps to the next
    one as its last act has given its bytes back."""
    folder = tools.build(emulator_process.MACHINES["mps2-an386"], "count")
    objects = tools.objects(folder, "ht_core", "count").values()
    files = stack.usage_files(folder / count.IMAGE, objects)
    text = "".join(file.read_text() for file in files)
    graph = stack.call_graph(folder / count.IMAGE, objects)
    jumps = {(f.name, graph[to].name) for f in graph.values() for to in f.jumps}
    for row in measured["mps2-an386"]["stack"].values():
        total = 0
        for name, following in zip(row["path"], [*row["path"][1:], ""]):
            if (name, following) in jumps:
                continue
            # The compiler lists part of a function by its full name, a clone without its number.
            for listed in (name, re.sub(r"[.][0-9]+$", "", name)):
                if found := re.findall(rf":{re.escape(listed)}\t(\d+)\t", text):
                    break
            total += max(map(int, found), default=0)
        assert row["bytes"] == total


def test_compiled_across_files(measured):
    """Compiling across files gives fewer instructions and a larger image. The counted image was
    compiled in this way."""
    row = measured["mps2-an386"]
    by_file = measured["c28x_estimate"]["ddr"]
    assert row["ddr"]["mean"] < 0.8 * (by_file["branches"] + by_file["other_instructions"])
    assert row["image_bytes"] > row["image_by_file_bytes"]
    assert measured["options"] == "-O3 -flto"


def test_call_graph(tmp_path, need):
    """A small program with a known call graph: main calls a, a calls b, and c is called through a
    pointer."""
    need("mps2-an386")
    source = tmp_path / "small.c"
    source.write_text(
        "#include <string.h>\n"
        "__attribute__((noinline)) int b(volatile int *x)"
        " { volatile int big[50]; big[3] = *x; return big[3]; }\n"
        "__attribute__((noinline)) int a(volatile int *x) { return b(x) + 1; }\n"
        "__attribute__((noinline)) int c(int (*f)(volatile int *), volatile int *x)"
        " { return f(x) + 2; }\n"
        "__attribute__((noinline)) void d(char *to, const char *from, unsigned n)"
        " { memcpy(to, from, n); }\n"
        "__attribute__((noinline)) int e(volatile int *x)"
        " { volatile int big[40]; big[3] = *x; *x = big[3]; return b(x); }\n"
        'int main(void) { volatile int x = 1; char t[9]; d(t, "1234", (unsigned)x);\n'
        "  return a(&x) + c(b, &x) + e(&x) + t[0]; }\n"
        "void _exit(int n) { for (;;) (void)n; }\n"
    )
    build = ["arm-none-eabi-gcc", "-O1", "-foptimize-sibling-calls", "-mcpu=cortex-m4", "-mthumb"]
    tools.run([*build, "-fstack-usage", "-c", source], tmp_path)
    tools.run(
        [*build, "--specs=nano.specs", "-nostartfiles", "small.o", "-o", "small.elf"], tmp_path
    )
    graph = stack.call_graph(tmp_path / "small.elf", [tmp_path / "small.o"])
    size, path = stack.deepest(graph, "a")
    assert path == ["a", "b"]
    own = {function.name: function.own_bytes for function in graph.values()}
    assert 200 <= own["b"] <= 216
    assert size == own["a"] + own["b"]
    # e has given its own bytes back when it jumps to b.
    assert own["e"] >= 160
    assert stack.deepest(graph, "e") == (own["b"], ["e", "b"])
    assert stack.library_calls(graph, "a") == set()
    assert stack.library_calls(graph, "d") == {"memcpy"}
    assert stack.library_calls(graph, "main") == {"memcpy", "?"}
    with pytest.raises(RuntimeError, match="through a pointer"):
        stack.deepest(graph, "main")


def test_profile_adds_up(paper_a, need):
    need("mps2-an386")
    profile = count.profile(paper_a)
    totals = {kind: sum(n for _, n in rows) for kind, rows in profile.items()}
    assert len(set(round(t, 6) for t in totals.values())) == 1
    assert "ht_control_step" in dict(profile["symbol"])
    assert {"ht_control_step", "ht_volt_seconds"} <= dict(profile["function"]).keys()


def test_command(measured, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(budget, "measure", lambda setup, progress=None: measured)
    assert main(["evidence", "budget", "--json", "-o", str(tmp_path)]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((tmp_path / "budget.json").read_text())
    for scheme in firmware.schemes():
        row = printed["mps2-an386"][scheme]
        assert 0 < row["mean"] <= row["max"]
    most = budget.limits()["mps2-an386"]["stack_bytes"]
    assert 0 < printed["mps2-an386"]["stack_bytes"] <= most
    assert main(["evidence", "budget", "--profile", "ddr"]) == 0
    assert "ht_control_step" in capsys.readouterr().out
