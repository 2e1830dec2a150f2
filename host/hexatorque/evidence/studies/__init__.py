"""Studies that show what the simulation and the firmware can be trusted for. Each study is one
module and one command.

A study module has TITLE, `study(quick, progress) -> dict` (plain data, for JSON), `grid(result)`
(its tables), `plot(result, path)` and `failures(result)`. The last returns a line for each violated
limit; for studies that only measure, it returns nothing. A NOTE tells what the cells of all tables
are. The `study` of those in KEEPING has one more argument, `folder`.
"""

#: Command-line name -> module, from here, in the order of the chain: plant, firmware, drive.
STUDIES = {
    "integration": "integration",
    "inverter": "inverter",
    "machines": "machines",
    "transients": "transients",
    "commissioning": "commissioning",
    "low-speed": "low_speed",
    "light-load": "light_load",
    "dynamics": ".methods.dynamics",
    "robustness": ".methods.robustness",
    "knob": ".methods.knob",
    "faults": "faults",
    "lost-phase": "lost_phase",
    "arcs": "arcs",
    "wrong-lxy": "wrong_lxy",
    "shortest-pulse": "shortest_pulse",
    "line": "line",
}

#: Studies of hundreds of runs. Each run is kept in the folder as soon as it is there (`runs`), so
#: an interrupted study goes on where it was.
KEEPING = ("machines", "dynamics", "robustness", "faults", "lost-phase", "arcs", "wrong-lxy")
#: The folder, in that of the results.
RUNS = "runs"
