"""The base of the package's own errors.

An error of this class is for the user: its text is one line that names the thing and the
allowed range. The command prints that line and ends with the class's exit code.
"""

from __future__ import annotations


class HexatorqueError(Exception):
    """`exit_code`: 2 for a mistake of the user, 1 for what went wrong otherwise."""

    exit_code = 1
