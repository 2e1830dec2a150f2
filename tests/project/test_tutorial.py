"""The tutorial works as it says (`pages`)."""

import os

from pages import DOCS, PART, follow

PAGE = (DOCS / "tutorial.md").read_text()


def test_every_command_and_picture(terminals):
    follow(PAGE, terminals)
    names = set(os.listdir(terminals.folder / "out"))
    assert {"board.csv", "board.json", "currents.npz", "currents.png"} <= names


def test_only_browser_and_installation_are_not_run():
    reasons = [part["detail"] for part in PART.finditer(PAGE) if part["what"] == "not run"]
    assert reasons == ["installs the package", "opens a browser"]


def test_pictures_have_a_source():
    """All but the page of the monitor, which needs a browser."""
    shown = [(part["picture"], part["what"]) for part in PART.finditer(PAGE) if part["picture"]]
    assert [name for name, what in shown if what != "picture"] == ["images/monitor.png"]
    assert len(shown) >= 4
