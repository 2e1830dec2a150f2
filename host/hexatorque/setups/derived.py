"""The rules by which controller parameters follow from the rest of a set-up.

Each rule is a row of a table: the parameter, the rule in words, and its formula. `hexatorque
setups FILE` shows the words.

There are two tables. The rules of ALWAYS hold in every set-up: the controller gets the values of
machine, inverter, sensors and timing. The rules of OPEN design the parameters that are left open,
and hold only if the set-up says `defaults = "derived"`. That is so unless a file, or the one from
which it starts, says `defaults = "firmware"`. The set-ups of the papers do: their results were
measured with the firmware's defaults for what the papers do not print, and a value that is
redesigned with each change of the machine would make their studies of a single change say nothing.

Only a parameter that the set-up does not give follows a rule. A rule may use other parameters,
given ones or derived ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

from ..chips import number_of, range_of
from ..plant.machines import constants_of
from .design import PULL_OUT_SHARE, REACH_PU, USABLE, Design, rad_s, rpm
from .keys import ESTIMATED, USER
from .values import Values

#: What a set-up has where it leaves a parameter open: see above.
DEFAULTS = ("derived", "firmware")

#: Share of the converter's range at which a current trips.
I_TRIP_SHARE = 0.85
#: Sampling frequencies; the second one where a period of the first moves the torque too far. Not
#: where only the x-y current of dtc2 and dtc3 asks for it: two machines in five would switch twice
#: as often under every scheme.
F_ISR_HZ, F_ISR_FAST_HZ = 10e3, 20e3
#: That far, in rated torques.
LONGEST_STEP = 0.8
#: The fast interrupt's result must be written well within the period.
WRITTEN_WITHIN = 0.8
#: Frequencies of the speed loop. Each divides both sampling frequencies.
F_SLOW_HZ = (100.0, 200.0, 500.0, 1000.0)
#: No-load current over rated current where no flux is stated: the median of the published machines.
#: Too much flux saturates a machine, too little costs current.
NO_LOAD_SHARE = 0.4
#: A load that is asked for is at most the second share of the pull-out torque; the first one where
#: the voltage turns such a flux at the load's speed. Near pull-out a leakage and an R_r that are
#: 30 % off make the torque so wrong that the torque limit does not carry the load at low speed.
ASKED_OF_PULL_OUT, MOST_OF_PULL_OUT = 0.4, 0.5
#: And at least this one, as of two in three published machines: of more flux a machine with little
#: no-load current has no use, and it saturates.
LEAST_OF_PULL_OUT = 0.25
#: Torque limit over rated torque.
LIMIT_PER_RATED = 1.5
#: And over the pull-out torque, if that leaves the rated torque: a leakage that is a quarter larger
#: and a flux that is 8 % smaller than believed leave 0.65 of it.
LIMIT_PER_PULL_OUT = 0.65
LEAST_NM, MOST_NM = range_of("torque_limit_Nm")
#: By this share of rated speed the shaft may run away when the rated load drops; and by the second
#: one it may where the inertia is an estimate: a stiffer loop has no use, and none is stable on a
#: shaft that is as many times lighter.
RUNAWAY, STIFFEST = 0.3, 0.03
#: The stator resistance in use may be so far off, where the speed does not let it adapt. One that
#: is told or estimated may be 30 % too small: the machine's is 43 % larger.
RESISTANCE_OFF, TOLD_RESISTANCE_OFF = 0.15, 0.43
#: An error of the rotor's resistance shows in its flux after its time constant.
ADAPT_S, ADAPT_PER_ROTOR = 1.0, 2.0
#: L_m at the flux reference over one that is told or estimated: unsaturated, a machine has 1.1 to
#: 1.8 times as much as at its rated flux. The magnetising current is then as many times smaller.
MORE_MAIN = 1.5
#: Low pass of the lost leg's residual.
LEAST_SAMPLES = number_of("core/ht_voltage_law.h", "HT_LEAST_SAMPLES")
LOSS_FILTER_S = number_of("core/ht_leg_loss.h", "HT_LEG_LOSS_FILTER_S")
#: x-y voltage of six legs without current, over the dead-time voltage. The drive takes half of an
#: edge's dead time there, and all of it, or nothing, may act. The longest sum of six vectors that
#: are 30 degrees apart, each along or against its axis, is 1 / sin 15 degrees; x-y has a third.
SIX_LEGS = 0.5 / 3 / math.sin(math.pi / 12)
#: sigma L_s over L_xy from which `db-ipwm` has least distortion by default: the ripple that its
#: carriers move from the torque into x-y is then many times as large as a current.
CLEAN_FROM = 3.0
#: Slow periods in 2 pi of the speed loop's corner.
SLOW_PER_CORNER = 30
#: A shaft may be so many times lighter than one whose inertia is an estimate. The loop is then as
#: many times quicker: from about six times on it is unstable at SLOW_PER_CORNER.
LIGHTER = 5


@dataclass(frozen=True)
class Rule:
    text: str
    value: Callable[[Known], Any]


class Known(Design):
    """The controller parameters of a set-up by name, each worked out when it is asked for."""

    def __init__(
        self, setup: Values, initial: Mapping[str, Any], left_open: Collection[str] = ()
    ) -> None:
        """initial: the firmware's defaults; left_open: parameters that follow their rules although
        the set-up gives them."""
        super().__init__(setup, self.__getitem__)
        self._initial = initial
        self.rules = rules_of(setup)
        given = setup.values["controller"].items()
        self._values = {key: value.value for key, value in given if key not in left_open}

    def __getitem__(self, name: str) -> Any:
        if name not in self._values:
            rule = self.rules.get(name)
            self._values[name] = rule.value(self) if rule else self._initial[name]
        return self._values[name]


#: With inverter.precharge_ohm.
PRECHARGE = {
    "precharge_V": Rule("0.8 of the source's voltage", lambda k: 0.8 * k.setup["inverter.vdc_V"]),
}
#: With load.holding_Nm: the drive waits a little longer than the brake takes.
BRAKE = {
    "brake_open_s": Rule(
        "1.2 of load.holding_open_s + 10 ms", lambda k: 1.2 * k.setup["load.holding_open_s"] + 0.01
    ),
    "brake_close_s": Rule(
        "1.2 of load.holding_close_s + 10 ms",
        lambda k: 1.2 * k.setup["load.holding_close_s"] + 0.01,
    ),
}


def _hot_ohm(k: Known, kind: str) -> float:
    """On-resistance of a device at device_limit_degC."""
    rise_K = k["device_limit_degC"] - k.setup["heat.devices_degC"]
    share = 1 + k.setup[f"heat.{kind}_ohm_per_K"] * rise_K
    return k.setup[f"inverter.r_{kind}_ohm"] * max(share, 0.0)


def _device_nJ_VA(k: Known) -> float:
    of = k.setup.__getitem__
    energy_nJ = 1e6 * (of("inverter.e_on_mJ") + of("inverter.e_off_mJ"))
    return energy_nJ / (of("inverter.e_ref_V") * of("inverter.e_ref_A")) if energy_nJ else 0.0


def _switching_W(d: Design) -> float:
    """Switching loss of a leg with the amplitude of rated current, as the drive computes it."""
    return 1e-9 * d.parameter("device_nJ_VA") * d.parameter("f_isr_Hz") * d.vdc_V * d.rated_A


def _leg_W(d: Design) -> float:
    """The same of all losses of this leg."""
    volts = d.parameter("drop_V") + d.parameter("device_ohm") * d.rated_A
    return volts * d.rated_A + _switching_W(d)


def device_rise_K(d: Design) -> float:
    """The hottest leg's temperature above the heat sink, as the drive computes it, with rated
    current at a standstill."""
    return float(d.parameter("device_K_W")) * _leg_W(d)


def _hottest(k: Known) -> tuple[str, float]:
    """Kind of the hottest device of this leg, and its rise above the heat sink. Switch and diode
    carry the current for half of the time each; the switch has the commutations."""
    i_A, rises_K = k.rated_A, {}
    for kind in ("switch", "diode"):
        conducts_W = 0.5 * (k.setup[f"inverter.v_{kind}_V"] + _hot_ohm(k, kind) * i_A) * i_A
        watts = conducts_W + (_switching_W(k) if kind == "switch" else 0.0)
        rises_K[kind] = sum(k.setup[f"heat.{kind}_K_W"]) * watts
    hottest = max(rises_K, key=rises_K.__getitem__)
    return hottest, rises_K[hottest]


def _device_K_W(k: Known) -> float:
    leg_W = _leg_W(k)
    device_K_W = _hottest(k)[1] / leg_W if leg_W > 0 else 0.0
    sink_K_W = 0.0 if k["sink_ntc_ohm"] > 0 else 6 * k.setup["heat.sink_K_W"]
    return min(device_K_W + sink_K_W, range_of("device_K_W")[1])


def _device_s(k: Known) -> float:
    hottest, _ = _hottest(k)
    chain_K_W, times_s = (k.setup[f"heat.{hottest}_{unit}"] for unit in ("K_W", "s"))
    mean_s = sum(r * t for r, t in zip(chain_K_W, times_s)) / (sum(chain_K_W) or 1.0)
    least_s, most_s = range_of("device_s")
    return min(max(mean_s / k.setup["heat.time_lapse"], least_s), most_s)


#: With heat.switch_K_W or diode_K_W.
DEVICES = {
    "device_nJ_VA": Rule("e_on_mJ + e_off_mJ, over e_ref_V e_ref_A", _device_nJ_VA),
    "device_ohm": Rule(
        "mean on-resistance of switch and diode at device_limit_degC",
        lambda k: 0.5 * (_hot_ohm(k, "switch") + _hot_ohm(k, "diode")),
    ),
    "device_K_W": Rule(
        "rise of the hottest device over the loss of its leg, with rated current that stands: "
        "switch and diode carry half of the time each; without a thermistor 6 times sink_K_W more, "
        "as if all legs were as hot",
        _device_K_W,
    ),
    "device_s": Rule(
        "of this device: mean of its time constants, weighted with their resistances, over "
        "time_lapse of [heat]",
        _device_s,
    ),
}


def standing_leg_W(setup: Values, values: Mapping[str, Any]) -> float:
    """Loss of the leg that carries the amplitude of rated current at a standstill, by
    drops and energies of [inverter], with or without temperatures. values: the controller's."""
    known = Known(setup, values, left_open=DEVICES)
    known.rules = {**known.rules, **DEVICES}
    return _leg_W(known)


