"""Functional mock-up units (FMI): the firmware for other simulation tools."""
