"""Voltages of a six-pulse rectifier, over their mean without a current.

This module imports nothing but `math`: cmake/initial_values.py uses it where the package is not
installed.
"""

import math

#: Peak of a line's voltage to the star point.
LINE_PEAK = math.pi / (3 * math.sqrt(3))
#: Peak of the rectified voltage, to which a capacitor without a load charges.
RECTIFIED_PEAK = math.pi / 3
