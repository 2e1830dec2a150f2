"""A bench beside its simulation: what differs, and which parameter would explain it.

`bench` reads a recording and says what the drive was asked and given, `replay` lets the simulation
follow that, `quantities` makes what is compared from the samples of either, `candidates` has the
parameters that may be wrong, `fit` finds which of them explains the difference, `report` shows it.
"""
