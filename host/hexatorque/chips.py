"""The chips that the firmware has drivers and a register model for."""

DEVICES = ("f28335", "f28377s")
