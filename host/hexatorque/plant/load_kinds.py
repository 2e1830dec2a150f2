"""Kinds of loads, by number, as a set-up names them.

This module imports nothing: cmake/initial_values.py uses it where the package is not installed.
"""

LOADS = ("constant", "fan", "brake", "generator", "friction")
CONSTANT, FAN, BRAKE, GENERATOR, FRICTION = range(5)
