"""A recording with every type of sample, and the suffixes as parameters."""

import importlib.util

import numpy as np
import pytest

from hexatorque.recording.formats import SUFFIXES
from hexatorque.recording.recording import Recording


def _there(library: str | None) -> bool:
    return library is None or importlib.util.find_spec(library.partition(".")[0]) is not None


#: Each suffix. It is skipped with the library's name if the library is not installed.
EVERY_SUFFIX = [
    pytest.param(
        suffix,
        marks=pytest.mark.skipif(not _there(library), reason=f"{suffix} needs {library}"),
    )
    for suffix, library in SUFFIXES.items()
]


def pytest_generate_tests(metafunc):
    if "suffix" in metafunc.fixturenames:
        metafunc.parametrize("suffix", EVERY_SUFFIX)


@pytest.fixture
def full() -> Recording:
    """Float32 with a gap, float64, whole numbers at their limits, bool, and names with special
    characters."""
    n = 500
    random = np.random.default_rng(7)
    current = random.normal(size=n).astype(np.float32)
    current[100:103] = np.nan
    long = random.integers(-(2**63), 2**63 - 1, n)
    long[:2] = -(2**63), 2**63 - 1
    return Recording(
        40e3,
        {
            "plant.i_u1_A": current,
            "torque_Nm": 1e-3 * random.normal(size=n),
            "position": long,
            "counter": np.arange(n).astype(np.uint16),
            "on": random.random(n) < 0.5,
            "end": np.full(n, -np.inf, np.float32),
            "ψ α/x-y [0] #1": np.zeros(n, np.float32),
            "a_name_that_has_more_than_thirty_one_characters_V": np.ones(n, np.float32),
        },
        {"plant.i_u1_A": "A", "torque_Nm": "N m", "ψ α/x-y [0] #1": "Ω"},
        {
            "scheme": "ddr",
            "trigger_s": 0.3501,
            "parameters": {"deep": [1, 2.5, None, True, {"ü": "line\nbreak"}]},
            "started": "2024-05-01T12:34:56.789+02:00",
            "gaps": 1,
            "lost_samples": 3,
        },
        start_s=0.35,
    )
