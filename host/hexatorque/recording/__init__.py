"""Recordings: named channels on one time base (`recording`), and a module for each kind of
file (`formats` says which). Importing this package alone loads nothing heavy."""
