"""The quantities of a drive from which its controller is designed.

`derived` makes the controller's parameters of them, `review` checks the parameters against them.
This module imports nothing that needs an installed package: see cmake/initial_values.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

from ..chips import number_of
from ..plant.machines import DISPLACEMENTS_DEG, parameters_of
from ..plant.rectifier import RECTIFIED_PEAK
from .values import Values

#: Length of the mean vector of three large vectors, and the circle inside the polygon of these
#: vectors, in units of Vdc (ht_schemes.def).
VECTOR_PU = 0.5977
REACH_PU = 0.5774
#: Share of the reachable voltage that steady operation may use. The rest is for control.
USABLE = 0.9
#: Reach of a switching table, relative to 75/105, for which the schemes' reaches hold
#: (ht_table_law.c: WIDE_TABLE_REACH).
TABLE_SHARE = {"45/135": math.cos(math.pi / 4) / math.cos(math.pi / 12), "75/105": 1.0}
#: Below this share of the sensors' range a current is taken for the rated one if no rated torque
#: is known.
RATED_SHARE = 0.4
#: A speed is held if it is off by this share of rated speed at most.
SPEED_HELD = 0.02
#: Share of the pull-out torque that the firmware asks for at most.
PULL_OUT_SHARE = number_of("app/ht_configure.h", "HT_PULL_OUT_SHARE")


def rad_s(rpm: float) -> float:
    return rpm * math.pi / 30


def rpm(rad_s: float) -> float:
    return rad_s * 30 / math.pi


def _three_digits(value: float) -> float:
    return float(f"{value:.3g}")


class Demand(NamedTuple):
    """Speed, load and voltage of the source at the same moment."""

    speed_rpm: float
    load_Nm: float
    vdc_V: float


def highest_source_V(setup: Values) -> float:
    """To which the link's source charges a capacitor without a load, the profile's steps too."""
    highest = max([setup["inverter.vdc_V"], *(volts for _, volts in setup.profile.vdc_V)])
    return highest * (RECTIFIED_PEAK if setup["inverter.line_Hz"] > 0 else 1.0)


def below_source(setup: Values, path: str, off_V: float) -> str | None:
    """A line if a chopper that is on down to this voltage would heat with the source's energy."""
    highest_V = highest_source_V(setup)
    if off_V > highest_V:
        return None
    return f"{path} = {off_V:g}: allowed is more than {highest_V:g} V, the source's voltage"


