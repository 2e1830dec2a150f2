"""Python's rules that C does not share hold in the translated functions, and what is outside of the
subset is refused with its place."""

import re
import shutil

import numpy as np
import pytest

from hexatorque.plant.compiled import compiled
from hexatorque.to_c import library, plant
from hexatorque.to_c.translator import Translator
from hexatorque.to_c.types import INT, Array, Untranslatable

NUMBERS = Array(INT, (4,))


@compiled
def next_of(a):
    a[0] = 10 * a[0] + 1
    return a[0]


@compiled
def second(a):
    a[1] += 1
    return a[1] > 0


def in_order(a):
    """The left operand counts before the call on the right changes it."""
    return a[0] + next_of(a) * next_of(a)


def decided_early(a):
    """The right side must not run if the left one decides."""
    decided = a[0] > 0 or second(a)
    if a[0] > 5 and second(a):
        decided = False
    return 1 if decided else (2 if second(a) else 3)


def swapped(a):
    a[0], a[1] = a[1], a[0]
    x, y = a[2], a[3]
    x, y = y, x + 0 * y
    return 100 * x + y


def floored(a):
    return 100 * (a[0] // a[1]) + a[0] % a[1]


def ranges(a):
    total = 0
    for n in range(a[0] - 1, -1, -1):
        if n == 1:
            continue
        a[0] = 0
        total = 10 * total + n
    while second(a):
        if a[1] > 3:
            break
    return total + min(a[1], a[2]) + max(a[1], a[2], 7) * abs(a[3])


FUNCTIONS = (in_order, decided_early, swapped, floored, ranges)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    compiler = shutil.which("cc")
    assert compiler
    t = Translator(lambda function, kinds: function)
    for function in FUNCTIONS:
        t.function(function, [NUMBERS], function.__name__)
    return library.build(plant.files(t), tmp_path_factory.mktemp("made"), compiler, "-Werror")


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("numbers", [(4, 3, 5, -6), (-7, 2, 1, 9), (7, -2, -3, 4), (6, -1, 0, 0)])
def test_a_translated_function_does_what_python_does(made, function, numbers):
    a, b = np.array(numbers), np.array(numbers)
    assert made.call(function.__name__, a) == function(b)
    assert list(a) == list(b)


def with_text(a):
    return "x"


def with_calls(a):
    return next_of(a) + sum(a)


def with_two_types(a):
    x = 1
    x = 0.5 * a[0]
    return x


def with_chain(a):
    return 0 < a[0] < 3


def with_list(a):
    return [n for n in a]


@pytest.mark.parametrize(
    "function, reason",
    [
        (with_text, "no constant in C for 'x'"),
        (with_calls, "a call of sum"),
        (with_two_types, "x is a"),
        (with_chain, "a chain of comparisons"),
        (with_list, "ListComp"),
    ],
)
def test_what_is_outside_of_the_subset_is_refused_with_its_place(function, reason):
    with pytest.raises(Untranslatable, match=reason) as refused:
        Translator(lambda f, kinds: f).function(function, [NUMBERS])
    place = re.search(r"test_translator, line (\d+): ", str(refused.value))
    first = function.__code__.co_firstlineno
    assert place and first < int(place[1]) <= first + 2
