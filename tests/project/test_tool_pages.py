"""Every command that a page about a tool shows is run by a test. `test_every_command` of some pages
follows the page. For the other pages the table here names the test that runs the command, and words
of that test; the commands of recordings.md run here."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from hexatorque.cli.main import main
from hexatorque.recording.journal import Stream
from hexatorque.recording.recording import Recording
from hexatorque.recording.writer import Writer

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
#: Pages that a test follows from the first block to the last.
FOLLOWED = ("xcp", "gym")
HERE = "tests/project/test_tool_pages.py"
#: Page -> what each of its commands begins with -> the file that runs it, and words in that file.
RUN_BY = {
    "xcp": {"cmake --preset": ("tests/project/test_c2000_build.py", "def test_image_with_xcp"),
            "python tune.py": ("tests/project/test_xcp_page.py", "follow(PAGE, terminals)"),
            "pip install pyxcp": ("tests/project/test_xcp_page.py", "pip install pyxcp")},
    "gym": {"python look.py": ("tests/project/test_gym_page.py", "follow(PAGE, terminals)"),
            "python examples/gym_agent.py":
                ("tests/project/test_gym_page.py", '"examples/gym_agent.py"'),
            "make bench-peers": (HERE, '"bench-peers"')},
    "fmu": {"hexatorque fmu out/": ("tests/host/fmu/test_fmu_command.py",
                                    "def test_the_pages_commands_work")},
    "systems": {
        "pip install hexatorque": ("tools/wheels.py", '"install"'),
        "pip install FILE.whl": ("tools/wheels.py", '"install"'),
        "hexatorque evidence pil": ("tests/host/boards/test_pil.py", '"evidence", "pil"'),
        "hexatorque board serve": ("tests/windows/test_windows.py", '"board", "serve", "--tcp"'),
        "make dist": (HERE, '"dist"'),
        "make test-windows": (HERE, '"test-windows"'),
    },
    "monitor": {
        "hexatorque board serve": ("tests/project/test_tutorial.py", "test_readmes_commands"),
        "hexatorque board monitor": ("tests/project/test_tutorial.py", "test_readmes_commands"),
        "hexatorque board params": ("tests/host/monitor/test_sets.py", '"params", "save"'),
        "hexatorque board commission": ("tests/project/test_tutorial.py", "--steps wiring"),
        "make web": (HERE, '"web"'),
        "python tools/web.py mine.toml": ("tests/web/test_web.py",
                                          'page_of(tmp_path_factory, "mine.toml")'),
    },
    "speed": {"make bench": (".ci/run", "\nmake bench\n"),
              "make bench-peers": (HERE, '"bench-peers"')},
    "flash": {
        "cmake --preset f28377s && cmake --build":
            ("tests/project/test_c2000_build.py", "def test_what_the_compiler_gets"),
        "cmake --preset f28377s -DHT_SETUP=": ("tests/project/test_initial_values.py", "HT_SETUP="),
        "cmake --preset f28377s -DHT_FLASH_API=":
            ("tests/project/test_c2000_build.py", "-DHT_FLASH_API="),
        "hexatorque run mine.toml": ("tests/project/test_own_machine_page.py", "follow(PAGE"),
        "hexatorque board list": ("tests/host/serial/test_commands.py", '"board", "list"'),
        "cmake --preset f28377s -DHT_GATES_ACTIVE_LOW=ON":
            ("tests/project/test_c2000_build.py", "HT_GATES_ACTIVE_LOW"),
        "hexatorque board params": ("tests/host/serial/test_store.py", '"params", "keep"'),
    },
    "recordings": {
        "hexatorque board compare mine.toml bench.npz --load 4 --speed 500":
            ("tests/host/drive/test_twin_outside.py", '"board", "compare", "paper-a-feasible"'),
        "hexatorque convert OLD NEW": (HERE, "def test_commands_of_recordings"),
        "hexatorque convert": (HERE, "def test_commands_of_recordings"),
        "hexatorque plot": (HERE, "def test_commands_of_recordings"),
    },
    "pil": {
        "hexatorque evidence pil --machine mps2-an500":
            ("tests/host/boards/test_served_board.py", '"mps2-an500"'),
        "hexatorque evidence pil --device":
            ("tests/host/boards/test_pil_board.py", '"--device", a_board.name'),
        "hexatorque evidence pil examples/reversal.toml":
            ("tests/host/boards/test_pil.py", "def test_command_with_a_scenario"),
        "hexatorque evidence pil": ("tests/host/boards/test_pil.py", '"evidence", "pil"'),
        "hexatorque board serve --machine":
            ("tests/host/boards/test_served_board.py", '"--machine", "mps2-an386"'),
        "cmake --preset f28377s -DHT_PIL_BAUD=":
            ("tests/project/test_c2000_build.py", "HT_PIL_BAUD"),
        "hexatorque board start --device":
            ("tests/host/serial/test_commands.py", 'background("start", "--speed"'),
    },
    "others": {},
}  # fmt: skip
#: What a reader does with TI's tools, which nobody has here.
OF_TI = ("export TI_CGT_ROOT", "dslite.sh", "hex2000")
WORDS = (
    "hexatorque (?:board|convert|evidence|fmu|plot|run)|make|python|pip install|cmake|export"
    "|dslite.sh|hex2000"
)
SHOWN = re.compile(rf"^(?:    )?((?:{WORDS}) .*?)(?:   +#.*)?$", re.M)
INLINE = re.compile(rf"`((?:{WORDS}) [^`]*)`")


def shown(page: str) -> list[str]:
    """The commands of a page: lines of its blocks of commands, and those in its text."""
    text = re.sub(r"\\\n\s*", "", (DOCS / f"{page}.md").read_text())
    blocks = re.findall(r"^```(?:bash|sh)\n(.*?)^```", text, re.S | re.M)
    text = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    blocks += re.findall(r"^    .*$", text, re.M)
    found = SHOWN.findall("\n".join(blocks)) + INLINE.findall(text)
    found = [" ".join(one.split()) for one in found]
    return [one for one in dict.fromkeys(found) if "pip install 'hexatorque[" not in one]


def test_commands_are_seen():
    assert "make web" in shown("monitor") and "hexatorque board monitor" in shown("monitor")
    assert len(shown("pil")) == 8 and len(shown("fmu")) == 4
    assert "hexatorque convert run.mf4.part run.mf4" in shown("recordings")


@pytest.mark.parametrize("page", RUN_BY)
def test_each_command_of_a_tools_page_is_run_by_a_test(page):
    used = set()
    for command in shown(page):
        mine = [start for start in RUN_BY[page] if command.startswith(start)]
        if mine:
            used.add(max(mine, key=len))
        elif not command.startswith(OF_TI):
            assert page in FOLLOWED and command.startswith("hexatorque"), f"no test runs: {command}"
    assert used == set(RUN_BY[page]), "the page shows these no longer"
    for file, words in RUN_BY[page].values():
        assert words in (ROOT / file).read_text(), f"{file} has no {words}"


@pytest.mark.parametrize("page", FOLLOWED)
def test_a_page_that_is_followed_has_its_test(page):
    test = (ROOT / f"tests/project/test_{page}_page.py").read_text()
    assert "    follow(PAGE, terminals)" in test


@pytest.mark.parametrize(
    ("target", "script"),
    [("web", "tools/web.py"), ("dist", "tools/wheels.py"), ("test-windows", "tools/windows.py"),
     ("bench-peers", "tools/bench_peers.py"), ("docs", "mkdocs build --strict"),
     ("comparison", "tools/write_comparison.py"), ("comparison", "tools/write_studies.py")],
)  # fmt: skip
def test_a_target_of_make_runs_its_script(target, script):
    """What these scripts do takes minutes and is tested in other rooms, or by CI."""
    done = subprocess.run(["make", "-n", target], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and script in done.stdout, done.stderr
    assert "mkdocs" in script or (ROOT / script).exists()


def scope(path: Path, *names: str) -> None:
    """A table of an oscilloscope: 40 ms at 10 kHz."""
    time_s = np.arange(400) / 10e3
    rows = [f"{t:.6e},{','.join(f'{np.sin(300 * t + n):.6e}' for n in range(len(names)))}"
            for t in time_s]  # fmt: skip
    path.write_text("\n".join([f"Time (s),{','.join(names)}", *rows, ""]))


def journal(path: Path) -> None:
    """A recording that was not closed, as after `kill -9`."""
    stream = Stream((("torque_Nm", "N m"),), tick_Hz=10e3, decimation=4)
    with Writer.open(path, stream) as writer:
        writer.append(4 * np.arange(100, dtype=np.uint32), np.ones((100, 1), np.float32))
        part = path.with_name(f"{path.name}.part")
        written = part.read_bytes()
    path.unlink()
    part.write_bytes(written)


def test_commands_of_recordings(tmp_path, monkeypatch, capsys):
    """In their order, each in a folder with the files that it names; .npz in place of .mf4, whose
    library may be missing. `board compare` takes seconds, so a test of its own runs it."""
    time_s = np.arange(4000) / 10e3
    own = {"i_u1_A": np.sin(300 * time_s), "torque_Nm": time_s, "speed_rpm": time_s}
    ran = []
    for number, command in enumerate(shown("recordings")):
        words = command.replace("mf4", "npz").split()[1:]
        if words[0] == "board" or "OLD" in words:
            continue
        folder = tmp_path / str(number)
        (folder / "out").mkdir(parents=True)
        monkeypatch.chdir(folder)
        scope(folder / "scope.csv", "CH1", "CH2")
        for n in range(1, 5):
            scope(folder / f"C{n}.csv", "Ampl")
        for name in ("sil.npz", "out/reversal.npz", *["bench.npz"] * (words[0] == "plot")):
            Recording(10e3, own, {"i_u1_A": "A"}).save(folder / name)
        journal(folder / "run.npz")
        assert main(words) == 0, f"{command}: {capsys.readouterr().err}"
        ran.append(words[0])
        made = (
            "out/plot.png" if words[0] == "plot" else next(w for w in words[2:] if w[-4:] == ".npz")
        )
        assert (folder / made).stat().st_size > 0
    assert ran.count("plot") == 4 and ran.count("convert") == 3