def has_chains(setup: Values) -> bool:
    """Whether the devices of the simulated power stage have temperatures."""
    return any((*setup["heat.switch_K_W"], *setup["heat.diode_K_W"]))


def rules_of(setup: Values) -> dict[str, Rule]:
    """The rules in force, by parameter."""
    told, designed = ALWAYS, OPEN
    if "psi_f_Wb" in constants_of(setup["machine.model"]):
        told = {**{k: r for k, r in ALWAYS.items() if k not in OF_A_WINDING}, **ALWAYS_MAGNET}
        designed = {**{k: r for k, r in OPEN.items() if k not in OF_A_WINDING}, **OPEN_MAGNET}
    if setup["inverter.precharge_ohm"] > 0:
        told = {**told, **PRECHARGE}
    if setup["load.holding_Nm"] > 0:
        told = {**told, **BRAKE}
    if has_chains(setup):
        told = {**told, **DEVICES}
    return {**told, **designed} if setup.defaults == "derived" else told


def write_delay_us(setup: Values) -> float:
    """Counter zero to register write."""
    if setup["timing.latency"] == "none":
        return setup["sensors.sample_delay_us"]
    return setup["sensors.sample_delay_us"] + setup["timing.isr_us"]


def _immediate(setup: Values) -> bool:
    return setup["timing.latency"] in ("none", "immediate")


