"""The sums with vector instructions, and two steps at once, have the bits of scalar code."""

import numpy as np
from numba import njit
from plant_calls import NO_LOAD

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant.columns import add_columns
from hexatorque.plant.machine import rk4_step, rk4_two_steps


@njit
def compiled_sum(columns, w, out):
    add_columns(columns, w[0], w[1], w[2], w[3], w[4], w[5], out)


def test_sums_have_the_bits_of_scalar_code_at_any_address():
    rng = np.random.default_rng(5)
    memory, result = np.empty(60), np.empty(24)
    for n in range(200):
        columns = memory[n % 9 :][:48].reshape(6, 8)
        columns[:] = rng.normal(size=(6, 8)) * 10.0 ** rng.integers(-9, 9, (6, 8))
        w = rng.normal(size=6) * 10.0 ** rng.integers(-9, 9, 6)
        if n % 10 == 0:
            w[n // 10 % 6] = (np.nan, np.inf, -np.inf, 0.0, -0.0)[n // 10 % 5]
        result[:] = 7.0
        at = n % 13
        compiled_sum(columns, w, result[at : at + 8])
        a, b, c, d, e, f = w.tolist()
        with np.errstate(invalid="ignore"):
            expected = [
                ((p * a + q * b) + (r * c + s * d)) + (t * e + u * f)
                for p, q, r, s, t, u in columns.T
            ]
        np.testing.assert_array_equal(result[at : at + 8], expected)
        assert (np.delete(result, range(at, at + 8)) == 7.0).all()
        plain = np.empty(8)
        with np.errstate(invalid="ignore"):
            add_columns(columns, a, b, c, d, e, f, plain)
        np.testing.assert_array_equal(plain, expected)


@njit
def step_both(m, load, y, v, dt, out, k, z):
    rk4_two_steps(m, load, y, v, dt[0], dt[1], out, y, k, z)


@njit
def step_one(m, load, y, v, dt, out, k, z):
    rk4_step(m, load, y, v, dt, out, k, z)


def test_two_steps_at_once_are_the_two_steps():
    rng = np.random.default_rng(6)
    for name in ("paper-a-feasible", "large-110kw"):
        for saturation in ({}, {"machine__psi_knee_Wb": 0.5}):
            m = SimulatedDrive(setups.load(name).changed(**saturation))._machine
            k, z = np.empty(8), np.empty((5, 8))
            for _ in range(20):
                y, v = rng.normal(size=8), rng.normal(size=4) * 100
                dt = rng.uniform(0, 1e-4, 2)
                one, other, beside = np.empty(8), np.empty(8), np.empty(8)
                step_one(m, NO_LOAD, y, v, dt[0], one, k, z)
                step_one(m, NO_LOAD, y, v, dt[1], other, k, z)
                step_both(m, NO_LOAD, y, v, dt, beside, k, z)
                np.testing.assert_array_equal(beside, one)
                np.testing.assert_array_equal(y, other)
