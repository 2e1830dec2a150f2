"""Schemes of a built-in set-up."""

import functools
from collections.abc import Iterator

from hexatorque import SetupError, firmware, load
from hexatorque.setups import review


def allowed(name: str) -> Iterator[str]:
    """Those that the set-up's machine and timing allow."""
    for scheme in firmware.schemes():
        try:
            load(name).changed(controller__scheme=scheme)
        except SetupError:
            continue
        yield scheme


@functools.cache
def is_ready(name: str, scheme: str) -> bool:
    """Whether `check` finds nothing against it."""
    setup = load(name).changed(controller__scheme=scheme)
    return bool(review.ready_of(review.review(setup, [scheme]), [scheme]))