def _mean_of_devices(setup: Values, what: str, unit: str) -> float:
    """Switches and diodes share the time that a leg carries its current."""
    return 0.5 * sum(setup[f"inverter.{what}_{device}_{unit}"] for device in ("switch", "diode"))


#: Thermistors: the parameters have the names of the sensors' keys.
THERMISTORS = (
    "winding_ntc_ohm", "winding_ntc_K", "sink_ntc_ohm", "sink_ntc_K", "ntc_pull_up_ohm",
)  # fmt: skip


#: Of the absolute encoder, what the drive must be told.
ABSOLUTE = ("absolute_counts_rev", "absolute_direction")


def _of_sensors(name: str) -> Rule:
    return Rule("the sensors'", lambda k: k.setup[f"sensors.{name}"])


ALWAYS: dict[str, Rule] = {
    "machine": Rule("the machine's: magnets, or a winding", lambda k: k.unsaturated.ROTOR),
    "displacement_deg": Rule("the machine's", lambda k: f"{k.machine.displacement_deg:g}"),
    "pole_pairs": Rule("the machine's", lambda k: k.machine.pole_pairs),
    "rs_ohm": Rule(
        "the machine's R_s + mean on-resistance of switch and diode",
        lambda k: k.machine.rs_ohm + _mean_of_devices(k.setup, "r", "ohm"),
    ),
    "drop_V": Rule(
        "mean threshold of switch and diode", lambda k: _mean_of_devices(k.setup, "v", "V")
    ),
    "sigma_ls_H": Rule(
        "the machine's L_s - L_m^2/L_r at the flux reference", lambda k: k.machine.sigma_ls_H
    ),
    "lxy_H": Rule("the machine's", lambda k: k.machine.lxy_H),
    "rr_ohm": Rule("the machine's", lambda k: k.machine.rr_ohm),
    "lr_H": Rule("the machine's L_lr + L_m at the flux reference", lambda k: k.machine.lr_H),
    "lm_H": Rule("the machine's at the flux reference", lambda k: k.machine.lm_H),
    "iron_hysteresis_A_Wb": Rule("the machine's", lambda k: k.machine.iron_hysteresis_A_Wb),
    "iron_eddy_S": Rule("the machine's", lambda k: k.machine.iron_eddy_S),
    "dead_time_us": Rule("the inverter's", lambda k: k.setup["inverter.dead_time_us"]),
    "i_full_A": Rule("the sensors'", lambda k: k.setup["sensors.i_full_A"]),
    "vdc_full_V": Rule("the sensors'", lambda k: k.setup["sensors.vdc_full_V"]),
    **{name: _of_sensors(name) for name in (*THERMISTORS, *ABSOLUTE)},
    "link_F": Rule("the dc link's", lambda k: k.setup["inverter.link_F"]),
    "winding_K_W": Rule("of [heat]", lambda k: k.setup["heat.winding_K_W"]),
    "winding_s": Rule(
        "of [heat], over its time_lapse",
        lambda k: k.setup["heat.winding_s"] / k.setup["heat.time_lapse"],
    ),
    "frame_K_W": Rule("of [heat]", lambda k: k.setup["heat.frame_K_W"]),
    "frame_s": Rule(
        "of [heat], over its time_lapse",
        lambda k: k.setup["heat.frame_s"] / k.setup["heat.time_lapse"],
    ),
    "ambient_degC": Rule("of [heat]", lambda k: k.setup["heat.ambient_degC"]),
    "rs_degC": Rule("ohm_degC of [heat]", lambda k: k.setup["heat.ohm_degC"]),
    "encoder_counts_rev": Rule(
        "4 counts a pulse of the encoder", lambda k: 4 * k.setup["sensors.encoder_ppr"]
    ),
    "load_mode": Rule(
        "of timing.latency", lambda k: "immediate" if _immediate(k.setup) else "shadow"
    ),
    "predict": Rule(
        "of timing.latency",
        lambda k: "on" if k.setup["timing.latency"] == "predicted" else "off",
    ),
    "write_delay_us": Rule(
        "sample delay + timing.isr_us with immediate load, else 0",
        lambda k: write_delay_us(k.setup) if _immediate(k.setup) else 0.0,
    ),
    "i_sum_trip_A": Rule(
        "10 % of the sensors' range", lambda k: max(0.01, 0.1 * k.setup["sensors.i_full_A"])
    ),
    "i_ab_trip_A": Rule("1.2 i_trip_A", lambda k: 1.2 * k["i_trip_A"]),
    "flux_trip_Wb": Rule("2.5 flux_ref_Wb", lambda k: 2.5 * k["flux_ref_Wb"]),
}


