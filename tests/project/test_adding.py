"""CONTRIBUTING.md shows how to add a law, a scheme, a chip, a machine model, a kind of rotor and a
study: each is a patch in tests/project/patches. Here all six are applied to a copy of the tree,
which is built and tried.

The copy's plant is not compiled (NUMBA_DISABLE_JIT=1): that takes longer than a short simulation
without it.
"""

import json
import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from ccs_projects import CMAKE, NINJA, ROOT
from stand_in_compiler import configure, needs_cmake, stand_ins

PATCHES = ROOT / "tests" / "project" / "patches"
#: Patch -> the most files with code that it may touch.
MOST = {"law": 6, "scheme": 3, "chip": 4, "machine_model": 2, "kind": 6, "study": 2}
#: Files without code: settings of the build, and pages.
NO_CODE = (".json", ".md")
SETUP = """
setup = "paper-a-feasible"
[machine]
model = "induction-fan"
[timing]
device = "f28333"
[controller]
scheme = "fdr-ml"
control_mode = "torque"
torque_ref_Nm = 3.0
dead_time_us = 2.0
calibration_s = 0.005
build_s = 0.05
"""
#: A row for the end of a table of firmware/app, which is all that a new one takes. bit: the first
#: free one; next: the number of the rows, and one more.
ROWS = {
    "ht_faults.def": 'HT_FAULT(DOOR, {bit}u, "door open", "of the cabinet")',
    "ht_limits.def": 'HT_LIMIT(FAN, {bit}, "fan off", "of the cabinet")',
    "ht_events.def": 'HT_EVENT(DOOR, {next}, "door closed", "of the cabinet")',
    "ht_states.def": 'HT_STATE(HOLD, 6, "hold", HT_AT_WORK | HT_GATES_ON)',
    "ht_warnings.def": 'HT_WARNING(DOOR, {bit}, "door ajar", "of the cabinet")',
    "ht_results.def": 'HT_RESULT(DOOR, 15, 1, "the door is open in state {state}")',
    "ht_misfits.def": "HT_ORDER(FLUX_BAND, flux_band_Wb, 0.5f, flux_ref_Wb, 1)",
    "ht_sets.def": 'HT_SET(FACTORY, 4, "of the factory")',
}
GIT = shutil.which("git")

pytestmark = [
    needs_cmake,
    pytest.mark.skipif(not (GIT and (ROOT / ".git").exists()), reason="git, a checkout"),
]


def patch(name: str) -> Path:
    return PATCHES / f"{name}.patch"


def touched(name: str) -> list[str]:
    """The files that a patch changes or makes."""
    return re.findall(r"^\+\+\+ b/(.*)$", patch(name).read_text(), re.M)


def code(name: str) -> list[str]:
    return [file for file in touched(name) if not file.endswith(NO_CODE)]


def environment(tree: Path) -> dict[str, str]:
    """Python finds the copy's package."""
    return {
        **os.environ, "PYTHONPATH": str(tree / "host"), "NUMBA_DISABLE_JIT": "1",
        "COLUMNS": "200",
    }  # fmt: skip


def run(tree: Path, *command: str | Path) -> subprocess.CompletedProcess:
    """Run a step in the copy."""
    done = subprocess.run(command, cwd=tree, env=environment(tree), capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """A copy of the checkout with all six patches. Each alone fits as well."""
    folder = tmp_path_factory.mktemp("tree")
    listed = run(ROOT, GIT, "ls-files", "-z", "--cached", "--others", "--exclude-standard").stdout
    for name in listed.strip("\0").split("\0"):
        if (ROOT / name).is_file():  # a deleted file is still listed
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)
    for name in MOST:
        run(folder, GIT, "apply", "--check", patch(name))
    for name in MOST:
        run(folder, GIT, "apply", patch(name))
    for table, row in ROWS.items():
        path = folder / "firmware" / "app" / table
        text, end = path.read_text(), "#endif\n"  # the last faults are no enumerators
        rows = len(re.findall(r"^HT_", text, re.M))
        row = row.replace("{bit}", hex(1 << rows)).replace("{next}", str(rows + 1))
        text = f"{text.removesuffix(end)}{row}\n{end if text.endswith(end) else ''}"
        path.write_text(text)
    return folder


@pytest.fixture(scope="module")
def built(tree):
    """The copy with its firmware compiled, quickly: no optimisation."""
    run(tree, CMAKE, "-S", ".", "-B", "build/module", "-G", "Ninja",
        f"-DCMAKE_MAKE_PROGRAM={NINJA}", "-DCMAKE_BUILD_TYPE=Debug", "-DHT_PYTHON_MODULE=ON",
        f"-DPython_EXECUTABLE={sys.executable}",
        f"-DCMAKE_LIBRARY_OUTPUT_DIRECTORY={tree / 'host/hexatorque'}")  # fmt: skip
    run(tree, CMAKE, "--build", "build/module")
    where = run(tree, sys.executable, "-c", "import hexatorque._firmware as m; print(m.__file__)")
    assert Path(where.stdout.strip()).is_relative_to(tree)
    return tree


