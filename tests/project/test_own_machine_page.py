"""The page about a machine of one's own works as it says (`pages`)."""

import os

from pages import DOCS, PART, follow

PAGE = (DOCS / "own-machine.md").read_text()


def test_every_command(terminals):
    follow(PAGE, terminals)
    assert {"first.npz", "first.png"} <= set(os.listdir(terminals.folder / "out"))


def test_every_command_is_run():
    assert not [part for part in PART.finditer(PAGE) if part["what"] == "not run"]
