"""The temperatures of the inverter's devices: a Foster chain for each, above one heat sink.

A leg has four devices, a switch and a diode at each rail. With the power P of a device, n = 1 .. 4:

    tau_n d theta_n/dt = R_n P - theta_n,     theta_junction = theta_sink + sum of theta_n
    tau_sink d theta_sink/dt = R_sink (sum of all P) - (theta_sink - ambient)

The compiled loop integrates the losses of conduction (meter.py) and adds up the energy of each
commutation (`commutate`). As with the machine's bodies (heat.py), every few milliseconds the
chains advance under their mean powers, exactly. Then each device's threshold and on-resistance
follow its junction.

A commutation's energy comes from the link's capacitor if there is one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .compiled import compiled
from .legs import (
    DEVICE_KINDS,
    HIGH,
    LOW,
    LOWER_DIODE,
    LOWER_SWITCH,
    UPPER_DIODE,
    UPPER_SWITCH,
)
from .link import DRIVE_J, V
from .meter import DEVICE_J, INTEGRALS

JUNCTIONS = np.dtype(
    [
        ("on", "i8"),  # 0: temperatures are not followed
        ("on_J_VA", "f8"),  # energies of a turn-on and a turn-off per volt and ampere
        ("off_J_VA", "f8"),
        ("vdc_V", "f8"),  # of a stiff link
        ("switching_J", "f8", (6, 4)),
        ("hottest_degC", "f8"),  # for a record
        ("sink_degC", "f8"),
    ]
)


@compiled
def _spend(inv, leg, device, J_VA, i):
    """A commutation of this current in a switch."""
    link = inv.link
    v = link.x[V] if link.on != 0 else inv.junctions.vdc_V
    energy_J = J_VA * v * i
    if link.on != 0:
        energy_J = min(energy_J, 0.5 * link.link_F * v * v)
        link.x[V] = np.sqrt(v * v - 2.0 * energy_J / link.link_F)
        link.x[DRIVE_J] += energy_J
    inv.junctions.switching_J[leg, device] += energy_J


@compiled
def commutate(inv, leg, before, after, i):
    """A leg with the current i changes its state. A switch that carries the current turns off, or
    one turns on that will carry it; other edges cost nothing."""
    if before == after:
        return
    j = inv.junctions
    if i > 0.0:
        if after == HIGH:
            _spend(inv, leg, UPPER_SWITCH, j.on_J_VA, i)
        elif before == HIGH:
            _spend(inv, leg, UPPER_SWITCH, j.off_J_VA, i)
    elif i < 0.0:
        if after == LOW:
            _spend(inv, leg, LOWER_SWITCH, j.on_J_VA, -i)
        elif before == LOW:
            _spend(inv, leg, LOWER_SWITCH, j.off_J_VA, -i)


def set_drops(devices: np.record, v_V: np.ndarray, r_ohm: np.ndarray) -> None:
    """Thresholds and on-resistances of the devices, (6, 4) on the legs in the order of
    DEVICE_KINDS, or (4,) if all legs are alike."""
    devices.v_V, devices.r_ohm = v_V, r_ohm
    devices.steepest_ohm = (devices.v_V / devices.knee_A + devices.r_ohm).max()
    devices.least_diode_V = devices.v_V[:, [UPPER_DIODE, LOWER_DIODE]].min()


class Junctions:
    """The temperatures of one inverter's devices, and its drops.

    junction_degC: (6, 4) on the legs, in the order of DEVICE_KINDS; sink_degC: of the heat sink;
    heat_J, ambient_J: the energy of the losses so far, and the part that has gone to the ambient.
    """

    def __init__(
        self, values: Mapping[str, Any], inverter: np.record, energies: Mapping[str, float]
    ) -> None:
        """values: the set-up's section [heat]; energies: e_on_mJ, e_off_mJ, e_ref_V, e_ref_A."""
        self._values, self._inverter = values, inverter
        self._lapse = values["time_lapse"]
        #: (4 devices, 4 pairs) each
        self._K_W = np.array([values[f"{kind}_K_W"] for kind in DEVICE_KINDS], float)
        self._s = np.array([values[f"{kind}_s"] for kind in DEVICE_KINDS], float)
        self.on = bool(self._K_W.any())
        self._rises = np.zeros((6, 4, 4))
        self.sink_degC = float(values["ambient_degC"])
        self.heat_J = self.ambient_J = 0.0
        # (4,) each: drops at `devices_degC`, and their relative change per kelvin.
        self._stated = inverter.devices.v_V[0].copy(), inverter.devices.r_ohm[0].copy()
        self._per_K = tuple(
            np.array([values[f"{kind}_{change}_per_K"] for kind in DEVICE_KINDS])
            for change in ("V", "ohm")
        )
        if self.on:
            inverter.junctions.on = inverter.meter.on = 1
        per_VA = energies["e_ref_V"] * energies["e_ref_A"]
        if self.on and per_VA > 0:
            inverter.junctions.on_J_VA = 1e-3 * energies["e_on_mJ"] / per_VA
            inverter.junctions.off_J_VA = 1e-3 * energies["e_off_mJ"] / per_VA
        if self.on:
            self._warm()

    @property
    def junction_degC(self) -> np.ndarray:
        return self.sink_degC + self._rises.sum(axis=2)

    @property
    def sink_J(self) -> float:
        """The heat that the sink stores above the ambient."""
        v = self._values
        if v["sink_K_W"] == 0:
            return 0.0
        return v["sink_s"] / v["sink_K_W"] * (self.sink_degC - v["ambient_degC"])

    def _warm(self) -> None:
        """The inverter gets the drops of its temperatures."""
        degC = self.junction_degC
        rise = degC - self._values["devices_degC"]
        drops = (
            cold * np.maximum(0.0, 1 + per_K * rise)
            for cold, per_K in zip(self._stated, self._per_K)
        )
        set_drops(self._inverter.devices, *drops)
        self._inverter.junctions.hottest_degC = degC.max()
        self._inverter.junctions.sink_degC = self.sink_degC

    def advance(self, time_s: float) -> None:
        """The losses that have been added up belong to this time."""
        j, x = self._inverter.junctions, self._inverter.meter.x
        joules = x[DEVICE_J:INTEGRALS].reshape(6, 4) + j.switching_J
        j.switching_J = x[DEVICE_J:INTEGRALS] = 0.0
        watts, lapse_s = joules / time_s, time_s * self._lapse
        ends = watts[:, :, None] * self._K_W
        self._rises = ends + (self._rises - ends) * np.exp(-lapse_s / self._s)
        v, total_W = self._values, float(watts.sum())
        self.heat_J += total_W * lapse_s
        end_degC = v["ambient_degC"] + v["sink_K_W"] * total_W
        stored_J = self.sink_J
        self.sink_degC = end_degC + (self.sink_degC - end_degC) * np.exp(-lapse_s / v["sink_s"])
        self.ambient_J += total_W * lapse_s - (self.sink_J - stored_J)
        self._warm()
