"""Laws outside the firmware: a controller of one's own, in Python or in C, and references.

A law decides on the switching of a period. Everything else is the firmware: sampling, protection,
states, flux observer, prediction, references, registers and latency. So a comparison with the
firmware's schemes compares the law alone. docs/references.md has an example.

The modules of these names are imported at first use: the command asks for the references' names
alone.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..given import choice

if TYPE_CHECKING:
    from .controller import controller_of
    from .law import Law, LawError, record
    from .patterns import VECTORS, centred, transitions, vector, vectors

__all__ = [
    "VECTORS", "Law", "LawError", "centred", "controller_of", "find", "names", "record",
    "transitions", "vector", "vectors",
]  # fmt: skip

#: Module that defines each of these names.
_HOMES = {
    "controller_of": "controller",
    "Law": "law",
    "LawError": "law",
    "record": "law",
    "VECTORS": "patterns",
    "centred": "patterns",
    "transitions": "patterns",
    "vector": "patterns",
    "vectors": "patterns",
}

#: Name of a reference -> its module, which has the class `Reference`, and what it is.
REFERENCES = {
    "dtc-svm": ("dtc_svm", "direct torque control, PI regulators, double zero-sequence PWM"),
    "lvv-mpc": ("lvv_mpc", "predictive control, large virtual vector and zero vector"),
    "vv-mpc": ("vv_mpc", "predictive control over virtual vectors"),
    "fcs-mpc": ("fcs_mpc", "predictive control over single vectors"),
}
#: How the name of a file with a law ends.
FILES = (".py", ".so", ".dylib", ".dll")


def names() -> tuple[str, ...]:
    """The references' names."""
    return tuple(REFERENCES)


def named(name: str, with_laws: bool = True) -> str:
    """The name of a scheme as it is usually written, whatever its letters' case; `with_laws`: or of
    a reference, or a file with a law. InputError names them all if there is none."""
    from ..firmware import schemes

    allowed = [*schemes(), *(names() if with_laws else ())]
    found = choice(name, allowed)
    if found not in allowed and not (with_laws and found.endswith(FILES)):
        file = ", or a file of a law (.py, .so)" if with_laws else ""
        raise InputError(f"no scheme {name!r}: choose from {', '.join(allowed)}{file}")
    return found


def find(name: str) -> Law | None:
    """The law of that name, in capital or small letters, or in that file: `.py` (the last law that
    it defines) or a shared library of compiled C. None if the name is neither. LawError if the file
    has no law."""
    if (reference := choice(name, REFERENCES)) in REFERENCES:
        return import_module(f".{REFERENCES[reference][0]}", __name__).Reference()
    if name.endswith(FILES):
        from .files import from_file

        return from_file(Path(name))
    return None


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value  # the next access does not call this function
    return value
