"""What studies say when they cannot go on."""

from __future__ import annotations

from ..errors import InputError


class StudyError(InputError):
    """A study cannot be made, or cannot go on."""
