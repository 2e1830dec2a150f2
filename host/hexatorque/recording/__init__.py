"""Recordings: named channels on one time base, and a module for each kind of file."""

from .recording import Recording, RecordingError

__all__ = ["Recording", "RecordingError"]
