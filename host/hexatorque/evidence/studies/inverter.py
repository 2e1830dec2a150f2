"""The inverter's error voltage against the phase current.

The rotor is locked. A slow ramp of direct voltage is applied along alpha, by plain PWM without any
compensation. Each period gives the mean leg voltage of u1 minus the commanded one, and the mean
current. Far from zero the dead time costs Vdc t_dead / Ts against the current. Around zero the
ripple changes the sign of the current within the period. Currents that reach zero in the dead time
leave their leg floating. Both signs then share the loss.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import njit

from ... import firmware, setups
from ...experiments.operating_points import Progress
from ...plant.inverter import advance, inverter_record, set_leg
from ...plant.legs import HIGH, LOW, OFF
from ...plant.load import LOAD
from ...plant.machine import phase_current
from ...plant.machines.induction import Parameters, make
from ...plant.record import names_of, record
from ...plant.vsd import ANGLES_RAD
from .grids import Grid

TITLE = "Inverter: error voltage of a leg"
CLOCK_HZ, PERIOD = 100e6, 10_000  #: counts: 10 kHz
DEAD_TIME_US = 2.3
I_MAX_A = 1.0
PERIODS = 4000  #: number of periods of the ramp
#: Steps in counts while a leg is off, and otherwise. v_leg is read after each step.
FINE, COARSE = 5, 100
#: Columns of a ramp's table.
CURRENT, ERROR, BEGIN, END, RISE, FALL = range(6)
DROPS = {"v_switch_V": 1.2, "v_diode_V": 1.0, "r_switch_ohm": 0.02, "r_diode_ohm": 0.02}


@dataclass(frozen=True)
class Curve:
    """One leg's error voltage: the mean of each period over its mean current."""

    name: str
    i_A: np.ndarray
    error_V: np.ndarray


@dataclass(frozen=True)
class Result:
    vdc_V: float
    dead_time_us: float
    period_us: float
    curves: tuple[Curve, ...]  #: of ideal devices, of devices with drops, of the firmware's model

    @property
    def plateau_V(self) -> float:
        """Vdc t_dead / Ts."""
        return self.vdc_V * self.dead_time_us / self.period_us