def _flux_ref_Wb(k: Known) -> float:
    """Without saturation curve and rated flux, voltage, current and sensors limit the flux."""
    m = k.unsaturated
    stated = k.setup["rated.flux_Wb"]
    if stated > 0:
        return stated

    def pulled_Wb(share: float, load_Nm: float = k.asked_Nm) -> float:
        """The flux at which a load, else the largest one, is this share of the pull-out torque."""
        return math.sqrt(load_Nm / (share * m.pull_out_Nm(1.0)))

    def turned_Wb(speed_rpm: float) -> float:
        if speed_rpm == 0:
            return math.inf
        return 0.9 * USABLE * REACH_PU * k.vdc_V / (m.pole_pairs * rad_s(speed_rpm))

    # Point and profile may need more: at low speed the voltage lets it, on the way up the field is
    # weakened. Each load counts at its own speed.
    needed_Wb = pulled_Wb(MOST_OF_PULL_OUT)
    for one in k.asked:
        reserve_Wb = pulled_Wb(ASKED_OF_PULL_OUT, one.load_Nm)
        needed_Wb = max(needed_Wb, min(reserve_Wb, turned_Wb(one.speed_rpm)))
    limits = [0.2 * k.setup["sensors.i_full_A"] * m.ls_H]
    if k.setup["rated.current_A"] > 0:
        by_current_Wb = NO_LOAD_SHARE * math.sqrt(2) * k.setup["rated.current_A"] * m.ls_H
        limits.append(max(by_current_Wb, needed_Wb))
    elif k.asked_Nm > 0 and k.setup["rated.torque_Nm"] == 0:
        # The no-load current has the same share of the current at this load.
        across = math.sqrt(1 / NO_LOAD_SHARE**2 - 1)
        by_load_Wb = math.sqrt(k.asked_Nm * m.ls_H / (3 * m.pole_pairs * across))
        limits.append(max(min(by_load_Wb, pulled_Wb(LEAST_OF_PULL_OUT)), needed_Wb))
    if m.psi_knee_Wb > 0:
        limits.append(0.8 * m.psi_knee_Wb)
    if k.setup["rated.speed_rpm"] > 0:
        limits.append(turned_Wb(k.setup["rated.speed_rpm"]))
    else:
        limits.append(max(turned_Wb(k.asked_rpm), needed_Wb))
    return min(max(min(limits), 0.002), 40.0)


def _f_isr_Hz(k: Known) -> float:
    carried = write_delay_us(k.setup) * 1e-6 < WRITTEN_WITHIN / F_ISR_FAST_HZ
    too_far = k.torque_step_Nm(1 / F_ISR_HZ) > LONGEST_STEP * k.rated_Nm
    # Below this the firmware refuses the laws that predict; beyond the faster one too.
    refused = F_ISR_HZ < _least_f_isr_Hz(k) <= F_ISR_FAST_HZ
    return F_ISR_FAST_HZ if carried and (too_far or refused) else F_ISR_HZ


