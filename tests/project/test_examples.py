"""The gallery runs: every notebook from a new kernel, every script from a new process, and
every scenario is one that the program accepts."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from campaigns import part
from site_hook import scenarios, sweeps

from hexatorque import setups
from hexatorque.sweeps import files as sweep_files

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"


def files(kind: str) -> list[Path]:
    found = sorted(EXAMPLES.glob(f"*.{kind}"))
    assert found
    return found


@pytest.mark.parametrize("path", scenarios(), ids=lambda path: path.name)
def test_scenario_is_accepted(path):
    setup = setups.load(path)
    assert setup.profile.duration_s > 0 and setup.title != setup.name, "no title of its own"


@pytest.mark.parametrize("path", sweeps(), ids=lambda path: path.name)
def test_sweep_is_accepted(path):
    """Its runs are made elsewhere: they take half a minute."""
    study = sweep_files.read(path)
    assert len(study) > 1 and study.title != study.setup.title, "no title of its own"


def script(name: str) -> str:
    return subprocess.run(
        [sys.executable, EXAMPLES / name], check=True, capture_output=True, text=True, timeout=300
    ).stdout


def test_wider_band_switches_less_and_ripples_more():
    lines = script("torque_band.py").splitlines()[1:]
    band, f_sw, ripple = zip(*(map(float, line.split()) for line in lines))
    assert len(band) >= 3 and list(band) == sorted(band)
    assert list(f_sw) == sorted(f_sw, reverse=True)
    assert list(ripple) == sorted(ripple)


def test_captured_step_has_the_samples_asked_for():
    found = re.fullmatch(
        r"(\d+) samples at 10000 Hz, peak torque ([\d.]+) N m\n", script("captured_step.py")
    )
    assert found and int(found[1]) == 2000
    assert float(found[2]) > 5, "the step to 200 r/min takes torque"


def test_every_script_is_run():
    """The law of one's own runs in tests/host/laws/test_laws.py, the agent beside its page."""
    here = {"torque_band.py", "captured_step.py"}
    assert {path.name for path in files("py")} == {*here, "own_law.py", "gym_agent.py"}


@pytest.mark.parametrize("path", part(files("ipynb"), 1), ids=lambda path: path.name)
def test_notebook_runs(path):
    for module in ("nbclient", "nbformat", "ipykernel"):
        pytest.importorskip(module, reason=f"{module} is missing: HT_EXTRAS=docs make test")
    from site_hook import executed

    cells = executed(path).cells
    outputs = [output for cell in cells for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in outputs), "no picture"
    assert not [o for o in outputs if o.get("name") == "stderr"], "a warning"


@pytest.mark.parametrize("path", files("ipynb"), ids=lambda path: path.name)
def test_notebook_is_stored_without_outputs(path):
    """Outputs come from running the notebook. Stored ones would become outdated."""
    text = path.read_text()
    assert '"outputs": []' in text and "image/png" not in text
