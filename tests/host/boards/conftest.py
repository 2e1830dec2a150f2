"""Which targets can run on this computer. Without its tools a test is skipped, with the line that
says how to install them."""

import functools

import pytest

from hexatorque import setups
from hexatorque.boards import emulator_process, tools


@pytest.fixture(scope="session", autouse=True)
def build_once():
    """The sources do not change while the tests run, so CMake looks for changes only once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tools, "build", functools.cache(tools.build))
        yield


@pytest.fixture(scope="session")
def need():
    """need(machine): skip the test if that machine cannot run here."""

    def check(machine: str) -> None:
        line = tools.missing(*emulator_process.NEEDS[machine])
        if line:
            pytest.skip(line)

    return check


@pytest.fixture
def m4f(need):
    need("mps2-an386")
    with emulator_process.emulator("mps2-an386") as target:
        yield target


@pytest.fixture(scope="session")
def paper_a():
    return setups.load("paper-a-feasible")


@pytest.fixture(scope="session")
def quick(paper_a):
    """Paper A's drive with its flux built up in 50 ms."""
    return paper_a.changed(controller__build_s=0.05, controller__build_current_A=20.0)
