"""The plant's elementary functions against decimal numbers of 60 digits."""

import decimal
import math
from decimal import Decimal

import numpy as np
import pytest

from hexatorque.plant import elementary, vsd

decimal.getcontext().prec = 60
PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459")


def series(x, n, sign):
    """x^n/n! + sign x^(n+2)/(n+2)! + ..."""
    term, total = x**n / math.factorial(n), Decimal(0)
    while abs(term) > Decimal(10) ** -58:
        total += term
        term *= sign * x * x / ((n + 1) * (n + 2))
        n += 2
    return total + term


def exact_sin(x):
    return series(x.remainder_near(2 * PI), 1, -1)


def exact_cos(x):
    return exact_sin(PI / 2 - x)


def exact_expm1(x):
    return series(x, 1, 1) + series(x, 2, 1) if abs(x) < 1 else x.exp() - 1


def exact_tanh(x):
    return exact_expm1(2 * x) / (exact_expm1(2 * x) + 2)


random = np.random.default_rng(1)
SMALL = [m * 2.0**-e for m in (-1.3, 1.0, 1.7) for e in range(0, 300, 7)]
ANGLES = [
    *SMALL,
    *np.arange(-200, 200) * math.pi / 12,
    *random.uniform(-1, 1, 500) * math.pi,
    *random.uniform(-1.6e6, 1.6e6, 500),
]
EXPONENTS = [*SMALL, 0.0, *random.uniform(-1, 1, 500), *random.uniform(-700, 700, 500)]
POSITIVE = [
    *random.uniform(0, 1, 500),
    *10.0 ** random.uniform(-300, 300, 500),
    *(1 + x for x in SMALL if abs(x) < 0.5),
]
#: Function, exact one, arguments, bound of the error in units in the last place.
CASES = {
    "sin": (elementary.sin, exact_sin, ANGLES, 1.0),
    "cos": (elementary.cos, exact_cos, ANGLES, 1.0),
    "exp": (elementary.exp, Decimal.exp, EXPONENTS, 1.0),
    "expm1": (elementary.expm1, exact_expm1, EXPONENTS, 1.5),
    "log": (elementary.log, Decimal.ln, POSITIVE, 1.0),
    "tanh": (elementary.tanh, exact_tanh, [x for x in EXPONENTS if abs(x) < 30], 2.5),
}


@pytest.mark.parametrize("name", CASES)
def test_error_in_units_in_the_last_place(name):
    function, exact, arguments, bound = CASES[name]
    for x in map(float, arguments):
        right = exact(Decimal(x))
        error = abs(Decimal(float(function(x))) - right)
        assert error <= Decimal(bound) * Decimal(math.ulp(float(right))), x


def test_ends():
    assert elementary.exp(-1e9) == 0.0 and elementary.exp(800.0) == math.inf
    assert elementary.expm1(-1e9) == -1.0 and elementary.expm1(800.0) == math.inf
    assert elementary.tanh(1e9) == 1.0 and elementary.tanh(-1e9) == -1.0
    assert elementary.log(1.0) == 0.0 and elementary.exp(0.0) == 1.0


def test_without_the_compiler_the_bits_are_the_same():
    for x in map(float, ANGLES):
        assert vsd.exp_j(x) == elementary.turned(x)
