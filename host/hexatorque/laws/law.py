"""A law: the class that a user derives from, and the input of its step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal

import numpy as np

from ..errors import InputError
from ..firmware import ffi


class LawError(InputError):
    """A law that cannot be used, or that was stopped. It has the law's name."""


#: What a law's step sees: the C struct `ht_host_law_seen`, with planes as complex numbers.
SEEN = np.dtype(
    [
        ("i_A", "c8"),
        ("i_xy_A", "c8"),
        ("psi_Wb", "c8"),
        ("rotor_Wb", "c8"),
        ("sampled_i_A", "c8"),
        ("sampled_i_xy_A", "c8"),
        ("sampled_psi_Wb", "c8"),
        ("phases_A", "f4", (6,)),
        ("torque_Nm", "f4"),
        ("torque_ref_Nm", "f4"),
        ("flux_ref_Wb", "f4"),
        ("vdc_V", "f4"),
        ("omega_rad_s", "f4"),
        ("rotor_turn_rad", "f4"),
        ("speed_rad_s", "f4"),
        ("rs_ohm", "f4"),
        ("rr_ohm", "f4"),
        ("ts_s", "f4"),
        ("sigma_ls_H", "f4"),
        ("lxy_H", "f4"),
        ("lm_H", "f4"),
        ("lr_H", "f4"),
        ("pole_pairs", "f4"),
        ("torque_limit_Nm", "f4"),
        ("before", "u4"),
        ("period", "u4"),
    ]
)
assert SEEN.itemsize == ffi.sizeof("ht_host_law_seen")

#: Numbers that a step returns, by kind.
RETURNS = {"duties": 6, "vectors": 5}


def record(**fields: Any) -> np.record:
    """Memory of a law: a record with these fields, which hold numbers, complex numbers or arrays
    of them. A step reads and changes `memory.name`."""
    arrays = {name: np.asarray(value) for name, value in fields.items()}
    kinds = {"i": "i8", "u": "i8", "b": "i8", "f": "f8", "c": "c16"}
    dtype = np.dtype([(name, kinds[a.dtype.kind], a.shape) for name, a in arrays.items()])
    row = np.zeros(1, dtype).view(np.recarray)[0]
    for name, value in arrays.items():
        row[name] = value
    return row


class Law:
    """A law of one's own: derive from this class, and write `step`.

    name: what tables call it.
    returns: what `step` returns. "duties": six duty ratios of the legs u1 u2 w1 w2 v1 v2, each
    0..1; every leg toggles once a period, and the dead time is compensated. "vectors": three state
    words and two instants (s0, s1, s2, t1, t2) with 0 <= t1 <= t2 <= 1; the legs are at s0 from the
    period's start, at s1 from t1 and at s2 from t2 on. A state word has u1 in bit 5 and v2 in
    bit 0.
    compiled: whether numba compiles `step`. Without, a period takes some 20 us longer.
    reach_pu: radius of the largest circle of mean voltage, in units of V_dc: field weakening starts
    from there.
    """

    name: ClassVar[str] = ""
    returns: ClassVar[Literal["duties", "vectors"]] = "duties"
    compiled: ClassVar[bool] = True
    reach_pu: ClassVar[float] = 1 / math.sqrt(3)

    @staticmethod
    def step(seen: Any, memory: Any) -> Any:
        """The pattern of a period. It is a function: it has no `self`, and its state is in
        `memory`. It is called once a period while the drive is in RUN.

        seen has these fields; alpha-beta is a complex number alpha + j beta, x-y is x + j y, and
        where nothing else is said, the instant is the one at which the pattern begins:
        i_A, i_xy_A, psi_Wb (stator flux), rotor_Wb (psi - sigma L_s i), torque_Nm; the same of the
        sample: sampled_i_A, sampled_i_xy_A, sampled_psi_Wb, phases_A (six); vdc_V; references
        torque_ref_Nm, flux_ref_Wb; omega_rad_s (of the flux, electrical), rotor_turn_rad (of the
        latest period, electrical), speed_rad_s (of the shaft); rs_ohm, rr_ohm, sigma_ls_H, lxy_H,
        lm_H, lr_H, pole_pairs, torque_limit_Nm, ts_s; before (state word at the end of the period
        before), period (number of the call).
        """
        raise NotImplementedError

    def memory(self, parameters: Mapping[str, float | str]) -> np.record | None:
        """The memory of `step` at each start: a `record`, or None. `parameters` are the
        drive's, by name. Gains that follow from the machine are computed here."""
        return None

    @property
    def label(self) -> str:
        """The name in tables: `name`, or that of the class."""
        return self.name or type(self).__name__.lower()

    def entry(self, memory: np.record) -> Callable[..., int] | int | None:
        """Address of a C function in place of `step`; None: there is none. For laws in C."""
        return None