def _least_f_isr_Hz(k: Known) -> float:
    """Lowest sampling frequency of the laws that predict (ht_voltage_law_least_Hz)."""
    return LEAST_SAMPLES * k["rs_ohm"] / min(k["lxy_H"], k.machine.least_H)


def _fitting_Hz(k: Known) -> list[float]:
    """Frequencies of which the sampling frequency is a multiple."""
    f_isr_Hz = k["f_isr_Hz"]
    return [f for f in F_SLOW_HZ if (f_isr_Hz / f).is_integer()] or [F_SLOW_HZ[0]]


def _stiff_Hz(k: Known) -> float:
    """The lowest of them with which the shaft does not run away."""
    rise_rpm = RUNAWAY * k.rated_rpm
    if k.magnets:  # the speed trip may be near: no current may flow after it
        rise_rpm = min(rise_rpm, LEAST_INERTIA * (k["speed_trip_rpm"] - k.rated_rpm))
    fit = _fitting_Hz(k)
    enough = [f for f in fit if k.runaway_rpm(corner_rad_s(f)) <= rise_rpm]
    return min(enough, default=max(fit))


def _estimated_inertia(k: Known) -> bool:
    return k.tag("inertia_kgm2") == ESTIMATED


def _f_slow_Hz(k: Known) -> float:
    fit, wanted_Hz = _fitting_Hz(k), _stiff_Hz(k)
    if _estimated_inertia(k):
        wanted_Hz *= LIGHTER
    return min((f for f in fit if f >= wanted_Hz), default=max(fit))


def _loop_rad_s(k: Known) -> float:
    """Corner of the speed loop."""
    f_slow_Hz: float = k["f_slow_Hz"]
    if not _estimated_inertia(k):
        return corner_rad_s(f_slow_Hz)
    corner, rise_rpm = corner_rad_s(min(f_slow_Hz, _stiff_Hz(k))), STIFFEST * k.rated_rpm
    return min(corner, k.runaway_rpm(1.0) / rise_rpm) if rise_rpm > 0 else corner


def _torque_limit_Nm(k: Known) -> float:
    by_current = k.torque_of_current_Nm(0.8 * k["i_trip_A"])
    rated_Nm = k.rated_Nm if k.setup["rated.torque_Nm"] > 0 else max(k.rated_Nm, k.asked_Nm)
    careful_Nm = max(rated_Nm, LIMIT_PER_PULL_OUT * k.pull_out_Nm)
    limits = (LIMIT_PER_RATED * rated_Nm, careful_Nm, PULL_OUT_SHARE * k.pull_out_Nm, by_current)
    return min(max(LEAST_NM, min(limits)), MOST_NM)


def _loss_check(k: Known) -> float:
    step_A = 2 * k.setup["sensors.i_full_A"] / 4096
    noise_V = k.machine.lxy_H * step_A / LOSS_FILTER_S
    # While the flux falls to that of least loss, all six currents may pass through zero together,
    # and no leg's dead time is known.
    unknown = SIX_LEGS if k["flux_least_loss"] == "on" else 0.3
    least_V = max(0.012 * k.vdc_V, unknown * k.dead_V, 10 * noise_V)
    return min(least_V / k["vdc_max_V"], 1.0)


def _build_current_A(k: Known) -> float:
    return min(2.5 * k.no_load_A, 0.6 * k["i_trip_A"])


def _build_s(k: Known) -> float:
    return min(max(0.3, k.magnetised_s(k["build_current_A"])), 10.0)


def _crossover_Hz(k: Known) -> float:
    error_Hz = k.dead_V / (2 * math.pi * k.flux_Wb)
    return min(max(2.0, 3 * error_Hz * k.ripple), 10.0)


def _flux_check(k: Known) -> float:
    off = TOLD_RESISTANCE_OFF if _uncertain(k, "rs_ohm") else RESISTANCE_OFF
    moved_Wb_s = off * k["rs_ohm"] * k.current_A(k["torque_limit_Nm"])
    known = max(0.7, 1.5 * k.ripple, k.rotor_s * moved_Wb_s / k.flux_Wb)
    return min(known + (1 - 1 / MORE_MAIN if _uncertain(k, "lm_H") else 0.0), 10.0)


def _uncertain(k: Known, key: str) -> bool:
    """Told or an estimate."""
    return k.tag(key) in (USER, ESTIMATED)


def corner_rad_s(f_slow_Hz: float) -> float:
    return 2 * math.pi * f_slow_Hz / SLOW_PER_CORNER


# Gains, also of a machine that was measured (hexatorque.commissioning).


def ki_speed(kp_Nms_rad: float, loop_rad_s: float) -> float:
    return kp_Nms_rad * loop_rad_s / 4


def kp_xy(lxy_H: float, vdc_V: float, period_s: float) -> float:
    return 0.25 * lxy_H / (vdc_V * period_s)


def ki_xy(kp_pu_A: float) -> float:
    return 25 * kp_pu_A


