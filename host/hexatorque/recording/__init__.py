"""Recordings: named channels with one time axis (`recording`), and a module for each file format
(`formats` lists them). Importing this package does not import the libraries of the formats."""
