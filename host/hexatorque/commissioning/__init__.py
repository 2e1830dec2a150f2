"""Commissioning: wiring, machine and load of a drive, measured by its own firmware.

The firmware applies voltages within limits (its state `test`) and captures currents. Everything
that is computed from these is here, so the same code works on a simulated drive, on a virtual board
and on a DSP.
"""
