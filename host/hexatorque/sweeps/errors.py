"""What studies say when they cannot go on."""

from __future__ import annotations

from ..errors import HexatorqueError


class StudyError(HexatorqueError):
    """A study cannot be made, or cannot go on."""

    exit_code = 2
