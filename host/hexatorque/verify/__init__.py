"""Looks at parts of the drive by themselves, against what theory says of them."""
