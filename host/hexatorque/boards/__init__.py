"""The firmware on other processors and in virtual boards, built from the same sources."""
