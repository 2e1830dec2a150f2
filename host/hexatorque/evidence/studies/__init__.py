"""Studies that show what the simulation and the firmware can be trusted for. Each study is one
module and one command.

A study module has TITLE, `study(quick, progress) -> dict` (plain data, for JSON), `tables(result)`
(for the terminal), `plot(result, path)` and `failures(result)`. The last returns a line for each
violated limit; for studies that only measure, it returns nothing.
"""

#: Command-line name -> module, in the order of the chain: plant, firmware, drive.
STUDIES = {
    "integration": "integration",
    "inverter": "inverter",
    "machines": "machines",
    "transients": "transients",
    "commissioning": "commissioning",
    "low-speed": "low_speed",
    "light-load": "light_load",
    "dynamics": "dynamics",
    "robustness": "robustness",
    "faults": "faults",
    "lost-phase": "lost_phase",
    "arcs": "arcs",
    "line": "line",
}
