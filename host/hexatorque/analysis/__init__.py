"""Evaluation of recordings: one definition of each figure of merit, used everywhere."""

from .metrics import metrics
from .run import Run

__all__ = ["Run", "metrics"]
