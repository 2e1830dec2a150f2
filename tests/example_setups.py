"""The examples that are set-ups: all but those that describe a sweep."""

import tomllib
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def example_setups() -> list[Path]:
    files = sorted(EXAMPLES.glob("*.toml"))
    return [file for file in files if "vary" not in tomllib.loads(file.read_text())]


#: The least keys that a set-up needs.
LEAST = """
[machine]
pole_pairs = {pole_pairs}
rs_ohm = {rs}
rr_ohm = {rr}
lls_H = {leakage}
llr_H = {leakage}
lm_H = {lm}
inertia_kgm2 = {inertia}
[inverter]
vdc_V = {vdc}
dead_time_us = 2
[sensors]
i_full_A = {i_full}
vdc_full_V = 1200
encoder_ppr = 2048
[timing]
device = "f28377s"
latency = "predicted"
[controller]
scheme = "ddr"
"""
SMALL = LEAST.format(
    pole_pairs=1, rs=6.7, rr=6.9, leakage=9e-3, lm=0.614, inertia=0.02, vdc=600, i_full=12
)
LARGE = LEAST.format(
    pole_pairs=2, rs=0.03, rr=0.02, leakage=3e-4, lm=0.012, inertia=2.0, vdc=700, i_full=800
)