#: The design of what a set-up leaves open.
OPEN: dict[str, Rule] = {
    "flux_ref_Wb": Rule(
        "rated.flux_Wb; without it the least of: 20 % of the sensors' range times L_s, 40 % of "
        "rated.current_A times L_s (without it, of the current at the largest load of point and "
        "profile, or what makes this load 25 % of the pull-out torque), 80 % of psi_knee_Wb, 90 % "
        "of what the usable voltage turns at rated.speed_rpm (without it, at the fastest speed of "
        "point and profile); the second and the last are as much as makes this load half of the "
        "pull-out torque; 40 % if the voltage turns that at the fastest speed with a load",
        _flux_ref_Wb,
    ),
    "flux_min_Wb": Rule("20 % of flux_ref_Wb", lambda k: 0.2 * k.flux_Wb),
    "flux_reserve_Nm": Rule("half of rated torque", lambda k: 0.5 * k.rated_Nm),
    "f_isr_Hz": Rule(
        "10 kHz; 20 kHz if one period of 100 us moves the torque by more than 80 % of rated, or if "
        "it has less than five periods in L_xy/R_s or sigma L_s/R_s, and 20 kHz has them",
        _f_isr_Hz,
    ),
    "f_slow_Hz": Rule(
        "the lowest of 100, 200, 500, 1000 Hz with which the shaft runs away by 30 % of rated "
        "speed at most when the rated load drops; five times as much where the inertia is an "
        "estimate",
        _f_slow_Hz,
    ),
    "table": Rule("75/105, which reaches the full voltage", lambda k: "75/105"),
    "flux_band_Wb": Rule(
        "1 % of flux_ref_Wb, but half the flux step of one period at least",
        lambda k: max(0.01 * k.flux_Wb, 0.5 * k.flux_step_Wb(k.period_s)),
    ),
    "flux_hold": Rule(
        "2 %, but 1.5 times the flux band at least",
        lambda k: min(max(0.02, 1.5 * k["flux_band_Wb"] / k.flux_Wb), 0.2),
    ),
    "torque_band_Nm": Rule(
        "5 % of rated torque, but a quarter of the torque step of one period at least",
        lambda k: max(0.05 * k.rated_Nm, 0.25 * k.torque_step_Nm(k.period_s)),
    ),
    "torque_inner_Nm": Rule(
        "torque_band_Nm / sqrt 3", lambda k: k["torque_band_Nm"] / math.sqrt(3)
    ),
    "torque_limit_Nm": Rule(
        "1.5 times rated torque, or the largest load of point and profile if no torque is stated "
        "and that is larger; but at most 65 % of pull-out where that is above the rated torque, "
        "80 % in any case, and what 80 % of i_trip_A gives",
        _torque_limit_Nm,
    ),
    "kp_speed_Nms_rad": Rule(
        "inertia times the loop's corner, 2 pi f_slow_Hz / 30; where it is an estimate 2 pi / 30 "
        "times the frequency that suffices, but at most the one with which the shaft runs away by "
        "3 % of rated speed when the rated load drops",
        lambda k: min(k.machine.inertia_kgm2 * _loop_rad_s(k), 1e5),
    ),
    "ki_speed_Nm_rad": Rule(
        "kp_speed times a quarter of the corner: critical damping",
        lambda k: min(ki_speed(k["kp_speed_Nms_rad"], _loop_rad_s(k)), 1e6),
    ),
    "kp_xy_pu_A": Rule(
        "0.25 L_xy/(Vdc T_s): with both frames half the current is corrected in one period",
        lambda k: min(kp_xy(k.machine.lxy_H, k.vdc_V, k.period_s), 10.0),
    ),
    "ki_xy_pu_As": Rule(
        "25 kp_xy per second: slow against the current, quick against the speed",
        lambda k: min(ki_xy(k["kp_xy_pu_A"]), 1000.0),
    ),
    "crossover_Hz": Rule(
        "3 times (dead-time voltage / 2 pi flux) times (current step of one period / no-load "
        "current), 2 .. 10 Hz: the rebuilt voltage is the worse the more the current ripples",
        _crossover_Hz,
    ),
    "adapt_s": Rule(
        "twice L_r/R_r, 1 s at least: until then the fluxes of the two models do not tell what is "
        "wrong",
        lambda k: min(max(ADAPT_S, ADAPT_PER_ROTOR * k.rotor_s), 1000.0),
    ),
    "i_trip_A": Rule(
        "85 % of the sensors' range", lambda k: I_TRIP_SHARE * k.setup["sensors.i_full_A"]
    ),
    "i_zero_A": Rule(
        "0.2 % of the sensors' range: four steps of a 12-bit converter",
        lambda k: min(0.002 * k.setup["sensors.i_full_A"], 10.0),
    ),
    "stuck_trip_A": Rule("4 % of the sensors' range", lambda k: 0.04 * k.setup["sensors.i_full_A"]),
    "loss_check": Rule(
        "1.2 % of Vdc, but 30 % of the dead-time voltage at least (with flux_least_loss 64 %), and "
        "10 times L_xy/2 ms times a step of a 12-bit converter; over vdc_max_V",
        _loss_check,
    ),
    "build_current_A": Rule(
        "2.5 times the no-load current, but at most 60 % of i_trip_A", _build_current_A
    ),
    "build_s": Rule(
        "until the rotor's flux is within 1 %: L_r/R_r while the current is at its limit, then 5 "
        "sigma L_r/R_r; 0.3 .. 10 s",
        _build_s,
    ),
    "flux_check": Rule(
        "0.7, but 1.5 times the current step of one period at least, and at least 15 % (43 % where "
        "rs_ohm is told or an estimate) of L_r/R_r R_s times the current at the torque limit over "
        "the flux, in no-load currents: at low speed a resistance that is so far off moves the "
        "flux as fast, and the rotor follows; a third more where lm_H is told or an estimate: a "
        "machine with 1.5 times as much takes so much less",
        _flux_check,
    ),
    "encoder_trip_rpm": Rule(
        "150 r/min, but 3 times the rated slip",
        lambda k: max(150.0, 90 / math.pi * k.slip_rad_s(k.rated_Nm) / k.machine.pole_pairs),
    ),
    "speed_trip_rpm": Rule(
        "1.5 times the larger of rated speed and the speed that the voltage reaches, but 1.2 times "
        "the fastest speed of point, profile and speed_ref_rpm at least",
        lambda k: min(max(1.5 * max(k.rated_rpm, k.base_rpm(), 100.0), 1.2 * k.asked_rpm), 9e4),
    ),
    "thd_share": Rule(
        f"1 where sigma L_s is more than {CLEAN_FROM:g} times L_xy, else 0: where L_xy is small, "
        "the ripple of interleaved carriers distorts the currents",
        lambda k: 1.0 if k["sigma_ls_H"] > CLEAN_FROM * k["lxy_H"] else 0.0,
    ),
    "vdc_max_V": Rule(
        "1.4 Vdc, but at most 94 % of the sensor's range",
        lambda k: min(1.4 * k.vdc_V, 0.94 * k.setup["sensors.vdc_full_V"]),
    ),
    "vdc_min_V": Rule("60 % of Vdc", lambda k: 0.6 * k.vdc_V),
    "vdc_band_V": Rule("4 % of Vdc, but at least 0.1 V", lambda k: max(0.04 * k.vdc_V, 0.1)),
}

