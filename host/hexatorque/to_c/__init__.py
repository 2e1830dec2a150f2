"""The plant in C99, written from its compiled Python functions."""
