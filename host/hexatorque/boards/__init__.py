"""The firmware on other processors: built from the same sources, run in emulators."""
