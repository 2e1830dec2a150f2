"""The base of the package's own errors.

These errors are for the user. The text is one line that names what is wrong and the allowed
range. The command prints this line and ends with the error's exit code.
"""

from __future__ import annotations


class HexatorqueError(Exception):
    """exit_code: 2 for a mistake of the user, 1 for every other failure."""

    exit_code = 1


class InputError(HexatorqueError, ValueError):
    """A name or a value that was given and cannot be used. The text has one line for each mistake:
    the name, the value, and the nearest known names or the allowed range. Set-ups, drives, studies
    and recordings raise it or a class derived from it, so `except InputError` is enough."""

    exit_code = 2
