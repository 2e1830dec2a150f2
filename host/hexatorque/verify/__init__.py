"""Studies that show what the simulation and the firmware can be trusted for: one module
and one command each."""