#: Rules that a rotor with magnets has no use for.
OF_A_WINDING = (
    "rr_ohm", "lr_H", "lm_H", "sigma_ls_H", "adapt_s",
)  # fmt: skip

#: What the controller is told of a machine with magnets.
ALWAYS_MAGNET: dict[str, Rule] = {
    "psi_f_Wb": Rule("the machine's", lambda k: k.machine.psi_f_Wb),
    "ld_H": Rule("the machine's", lambda k: k.machine.ld_H),
    "sigma_ls_H": Rule("the machine's L_q", lambda k: k.machine.lq_H),
    "emf5_share": Rule("the machine's", lambda k: k.machine.emf_share[0]),
    "emf5_deg": Rule("the machine's", lambda k: k.machine.emf_deg[0]),
    "emf7_share": Rule("the machine's", lambda k: k.machine.emf_share[1]),
    "emf7_deg": Rule("the machine's", lambda k: k.machine.emf_deg[1]),
}

#: Corner of the pull to the flux of the magnets, in R_s i/psi_f.
PULL_PER_DROP = 3.0
LEAST_PULL_HZ = 5.0
#: A shaft that direct current holds swings; so many swings until it rests.
SWINGS = 4.0
#: Distance of the two models' fluxes that is no longer believable, in psi_f: half a radian.
LARGEST_GAP = 0.5
#: Slow mean of the encoder's counts.
COUNTS_SLOW_S = number_of("app/ht_configure.h", "HT_COUNTS_SLOW_S")
#: Share of the harmonics in the induced voltage that must not look like a lost leg, over 1.6.
UNTOLD_EMF = 0.05
#: Of rated current, the least that aligns.
LEAST_ALIGN = 0.1
LEAST_FLUX_WB, _ = range_of("flux_min_Wb")
#: True inertia over the stated one, at least.
LEAST_INERTIA = 0.6
#: Distance of the speed trip from the speed at which the magnets would drive current by themselves.
BELOW_CEILING = 0.98


def _flux_of_limit_Wb(k: Known) -> float:
    """With magnets a torque decides about its flux: this is the largest that is asked for."""
    limit_Nm = k["torque_limit_Nm"]
    return k.machine.flux_Wb(*k.machine.least_current(limit_Nm))