@pytest.fixture(scope="module")
def found(built):
    """A drive with the new scheme and one with the new law, on the new chip, with the new machine
    model."""
    setup = built / "mine.toml"
    setup.write_text(SETUP)
    script = built / "tests" / "project" / "tried_additions.py"
    return json.loads(run(built, sys.executable, script, setup).stdout)


@pytest.mark.parametrize("name", MOST)
def test_few_files(name):
    assert 1 < len(code(name)) <= MOST[name]


def test_law(built, found):
    """Its scheme is listed, needs prediction, and makes the torque that is asked for. The modulator
    makes one toggle a leg and period, so the law commands a voltage. No mean voltage in x-y but for
    what the dead time takes, up to 2 % of a leg's."""
    assert found["schemes"][-2:] == ["flux-pi", "fdr-ml"]
    assert found["predicted"]["flux-pi"] and not found["predicted"]["fdr-ml"]
    drive = found["law"]
    assert (drive["state"], drive["faults"], drive["scheme"]) == ("run", [], "flux-pi")
    assert drive["torque_Nm"] == pytest.approx(3.0, abs=0.3) and drive["speed_rpm"] > 1
    assert drive["most_toggles"] == 1
    assert all(value < 0.03 for value in drive["xy_pu"])


def test_scheme(built, found):
    """It is listed, and it does what its words say. Three vectors that are 30 degrees apart in
    alpha-beta and 150 degrees in x-y, each of length sqrt(2)/3: with the shares that leave nothing
    in x-y, the mean has the length below. A dead time takes up to 2 % of a leg's voltage."""
    assert found["schemes"][-1] == "fdr-ml"
    assert "fdr-ml" in run(built, sys.executable, "-m", "hexatorque", "setups", "--schemes").stdout
    drive = found["running"]
    assert (drive["state"], drive["faults"], drive["scheme"]) == ("run", [], "fdr-ml")
    assert drive["torque_Nm"] == pytest.approx(3.0, abs=0.3) and drive["speed_rpm"] > 1
    side = 1 / (2 + math.sqrt(3))
    length = math.sqrt(2) / 3 * 2 * math.sqrt(3) * side
    active = [value for value in drive["main_pu"] if value > 0.1]
    assert len(active) > 20
    assert all(0.96 * length < value < 1.01 * length for value in active)
    assert all(value < 0.02 for value in drive["xy_pu"])


