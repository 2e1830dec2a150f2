"""A bench beside its simulation: what differs, and which parameter would explain it.

`bench` reads the references and inputs of a drive from a recording, `replay` lets the simulation
follow them, `quantities` computes the compared values from the samples of either, `candidates` has
the parameters that may be wrong, `fit` finds which of them explains the difference, `report` shows
it.
"""
