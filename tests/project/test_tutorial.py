"""The tutorial works as it says (`pages`)."""

import os

from pages import DOCS, PART, follow, readmes_commands

PAGE = (DOCS / "tutorial.md").read_text()


def test_every_command_and_picture(terminals):
    follow(PAGE, terminals)
    names = set(os.listdir(terminals.folder / "out"))
    assert {"board.csv", "board.json", "currents.npz", "currents.png"} <= names


def test_readmes_commands_with_a_board(terminals):
    """In their order, each in the terminal that README says. `board commission` takes a minute:
    only its first step is run. The page needs a browser to do more than to be there."""
    for command, about in readmes_commands():
        words = command.split()
        if words[1] == "new":
            terminals.run(command)
        elif words[1] != "board":
            continue
        elif "second terminal" in about:
            terminals.stay(command, "/dev/pts/")
        elif "until Ctrl-C" in about:
            terminals.stay(command, "http://")
        else:
            terminals.run(f"{command} --steps wiring".replace("--out measured.toml ", ""))
    assert len(terminals.staying) == 2


def test_only_browser_and_installation_are_not_run():
    reasons = [part["detail"] for part in PART.finditer(PAGE) if part["what"] == "not run"]
    assert reasons == ["installs the package", "opens a browser"]


def test_pictures_have_a_source():
    """All but the page of the monitor, which needs a browser."""
    shown = [(part["picture"], part["what"]) for part in PART.finditer(PAGE) if part["picture"]]
    assert [name for name, what in shown if what != "picture"] == ["images/monitor.png"]
    assert len(shown) >= 4
