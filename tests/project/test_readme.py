"""What README tells to type works as it is printed, in this order. Its commands for a board are run
by test_tutorial.py, and every one is parsed by test_command_line.py."""

import re
import shutil
from pathlib import Path

from campaigns import WHOLE
from pages import readmes_commands

ROOT = Path(__file__).resolve().parents[2]
#: What makes a long command shorter, unless campaigns are whole.
SHORTER = {"tune": " --trials 1"}
#: These take hours. The whole of it has tests of its own.
NOT_RUN = ("evidence",)


def test_the_commands_run_in_their_order(terminals):
    """In a folder with the examples and nothing else, as in a fresh clone."""
    shutil.copytree(ROOT / "examples", terminals.folder / "examples")
    names = []
    for command, _ in readmes_commands():
        name = command.split()[1]
        names.append(name)
        if name not in ("board", *NOT_RUN):
            terminals.run(command + ("" if WHOLE else SHORTER.get(name, "")))
    assert {"compare", "new", "check", "tune", "run", "plot", "sweep", "board"} <= set(names)
    for file in ("out/reversal.npz", "out/reversal.png", "out/compare/report.html"):
        assert (terminals.folder / file).stat().st_size > 0


def test_the_start_names_windows_and_the_live_page():
    """Each with the way to get it: nothing is published that a link could lead to."""
    text = (ROOT / "README.md").read_text()
    start = text.partition("\n## Start\n")[2].partition("\n## ")[0]
    assert "On Windows" in start and "(docs/systems.md)" in start and "`make dist`" in start
    assert "`make web` writes [a live drive](docs/monitor.md#a-drive-in-the-page)" in start
    (shown,) = re.findall(r"`(build/web/\S+)`", start)
    script = (ROOT / "tools/web.py").read_text()
    assert 'default=ROOT / "build" / "web"' in script and f'"{Path(shown).name}"' in script
    assert shown in (ROOT / "docs/monitor.md").read_text()


def test_the_targets_of_make_exist():
    text = (ROOT / "README.md").read_text()
    targets = set(re.findall(r"(?:`|^    )make ([\w-]+)", text, re.M))
    assert {"demo", "test", "docs"} <= targets
    for target in targets:
        assert re.search(rf"^{target}( \S+)*:", (ROOT / "Makefile").read_text(), re.M), target


def test_what_the_set_up_asks_for_is_named():
    """tools/setup.sh ends with the packages that are missing: README has named them before."""
    wanted = set(re.findall(r"python3-\w+", (ROOT / "tools/setup.sh").read_text()))
    (named,) = re.findall(
        r"^    sudo apt-get install (.*)$", (ROOT / "README.md").read_text(), re.M
    )
    assert wanted and wanted <= set(named.split())