def _magnet_torque_limit_Nm(k: Known) -> float:
    by_current = k.machine.torque_of_current_Nm(0.8 * k["i_trip_A"], 0.0)
    rated_Nm = k.rated_Nm if k.setup["rated.torque_Nm"] > 0 else max(k.rated_Nm, k.asked_Nm)
    return min(max(LEAST_NM, min(LIMIT_PER_RATED * rated_Nm, by_current)), MOST_NM)


def _pull_Hz(k: Known) -> float:
    rated_A = k.machine.current_A(k.rated_Nm, 0.0)
    pull = PULL_PER_DROP * k["rs_ohm"] * rated_A / (2 * math.pi * k.machine.psi_f_Wb)
    return min(max(LEAST_PULL_HZ, pull), 500.0)


def _untold_emf(k: Known) -> float:
    # The residual's low pass leaves w/sqrt(1 + (5 w t)^2) of the fifth harmonic, 1/(5 t) at most.
    filtered_V = 2 * 1.6 * UNTOLD_EMF * k.machine.psi_f_Wb / (5 * LOSS_FILTER_S)
    used_V = UNTOLD_EMF * USABLE * REACH_PU * k.vdc_V
    return min(min(filtered_V, used_V) / k["vdc_max_V"], 1.0)


def _align_A(k: Known) -> float:
    rated_A = k.machine.current_A(k.rated_Nm, 0.0)
    stiffest_A = 0.5 * k.machine.turning_A - k.align_step_A
    return min(rated_A, 0.6 * k["i_trip_A"], max(stiffest_A, LEAST_ALIGN * rated_A))


def _align_s(k: Known) -> float:
    swing_rad_s = k.machine.swing_rad_s(k["build_current_A"])
    return min(max(1.0, SWINGS * 2 * math.pi / swing_rad_s), 10.0) if swing_rad_s else 10.0


def _jump_rpm(k: Known) -> float:
    """The load may help the machine to turn back."""
    most_Nm = k["torque_limit_Nm"] + max(k.rated_Nm, k.asked_Nm)
    return max(40.0, rpm(most_Nm / (LEAST_INERTIA * k.machine.inertia_kgm2) * COUNTS_SLOW_S))


def _magnet_speed_trip_rpm(k: Known) -> float:
    wanted = max(1.5 * max(k.rated_rpm, k.base_rpm(), 100.0), 1.2 * k.asked_rpm)
    if k["trip_state"] == "short-circuit":
        return min(wanted, 9e4)
    return min(wanted, BELOW_CEILING * k.machine.ceiling_rpm(k.vdc_V), 9e4)


#: The design of a drive with magnets, where it is another one.
OPEN_MAGNET: dict[str, Rule] = {
    "flux_ref_Wb": Rule("flux of the torque limit with its least current", _flux_of_limit_Wb),
    "flux_min_Wb": Rule(
        "20 % of the smaller of psi_f and flux_ref_Wb, and the firmware's least value",
        lambda k: max(LEAST_FLUX_WB, 0.2 * min(k.machine.psi_f_Wb, k.flux_Wb)),
    ),
    "loss_check": Rule(
        OPEN["loss_check"].text
        + "; without harmonics in machine.emf_share at least twice what the "
        "check sees of 8 % of them, or 2.6 % of Vdc: they may be there",
        lambda k: max(_loss_check(k), 0.0 if any(k.machine.emf_share) else _untold_emf(k)),
    ),
    "torque_limit_Nm": Rule(
        "1.5 times rated torque, or the largest load of point and profile if no torque is stated "
        "and that is larger; but at most the torque of 80 % of i_trip_A",
        _magnet_torque_limit_Nm,
    ),
    "crossover_Hz": Rule(
        "3 R_s times rated current over psi_f, 5 .. 500 Hz: a resistance that is 30 % wrong then "
        "moves the flux by a tenth",
        _pull_Hz,
    ),
    "build_current_A": Rule(
        "rated current, but at most 60 % of i_trip_A, and half of psi_f/(L_q - L_d), which turns "
        "the q axis there (with the step of a period under immediate load); 10 % of rated current "
        "at least: it aligns the rotor",
        _align_A,
    ),
    "build_s": Rule("4 swings of the shaft that direct current holds; 1 .. 10 s", _align_s),
    "flux_check": Rule(
        "0.5: the two models' fluxes may be so many psi_f apart", lambda k: LARGEST_GAP
    ),
    "encoder_trip_rpm": Rule(
        "change of speed in 3 ms by torque limit plus rated torque, with 60 % of the inertia, "
        "40 r/min at least: no real shaft changes its speed as quickly",
        _jump_rpm,
    ),
    "f_slow_Hz": Rule(
        OPEN["f_slow_Hz"].text + ", and with 60 % of the inertia not to the speed trip",
        _f_slow_Hz,
    ),
    "speed_trip_rpm": Rule(
        "as of an induction machine, but at most 98 % of the speed at which the magnets induce Vdc "
        "between two terminals, unless trip_state is short-circuit",
        _magnet_speed_trip_rpm,
    ),
}