class Design:
    """A set-up with the controller parameters that are in force. `parameter(name)` gives one."""

    def __init__(self, setup: Values, parameter: Callable[[str], Any]) -> None:
        self.setup, self.parameter = setup, parameter

    # -- machine ---------------------------------------------------------------------------

    @property
    def magnets(self) -> bool:
        """Whether the rotor has permanent magnets."""
        return hasattr(self.unsaturated, "psi_f_Wb")

    @cached_property
    def unsaturated(self) -> Any:
        """The machine's parameters, of the class of its model."""
        return parameters_of(self.setup["machine.model"])(**self.setup.machine_values())

    @cached_property
    def machine(self) -> Any:
        """The linear machine at the flux reference."""
        return self.unsaturated if self.magnets else self.unsaturated.linear_at(self.flux_Wb)

    def tag(self, name: str) -> str:
        """The source of a value of the machine; empty if no file gives it."""
        given = self.setup.values["machine"].get(name)
        return given.tag if given else ""

    @property
    def winding(self) -> int:
        """Number of the winding, the firmware's ht_winding."""
        return DISPLACEMENTS_DEG.index(int(self.unsaturated.displacement_deg))

    @property
    def steady_Wb(self) -> float:
        """The flux at which a steady state is asked for: the flux reference. With magnets each
        torque has its own, and the flux reference follows from the largest one."""
        return self.machine.psi_f_Wb if self.magnets else self.flux_Wb

    @property
    def flux_Wb(self) -> float:
        return self.parameter("flux_ref_Wb")

    @property
    def sigma(self) -> float:
        return self.machine.sigma_ls_H / self.machine.ls_H

    @property
    def rotor_s(self) -> float:
        """Rotor time constant L_r/R_r."""
        return self.machine.lr_H / self.machine.rr_ohm

    @property
    def no_load_A(self) -> float:
        """Amplitude of the magnetising current."""
        return self.machine.no_load_A(self.steady_Wb)

    @property
    def pull_out_Nm(self) -> float:
        """The most torque at the full flux."""
        return self.machine.pull_out_Nm(self.flux_Wb)

    @property
    def slip_Nm(self) -> float:
        """The torque whose slip at the full flux is `encoder_trip_rpm`; infinity with magnets."""
        p = self.parameter
        rotor_ohm = p("rr_ohm") * (p("lm_H") / p("lr_H")) ** 2 if not self.magnets else 0.0
        slip_rad_s = p("pole_pairs") * rad_s(p("encoder_trip_rpm"))
        if rotor_ohm == 0 or slip_rad_s == 0:
            return math.inf
        return 3 * p("pole_pairs") * slip_rad_s / rotor_ohm * self.flux_Wb**2

    def current_A(self, torque_Nm: float) -> float:
        """Amplitude of the current at this torque and the full flux; with magnets, of the least
        current."""
        return self.machine.current_A(torque_Nm, self.steady_Wb)

    def torque_of_current_Nm(self, current_A: float) -> float:
        """The torque at the full flux at which the current has this amplitude."""
        return self.machine.torque_of_current_Nm(current_A, self.steady_Wb)

    # -- rated values ----------------------------------------------------------------------

    @cached_property
    def asked_rpm(self) -> float:
        """The fastest speed of point, profile and speed reference, with which a board starts; 0 if
        there is none."""
        profile = self.setup.profile
        steps = [v for _, v in profile.speed_rpm]
        steps += [v for _, name, v in profile.set if name == "speed_ref_rpm"]
        asked = (self.setup["point.speed_rpm"], self.parameter("speed_ref_rpm"), *steps)
        return max(abs(float(value)) for value in asked)

    @cached_property
    def asked_Nm(self) -> float:
        """The largest load of point and profile; 0 if there is none."""
        steps = self.setup.profile.load_Nm
        return max(abs(value) for value in (self.setup["point.load_Nm"], *(v for _, v in steps)))

    @cached_property
    def asked(self) -> list[Demand]:
        """The demands that come together, with a load: the point and each moment of the profile."""
        profile = self.setup.profile
        courses = ((profile.speed_rpm, 0.0), (profile.load_Nm, 0.0), (profile.vdc_V, self.vdc_V))
        together = [
            Demand._make(
                abs(([first] + [v for t, v in of if t <= now])[-1]) for of, first in courses
            )
            for now, _ in (step for of, _ in courses for step in of)
        ]
        speed_rpm, load_Nm = (abs(self.setup[f"point.{key}"]) for key in ("speed_rpm", "load_Nm"))
        together.append(Demand(speed_rpm, load_Nm, self.vdc_V))
        return [one for one in together if one.load_Nm > 0]

    @cached_property
    def demands(self) -> list[Demand]:
        """The same; and rated speed and torque if the speed is stated, or if nothing is asked."""
        if self.setup["rated.speed_rpm"] > 0 or not self.asked:
            return [*self.asked, Demand(self.rated_rpm, self.rated_Nm, self.vdc_V)]
        return self.asked

    @cached_property
    def rated_Nm(self) -> float:
        """The stated rated torque; else that of the stated rated current; else the largest that
        point and profile ask; else that of a share of the sensors' range."""
        stated_Nm, stated_A = self.setup["rated.torque_Nm"], self.setup["rated.current_A"]
        if stated_Nm > 0:
            return stated_Nm
        most_Nm = math.inf if self.magnets else PULL_OUT_SHARE * self.pull_out_Nm
        if (of_current_Nm := self.torque_of_current_Nm(math.sqrt(2) * stated_A)) > 0:
            return min(of_current_Nm, most_Nm)
        if self.asked_Nm > 0:
            return self.asked_Nm
        current_A = max(RATED_SHARE * self.setup["sensors.i_full_A"], 1.2 * self.no_load_A)
        of_current_Nm = self.torque_of_current_Nm(current_A)
        return of_current_Nm if self.magnets else min(of_current_Nm, 0.5 * self.pull_out_Nm)

    @cached_property
    def rated_rpm(self) -> float:
        """The stated rated speed, or the one that the voltage reaches at the full flux, but not
        less than point and profile ask."""
        stated = self.setup["rated.speed_rpm"]
        return stated if stated > 0 else max(self.base_rpm(), self.asked_rpm)

    @property
    def fastest_rpm(self) -> float:
        """The larger of asked and stated rated speed, or `rated_rpm` if there is neither."""
        return max(self.asked_rpm, self.setup["rated.speed_rpm"]) or self.rated_rpm

    @property
    def steady_point(self) -> tuple[float, float]:
        """Speed and load at which schemes are compared: those of the set-up's point; without a
        speed in it, half of rated speed, and of rated torque unless it has a load."""
        speed_rpm, load_Nm = self.setup["point.speed_rpm"], self.setup["point.load_Nm"]
        if speed_rpm == 0:
            speed_rpm = _three_digits(0.5 * self.rated_rpm)
            load_Nm = load_Nm or _three_digits(0.5 * self.rated_Nm)
        return speed_rpm, load_Nm

    @cached_property
    def rated_A(self) -> float:
        """Amplitude of the stated rated current, or of that at rated torque."""
        stated = self.setup["rated.current_A"]
        return math.sqrt(2) * stated if stated > 0 else self.current_A(self.rated_Nm)

    def reach_pu(self, of_scheme: float, by_table: bool = False) -> float:
        """Largest circle of mean voltage of a scheme with `of_scheme` in its row, units of Vdc.
        by_table: with the switching table in force. Sets that are not 30 degrees apart have a
        table of their own and the circle of sets that make the same voltage."""
        if self.winding:
            return min(of_scheme, REACH_PU)
        return of_scheme * TABLE_SHARE[self.parameter("table")] if by_table else of_scheme

    def base_rpm(self, reach_pu: float = REACH_PU, usable: float = USABLE) -> float:
        """Speed at which the rated torque at the full flux needs all usable voltage. 0 if the
        resistance alone takes it."""
        reach_V = usable * reach_pu * self.vdc_V
        turned = self.machine.turned_rad_s(self.rated_Nm, self.flux_Wb, reach_V)
        return max(0.0, rpm(turned / self.machine.pole_pairs))

    def most_torque_Nm(self, speed_rpm: float, voltage_V: float) -> float:
        """The torque at which the firmware limits its reference at this speed if the flux is
        as weak as this voltage needs it."""
        omega = self.machine.pole_pairs * rad_s(speed_rpm)
        most_A = 0.8 * self.parameter("i_trip_A")
        return self.machine.most_torque_Nm(omega, self.flux_Wb, voltage_V, most_A, PULL_OUT_SHARE)

    def runaway_rpm(self, corner_rad_s: float) -> float:
        """The rise of the speed when the rated load drops. The speed loop with k_p = J w and
        k_i = k_p w/4 has a double pole at w/2, so the rise is (T/J) t exp(-w t/2), and largest at
        t = 2/w."""
        return rpm(2 / math.e * self.rated_Nm / (self.machine.inertia_kgm2 * corner_rad_s))

    def slip_rad_s(self, torque_Nm: float) -> float:
        """Electrical slip at a torque and the full flux."""
        return self.machine.slip_rad_s(torque_Nm, self.steady_Wb)

    def copper_W(self, torque_Nm: float) -> float:
        """Losses of the windings of stator and rotor at a torque and the full flux."""
        stator_W = 3 * self.machine.rs_ohm * self.current_A(torque_Nm) ** 2
        return stator_W + self.slip_rad_s(torque_Nm) * abs(torque_Nm) / self.machine.pole_pairs

    # -- inverter and sampling -------------------------------------------------------------

    @property
    def vdc_V(self) -> float:
        return self.setup["inverter.vdc_V"]

    @cached_property
    def links_V(self) -> list[float]:
        """The voltages of the source, those of the profile too, and that of a link that a rectifier
        charges without a load."""
        volts = [self.vdc_V, *(volts for _, volts in self.setup.profile.vdc_V)]
        highest = highest_source_V(self.setup)
        return volts if highest in volts else [*volts, highest]

    @property
    def period_s(self) -> float:
        return 1 / self.parameter("f_isr_Hz")

    def flux_step_Wb(self, period_s: float, vector_pu: float = VECTOR_PU) -> float:
        """The step of the stator flux in one period of an active vector."""
        return vector_pu * self.vdc_V * period_s

    def torque_step_Nm(self, period_s: float, vector_pu: float = VECTOR_PU) -> float:
        """The step of the torque in one period at standstill."""
        step_Wb = self.flux_step_Wb(period_s, vector_pu)
        return self.machine.torque_step_Nm(self.steady_Wb, step_Wb)

    @property
    def ripple(self) -> float:
        """Current step of one period in units of the magnetising current."""
        return self.flux_step_Wb(self.period_s) / (self.sigma * self.flux_Wb)

    @property
    def align_step_A(self) -> float:
        """The overshoot of the current that aligns magnets. The modulator, which needs
        shadow load, holds it; else whole periods of a vector make it."""
        step_Wb = self.flux_step_Wb(self.period_s)
        return step_Wb / self.machine.ld_H if self.parameter("load_mode") == "immediate" else 0.0

    @property
    def dead_V(self) -> float:
        """Mean voltage that the dead time takes from a leg."""
        return self.setup["inverter.dead_time_us"] * 1e-6 * self.vdc_V / self.period_s

    def conduction_W(self, torque_Nm: float) -> float:
        """Losses of the inverter's devices while they conduct: a sinusoidal current flows through
        six legs, each time through a switch or a diode."""
        i_A, of = self.current_A(torque_Nm), self.setup.__getitem__
        drop_V = 0.5 * (of("inverter.v_switch_V") + of("inverter.v_diode_V"))
        on_ohm = 0.5 * (of("inverter.r_switch_ohm") + of("inverter.r_diode_ohm"))
        return 6 * (drop_V * 2 * i_A / math.pi + on_ohm * i_A**2 / 2)

    def switching_W(self, torque_Nm: float, f_sw_Hz: float) -> float:
        """Losses of turning on and off. In each cycle of a leg its current commutates once from a
        switch to a diode and once back. 0 if the set-up does not state the energies."""
        of = self.setup.__getitem__
        energy_J = 1e-3 * (of("inverter.e_on_mJ") + of("inverter.e_off_mJ"))
        if energy_J == 0:
            return 0.0
        share = self.vdc_V / of("inverter.e_ref_V") / of("inverter.e_ref_A")
        return 6 * f_sw_Hz * energy_J * share * 2 * self.current_A(torque_Nm) / math.pi

    def magnetised_s(self, current_A: float) -> float:
        """Time until the rotor's flux is within 1 % of its final value in a build-up with this
        current. At constant current the rotor's flux rises with L_r/R_r until the stator's flux
        has its reference. From then on, at constant stator flux, with sigma L_r/R_r."""
        settle_s = 5 * self.sigma * self.rotor_s
        excess = current_A / self.no_load_A
        if excess <= 1:
            return math.inf
        rise = (1 - self.sigma) * excess / (excess - 1)
        return self.rotor_s * max(0.0, math.log(rise)) + settle_s
