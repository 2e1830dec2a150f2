"""Tune a drive on its own simulation: `hexatorque tune`.

`course` drives a set-up through the operating points and measures it, `aim` compares two
measurements, `space` says which parameters of a scheme may move and how far, `search` is the study
(Optuna), `tuning` puts them together and chooses, `report` writes the result.
"""
