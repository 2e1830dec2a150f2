"""States of a leg of the inverter."""

LOW, HIGH, OFF = 0, 1, 2