def test_chip(tree, found, tmp_path):
    """Its registers after the start are what its clock asks for: 30 MHz times 6, divided by 2.
    The model of the chip has counted no access that the chip would refuse."""
    assert found["devices"][-1] == "f28333"
    drive = found["running"]
    assert drive["violations"] == 0 and drive["interrupts"] == 800
    clock_Hz = 30e6 * drive["registers"]["7021"] / 2
    assert clock_Hz == 90e6
    assert drive["registers"]["6805"] + 1 == clock_Hz / 10e3  # TBPRD
    assert drive["registers"]["6810"] == round(2e-6 * clock_Hz)  # DBRED
    divider = drive["registers"]["7053"] + 1  # SCILBAUD
    assert clock_Hz / 2 / 8 / divider == pytest.approx(921600, rel=0.02)
    # Its image: the preset configures, and the images get its board and memories.
    stand_ins(tmp_path)
    done = configure(tree, "f28333", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    commands = run(tree, NINJA, "-C", "build/f28333", "-t", "commands").stdout
    linked = re.findall(r"output_file=(hexatorque_\S+_flash\.out).*?(\w+_flash\.cmd)", commands)
    assert set(linked) == {
        ("hexatorque_f28333_flash.out", "f28335_flash.cmd"),
        ("hexatorque_f28333_pil_flash.out", "f28335_flash.cmd"),
    }
    assert "HT_BOARD=ht_board_f28333" in commands
    # No one has said where in its flash parameters may be kept.
    done = configure(tree, "f28333", tmp_path, f"-DHT_FLASH_API={tmp_path}")
    assert done.returncode != 0
    assert "an image for the f28333 keeps no parameters" in " ".join(done.stderr.split())


def test_machine_model(found):
    """Without gate pulses only friction B w and the fan k w^2 slow the machine down:
    1/w + k/B grows as exp(B t/J). The same for the slope that is integrated under currents."""
    coasting = found["coasting"]
    fan_Nms2, viscous_Nms = 2e-5, coasting["viscous_Nms"]
    assert viscous_Nms > 0
    begin = coasting["from_rad_s"]
    brake_Nm = viscous_Nms * begin + fan_Nms2 * begin**2
    slope_rad_s2 = -brake_Nm / coasting["inertia_kgm2"]
    assert coasting["slope_rad_s2"] == pytest.approx(slope_rad_s2, rel=1e-9)
    growth = math.exp(viscous_Nms * coasting["time_s"] / coasting["inertia_kgm2"])
    ratio = fan_Nms2 / viscous_Nms
    end = 1 / ((1 / begin + ratio) * growth - ratio)
    assert begin / growth - end > 0.1  # rad/s: the fan shows
    assert coasting["to_rad_s"] == pytest.approx(end, abs=1e-4 * (begin - end))


def test_kind_of_rotor(found):
    """The set-up's machine model tells the drive its kind. The resistances that the drive uses
    stay as they are configured, and those of an induction machine do not: its R_r is told 30 % too
    small here."""
    solid, induction = found["kinds"]["solid"], found["kinds"]["induction"]
    assert (solid["state"], induction["state"]) == ("run", "run")
    assert (solid["rs"], solid["rr"]) == (1.0, 1.0)
    assert abs(induction["rs"] - 1) > 1e-3
    assert solid["torque_Nm"] == pytest.approx(3.0, abs=0.3)


def test_a_row_of_a_table_is_all(built, found):
    """Python, the command line, the board's dictionary, from which the page learns states and
    faults, and the site's pages know the new row of each table."""
    rows = found["rows"]
    assert rows["state"] == {"name": "hold", "at_work": True, "gates_on": True, "controls": False}
    assert rows["listed"] == {"STATE": "hold", "FAULT": "door open"}
    assert rows["faults"] == ["over-current", "door open"] and rows["limits"] == ["fan off"]
    assert rows["event"] == "door closed" and rows["warnings"] == ["door ajar"]
    assert rows["refused"] == ["start: the door is open in state hold", True]
    assert rows["set"] == "of the factory"
    reason = "flux_band_Wb = 0.5 Wb: allowed is up to 0.5 flux_ref_Wb = 0.3 Wb"
    assert rows["misfit"] == f"parameters do not fit together: {reason}"
    assert rows["set-up"].startswith("controller.flux_band_Wb = 0.5 Wb: allowed is up to 0.5 flux")
    page = run(built, sys.executable, "-c", "import sys; sys.path.insert(0, 'tools');"
               "import site_hook; print(site_hook.channels_page())").stdout  # fmt: skip
    for name in ("door open", "fan off", "door closed", "hold", "door ajar"):
        assert re.search(rf"^\|? *{name} *\|", page, re.M), name
    wrong = built / "wrong.toml"
    wrong.write_text('setup = "paper-b"\n[controller]\nflux_band_Wb = 0.5\n')
    command = ("-m", "hexatorque", "check", wrong)
    done = subprocess.run([sys.executable, *command], cwd=built, env=environment(built),
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 2 and rows["set-up"] in done.stderr


def test_study(built, tmp_path):
    """It runs by its name and knows the chip that was added with it."""
    run(built, sys.executable, "-m", "hexatorque", "evidence", "studies", "pwm-steps",
        "-o", tmp_path)  # fmt: skip
    steps = json.loads((tmp_path / "pwm-steps.json").read_text())["steps"]
    assert {chip: row["counts"] for chip, row in steps.items()} == {
        "f28335": 15000, "f28377s": 10000, "f28333": 9000,
    }  # fmt: skip
    assert (tmp_path / "pwm-steps.png").read_bytes()[:4] == b"\x89PNG"


def section(name: str) -> str:
    """What CONTRIBUTING.md says of a patch: the text under the heading that links to it."""
    page = (ROOT / "CONTRIBUTING.md").read_text()
    link = f"](tests/project/{patch(name).relative_to(PATCHES.parent)})"
    (text,) = [part for part in re.split(r"^#{2,3} ", page, flags=re.M) if link in part]
    return text


@pytest.mark.parametrize("name", MOST)
def test_contributing_shows_the_patch(name):
    """It names every file with code, a new one by its module's name, and each line that it shows
    as added is in the patch."""
    text = section(name)
    for file in map(Path, code(name)):
        new = f"`{file.stem}` in `{file.parent}/`" if not (ROOT / file).exists() else ""
        assert (new or f"`{file}`") in text, file
    (shown,) = re.findall(r"^```diff\n(.*?)^```", text, re.M | re.S)
    lines = shown.splitlines()
    there = patch(name).read_text().splitlines()
    assert any(line.startswith("+") for line in lines)
    for line in lines:
        assert line in there, line
