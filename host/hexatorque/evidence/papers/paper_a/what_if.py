"""Table IV of paper A with other assumptions for what the paper does not print. It shows on what
the switching frequency and the THD depend."""

from __future__ import annotations

import numpy as np

from .... import setups
from ....experiments.operating_points import Point
from ....recording.recording import Recording
from ..engine.job import Job
from ..printed_values import PAPER
from . import common as a

TABLE = PAPER[a.SETUP]
SPEED_RPM, LOAD_NM = TABLE["speed_rpm"], TABLE["load_Nm"]

#: Values that the paper does not print, and on which f_sw and THD depend: leakages relative to the
#: set-up's, and the thresholds of the inverter's devices [V].
LEAKAGES, DROPS_V = (1.0, 1.2, 1.35, 1.5), (0.0, 1.2)
NEAREST = (1.35, 1.2)  #: the pair whose f_sw is nearest to the printed one


def machine(leakage: float, drop_V: float) -> dict[str, float]:
    base = setups.load(a.SETUP)
    values = {f"machine__{key}": leakage * base[f"machine.{key}"] for key in ("lls_H", "llr_H")}
    return values | {"inverter__v_switch_V": drop_V, "inverter__v_diode_V": drop_V}


def _bands(factor: float) -> dict[str, float]:
    base = setups.load(a.SETUP)
    names = ("torque_band_Nm", "torque_inner_Nm", "flux_band_Wb")
    return {f"controller__{name}": factor * base.parameter(name) for name in names}


GAIN = "0.7 % gain error in set 2"
#: Readings of the paper other than the set-up's.
OTHERS: dict[str, dict] = {
    GAIN: {"sensors__i_gain": [1, 1.007] * 3},
    "table 45/135": {"controller__table": "45/135"},
    "bands are whole widths": _bands(0.5),
    "bands twice as wide": _bands(2.0),
    "torque released at half the band": {"controller__torque_release_Nm": 0.25},
    "flux hold off": {"controller__flux_hold": 0.0},
    "latency shadow": {"timing__latency": "shadow"},
}


def what_if(job: Job) -> dict:
    """Case -> scheme -> metrics. They are means over neighbouring speeds. A case is a pair
    (leakage, drop) or a key of OTHERS."""
    cases: dict = {(f, v): machine(f, v) for v in DROPS_V for f in LEAKAGES}
    cases |= {name: OTHERS[name] for name in (OTHERS if not job.quick else [GAIN])}
    near = a.NEAR[: 1 if job.quick else 3]
    points = [
        Point(a.setup(s, **values), n * SPEED_RPM, LOAD_NM)
        for values in cases.values()
        for s in a.SCHEMES
        for n in near
    ]
    found = iter(job.metrics(points))
    return {case: {s: _means([next(found) for _ in near]) for s in a.SCHEMES} for case in cases}


def _means(rows: list[dict | None]) -> dict[str, float]:
    flat = []
    for row in rows:
        if row is None:
            raise ArithmeticError("a variation of Table IV's point does not run")
        flat.append({**row, **row["thd_pct"]})
    keys = ("f_sw_Hz", "delta_i_A", "h5_pct", "torque_ripple_Nm", "flux_ripple_Wb", *a.BANDS)
    return {key: float(np.mean([row[key] for row in flat])) for key in keys}


def torque_step_Nm(rec: Recording) -> float:
    """Mean change of the true torque over a period in which a vector raises it. The latency is one
    period, so the vector follows from the comparator's level in the period before."""
    per = rec.meta["samples_per_period"]
    torque_Nm, level = rec["plant.torque_Nm"][::per], rec["torque_level"][::per]
    return float(np.diff(torque_Nm)[1:][level[:-2] == 1].mean())


def why_fsw(found: dict, rec: Recording) -> str:
    """Why f_sw differs. rec: a recording of FDR with the unchanged set-up."""
    whole_Nm = 2 * a.setup("fdr").parameter("torque_band_Nm")
    khz = {case: f"{row['fdr']['f_sw_Hz'] / 1e3:.2f}" for case, row in found.items()}
    fsw_Hz = [found[f, 0.0]["fdr"]["f_sw_Hz"] for f in LEAKAGES]
    printed_Hz = TABLE["schemes"]["fdr"]["f_sw_Hz"]
    text = (
        "The leakage is not printed. With the set-up's leakage, a period with a raising vector "
        f"adds {torque_step_Nm(rec):.2f} N m, more than the whole band of {whole_Nm:g} N m. The "
        "comparator then answers with the opposite vector instead of a zero vector. FDR has "
        + ", ".join(f"{khz[f, 0.0]} kHz at {f:g} times the leakage" for f in LEAKAGES[1:])
        + "."
    )
    if min(fsw_Hz) <= printed_Hz <= max(fsw_Hz):
        factor = np.interp(printed_Hz, fsw_Hz[::-1], LEAKAGES[::-1])
        text += f" The printed {printed_Hz / 1e3:g} kHz would need about {factor:.2f} times."
    others = [f"{name} {khz[name]}" for name in OTHERS if name in khz and name != GAIN]
    return text + (f" Other readings, in kHz: {', '.join(others)}." if others else "")


def why_thd(found: dict) -> str:
    plain, drops = found[1.0, 0.0], found[1.0, NEAREST[1]]
    near = found[NEAREST]
    five = a.arrow(plain["fdr"]["h5_pct"], drops["fdr"]["h5_pct"], "%", 1)
    return (
        "The devices' voltage drops are not printed, and they are 0 in the set-up. With drops of "
        f"{NEAREST[1]:g} V, FDR's 5th harmonic grows ({five}). DDR removes it, and the THD falls: "
        f"{a.arrow(drops['fdr']['5kHz'], drops['ddr']['5kHz'], '%', 1)}. DDR leaves switching "
        f"ripple, which depends on the leakage. With {NEAREST[0]:g} times the leakage and these "
        f"drops, the THD is {a.arrow(near['fdr']['5kHz'], near['ddr']['5kHz'], '%', 1)} at "
        f"{a.arrow(near['fdr']['f_sw_Hz'] / 1e3, near['ddr']['f_sw_Hz'] / 1e3, 'kHz', 2)}. "
        "The paper does not state its band; here it is 5 kHz."
    )


def case_name(case: tuple[float, float] | str) -> str:
    return case if isinstance(case, str) else f"{case[0]:g} x leakage, drops {case[1]:g} V"
