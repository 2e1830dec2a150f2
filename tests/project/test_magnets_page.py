"""The page about machines with magnets works as it says (`pages`)."""

import re

from pages import DOCS, follow

from hexatorque.setups.new import LXY_OF_LD_RANGE

PAGE = (DOCS / "magnets.md").read_text()


def test_every_command(terminals):
    (terminals.folder / "examples").symlink_to(DOCS.parent / "examples")
    follow(PAGE, terminals)


def test_the_range_of_lxy_is_that_of_the_code():
    least, most = re.search(
        r"L_xy is taken as ([\d.]+) L_d.*?\(up to ([\d.]+)\)", PAGE, re.S
    ).groups()
    assert (float(least), float(most)) == LXY_OF_LD_RANGE
