"""Studies that show what the simulation and the firmware can be trusted for: one module
and one command each.

A study module has TITLE, `study(quick, progress) -> dict` (plain data, for JSON),
`tables(result)` (for the terminal), `plot(result, path)` and `failures(result)`: a line for
everything that must not be; nothing in studies that only measure.
"""

#: Command-line name -> module, in the order of the chain: plant, firmware, drive.
STUDIES = {
    "integration": "integration",
    "inverter": "inverter",
    "low-speed": "low_speed",
    "light-load": "light_load",
    "faults": "faults",
    "line": "line",
}
