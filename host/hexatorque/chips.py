"""The chips for which the firmware has drivers and a register model."""

DEVICES = ("f28335", "f28377s")
