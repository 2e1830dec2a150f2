"""Experiments with drives: they are brought to operating points and measured there, alone or side
by side."""
