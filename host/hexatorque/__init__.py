"""hexatorque: switching-table direct torque control of six-phase drives.

The C firmware in `firmware/` is the controller; this package closes the loop
around it (`sil`), describes set-ups (`scenario`), keeps what comes out
(`recording`) and evaluates it (`analysis`). Heavy modules load on first use.
"""

__version__ = "0.1.0"
