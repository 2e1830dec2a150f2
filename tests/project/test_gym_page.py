"""The page about the environment of Gymnasium works as it says (`pages`), as does its example."""

import re
import subprocess
import sys

import pytest
from pages import DOCS, follow

pytest.importorskip("gymnasium", reason="gymnasium is missing: pip install gymnasium")

PAGE = (DOCS / "gym.md").read_text()


def test_every_command(terminals):
    follow(PAGE, terminals)


def test_names_and_numbers_are_those_of_the_code():
    from hexatorque.gym import IDS, environment, reward

    assert set(re.findall(r"`(hexatorque/\w+-v0)`", PAGE)) == set(IDS.values())
    assert f"{environment.VOLTAGE_PU} V_dc" in PAGE and f"{environment.XY_PU} V_dc" in PAGE
    assert f"{reward.XY_WEIGHT} times" in PAGE and f"{reward.SWITCHING_WEIGHT} for each" in PAGE


def test_the_example_finds_gains_that_are_better_than_none():
    ran = subprocess.run(
        [sys.executable, "examples/gym_agent.py"],
        cwd=DOCS.parent, capture_output=True, text=True, check=True,
    )  # fmt: skip
    found, nothing = map(float, re.findall(r"-[\d.]+", ran.stdout.splitlines()[-1]))
    assert found > 0.7 * nothing
