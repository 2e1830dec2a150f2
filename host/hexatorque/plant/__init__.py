"""The drive's physics, compiled: machine, inverter, PWM registers, sensors, load."""
