"""The page about XCP works as it says (`pages`), and its numbers are those of the code."""

import re

import pytest
from pages import DOCS, follow

from hexatorque.firmware import lib

PAGE = (DOCS / "xcp.md").read_text()


def test_every_command(terminals):
    pytest.importorskip("pyxcp", reason="pyxcp is missing: pip install pyxcp")
    follow(PAGE, terminals)


def test_numbers_are_those_of_the_code():
    assert f"{lib.HT_NUMBER_XCP_CHANNELS_AT:#x} + 4 i" in PAGE
    assert f"{lib.HT_NUMBER_XCP_PARAMETERS_AT:#x} + 4 i" in PAGE
    assert f"Up to {lib.HT_NUMBER_XCP_LISTS} lists" in PAGE
    started, stopped, cleared = map(
        int, re.search(r"starts \((\d+)\), stops \((\d+)\) and clears \((\d+)\)", PAGE).groups()
    )
    assert (started, stopped, cleared) == (lib.HT_OP_START, lib.HT_OP_STOP, lib.HT_OP_CLEAR)
    assert f"after {lib.HT_SERVICE_WATCHDOG_MS} ms" in PAGE