@njit
def _ramp(inv, m, load, y, vdc, dead, share, table):
    """Simulates the ramp and fills `table`, a row per period, for u1. `share` (periods, 6) has the
    duty ratios. u1 and u2 are high in the middle of the period, the others around its ends. This
    makes ripple."""
    count = np.empty(24, np.int64)
    leg_of = np.empty(24, np.int64)
    state = np.empty(24, np.int64)
    for p in range(len(share)):
        for leg in range(6):
            width = np.int64(np.floor(share[p, leg] * PERIOD + 0.5))
            rise = (PERIOD - width) // 2
            fall = rise + width
            if leg > 1:
                rise, fall = (rise + PERIOD // 2) % PERIOD, (fall + PERIOD // 2) % PERIOD
            if leg == 0:
                table[p, RISE] = rise
                table[p, FALL] = fall
            at = (rise, rise + dead, fall, fall + dead)
            to = (OFF, HIGH, OFF, LOW)
            for e in range(4):
                count[4 * leg + e] = at[e]
                leg_of[4 * leg + e] = leg
                state[4 * leg + e] = to[e]
        order = np.argsort(count)
        table[p, BEGIN] = phase_current(m, y, 0)
        volt_s = 0.0
        amp_s = 0.0
        now = 0
        e = 0
        while now < PERIOD:
            while e < 24 and count[order[e]] == now:
                set_leg(inv, m, y, leg_of[order[e]], state[order[e]])
                e += 1
            stop = min(PERIOD, now + (FINE if inv.off > 0 else COARSE))
            if e < 24:
                stop = min(stop, count[order[e]])
            i = phase_current(m, y, 0)
            advance(inv, m, load, y, (stop - now) / CLOCK_HZ, vdc)
            amp_s += 0.5 * (i + phase_current(m, y, 0)) * (stop - now)
            volt_s += inv.v_leg[0] * (stop - now)
            now = stop
        table[p, END] = phase_current(m, y, 0)
        table[p, CURRENT] = amp_s / PERIOD
        table[p, ERROR] = (volt_s - vdc * (table[p, FALL] - table[p, RISE])) / PERIOD


def _measure(setup: setups.Setup, **drops: float) -> np.ndarray:
    """The table of a ramp with these devices."""
    machine = Parameters(**(setup.machine_values() | {"inertia_kgm2": 1e9}))
    m, vdc = make(machine), setup["inverter.vdc_V"]
    dead = round(setup["inverter.dead_time_us"] * 1e-6 * CLOCK_HZ)
    lost = vdc * dead / PERIOD + max(drops.values(), default=0.0)
    # The ramp is computed to end above +I_MAX_A, because the rising flux takes part of the voltage.
    volts = np.linspace(-1, 1.5, PERIODS) * (machine.rs_ohm * I_MAX_A + lost)
    share = 0.5 + volts[:, None] * np.cos(ANGLES_RAD) / vdc
    y = np.zeros(8)  # direct current flows at the start, but none in the rotor
    y[0], y[4] = -machine.ls_H * I_MAX_A, -machine.lm_H * I_MAX_A
    inv = inverter_record(**drops)
    for leg in range(6):
        set_leg(inv, m, y, leg, HIGH if leg > 1 else LOW)
    load = record(LOAD, **{name: float(name == "eddy_rad_s") for name in names_of(LOAD)})
    table = np.empty((PERIODS, 6))
    _ramp(inv, m, load, y, vdc, dead, share, table)
    return table


def _belief_V(setup: setups.Setup, table: np.ndarray) -> np.ndarray:
    """The result of ht_volt_seconds for the same edges and the currents at the period's ends.
    Only u1 switches, which contributes a third to alpha and to x."""
    ffi, lib = firmware.ffi, firmware.lib
    dead_pu = setup["inverter.dead_time_us"] * 1e-6 * CLOCK_HZ / PERIOD
    dead = ffi.new("ht_dead_time *", {"dead_pu": dead_pu, "i_zero_A": setup.parameter("i_zero_A")})
    carry = ffi.new("ht_carry *")
    volts = []
    for row in table:
        rise, fall = row[RISE] / PERIOD, row[FALL] / PERIOD
        applied = ffi.new("ht_applied *", {"s": [0, 32, 0], "t": [0.0, rise, fall]})
        lib.ht_applied_finish(applied, 0, dead)
        begin, end = ({"p": [row[n]] * 6} for n in (BEGIN, END))
        flows = (lib.ht_flow_of([i], dead) for i in (begin, end))
        flow = lib.ht_flow_at_edges(applied, *flows)
        v = lib.ht_volt_seconds(applied, ffi.NULL, dead, flow, [begin], [end], carry, carry, True)
        volts.append(1.5 * (v.ab.alpha + v.xy.x) - (fall - rise))
    return setup["inverter.vdc_V"] * np.array(volts)


def curves(setup: setups.Setup | None = None) -> Result:
    """Simulates the ramp with ideal devices and with drops (DROPS), and computes the firmware's
    model. The default set-up is paper B's drive with DEAD_TIME_US."""
    if setup is None:
        setup = setups.load("paper-b").changed(inverter__dead_time_us=DEAD_TIME_US)
    ideal, real = _measure(setup), _measure(setup, **DROPS)
    found = (
        Curve("ideal devices", ideal[:, CURRENT], ideal[:, ERROR]),
        Curve("with conduction drops", real[:, CURRENT], real[:, ERROR]),
        Curve("firmware's model", ideal[:, CURRENT], _belief_V(setup, ideal)),
    )
    period_us = 1e6 * PERIOD / CLOCK_HZ
    return Result(setup["inverter.vdc_V"], setup["inverter.dead_time_us"], period_us, found)


def _line(curve: Curve, bins: int = 160) -> tuple[np.ndarray, np.ndarray]:
    """Means over narrow intervals of current. They remove the rounding of the duty."""
    edges = np.linspace(-I_MAX_A, I_MAX_A, bins + 1)
    where = np.digitize(curve.i_A, edges)
    used = [k for k in range(1, bins + 1) if np.any(where == k)]
    return (
        np.array([curve.i_A[where == k].mean() for k in used]),
        np.array([curve.error_V[where == k].mean() for k in used]),
    )


def study(quick: bool = False, progress: Progress | None = None) -> dict:
    """The curves as plain data. `quick` has no effect: each curve is one ramp."""
    result = curves()
    lines = {curve.name: _line(curve) for curve in result.curves}
    return {
        "vdc_V": result.vdc_V,
        "dead_time_us": result.dead_time_us,
        "period_us": result.period_us,
        "plateau_V": result.plateau_V,
        "curves": [
            {"name": name, "i_A": i.tolist(), "error_V": error.tolist()}
            for name, (i, error) in lines.items()
        ],
    }


def failures(result: dict) -> list[str]:
    """This study has no limits, so nothing can fail."""
    return []


def grid(result: dict) -> Grid:
    curves = result["curves"]
    rows = [
        [f"{i_A:g}", *(f"{np.interp(i_A, c['i_A'], c['error_V']):+.2f}" for c in curves)]
        for i_A in (-0.9, -0.4, -0.2, -0.1, 0.0, 0.1, 0.2, 0.4, 0.9)
    ]
    title = f"mean leg voltage minus command [V], {_point(result)}"
    return [(title, ["current [A]", *(curve["name"] for curve in curves)], rows)]


def _point(result: dict) -> str:
    return (
        f"dead time {result['dead_time_us']:g} µs, {result['vdc_V']:g} V, "
        f"{1e3 / result['period_us']:g} kHz"
    )


def plot(result: dict, path: str | Path) -> Path:
    """Draws the curves as a PNG file."""
    from ...analysis.plots import INK, LABEL, LEGEND, new_figure, save
    from ...analysis.plots import TITLE as HEADING

    figure, axes = new_figure(1, 1, 5.2, 8.5)
    ax = axes[0, 0]
    level = result["plateau_V"]
    for sign in (1, -1):
        ax.axhline(sign * level, color="#9aa1ab", linewidth=0.9, linestyle=(0, (4, 3)))
    ax.text(0.98 * I_MAX_A, -0.98 * level, f"$-V_{{dc}}\\,t_{{dead}}/T_s$ = {-level:.2f} V",
            fontsize=8, color=INK, ha="right", va="bottom")  # fmt: skip
    styles = (("#0072b2", 2.2, "-"), ("#d55e00", 1.6, "-"), ("#20242b", 1.3, (0, (5, 2))))
    for curve, (colour, width, dash) in zip(result["curves"], styles, strict=True):
        ax.plot(curve["i_A"], curve["error_V"], color=colour, linewidth=width, linestyle=dash,
                label=curve["name"])  # fmt: skip
    ax.set_xlim(-I_MAX_A, I_MAX_A)
    ax.set_ylim(-1.35 * level, 1.35 * level)
    ax.set_xlabel("mean phase current [A]", **LABEL)
    ax.set_ylabel("mean leg voltage minus command [V]", **LABEL)
    ax.set_title(f"{TITLE}, {_point(result)}", **HEADING)
    ax.legend(loc="center right", bbox_to_anchor=(1, 0.7), **LEGEND)
    return save(figure, path)
