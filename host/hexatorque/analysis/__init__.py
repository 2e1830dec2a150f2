"""Evaluation of recordings: one definition of each figure of merit, used everywhere."""

from .metrics import metrics
from .paper_values import PAPER, paper_values
from .run import Run

__all__ = ["PAPER", "Run", "metrics", "paper_values"]
