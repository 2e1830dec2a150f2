"""The errors of studies."""

from __future__ import annotations

from ..errors import InputError


class StudyError(InputError):
    """A study cannot be made, or cannot go on."""
