"""A process that simulates does not import scipy, and a law of one's own may use linear algebra."""

import subprocess
import sys

PROGRAM = """
import sys
import numpy as np
from hexatorque import SimulatedDrive, load
SimulatedDrive(load("paper-a-feasible")).run(0.001)
assert "scipy.linalg" not in sys.modules
from numba import njit
@njit
def solved(a, b):
    return np.linalg.solve(a, a @ b)
assert np.allclose(solved(2.0 * np.eye(3), np.arange(3.0)), np.arange(3.0))
"""


def test_the_simulation_starts_without_scipy():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
