"""Connections of the drive, right and wrong ones: for tests of the wiring check.

This module imports nothing: cmake/initial_values.py uses it where the package is not installed.
"""

#: Index of the phase on each leg of the inverter if the leads are where they belong.
STRAIGHT = (0, 1, 2, 3, 4, 5)

#: How the encoder may be connected. With one channel open the counter goes back and forth.
ENCODER_WIRES = ("straight", "swapped", "one open", "open")

#: What an absolute encoder may do instead of telling the angle: keep its first reading, give none,
#: or now and then the next one.
ABSOLUTE_FAULTS = ("none", "stuck", "silent", "flickers")
