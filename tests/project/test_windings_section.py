"""The section about sets 0 or 60 degrees apart works as it says (`pages`)."""

from pages import DOCS, follow

PAGE = (DOCS / "schemes.md").read_text()
HEADING = "\n## Sets 0 or 60 degrees apart\n"


def test_every_command(terminals):
    section = PAGE.partition(HEADING)[2].partition("\n## ")[0]
    assert "hexatorque run" in section
    (terminals.folder / "examples").symlink_to(DOCS.parent / "examples")
    follow(section, terminals)
