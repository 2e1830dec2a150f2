"""A second drive for comparison with the plant. It has the same gate edges, but other equations,
another integrator and other diode logic.

States: the free stator currents u1 u2 w1 w2, the rotor's two currents in the stationary frame, the
speed. The inductances are those of conftest's coils at rotor angle 0. For the stator, a turning
cage differs from a standing one only by the voltage of motion.

A leg with both switches open is tied to the rail of the diode that its current opens. The instant
at which the current reaches zero is found as a root. From then on a constraint holds the current at
zero. The leg's voltage keeps this constraint, and is checked until it leaves the rails. Both
instants are searched between edges that enclose a sign change. This is sufficient as long as
switches are open in dead times only. When a leg is broken, the search is in pieces of BROKEN_S.

A leg can break. A dead switch leaves both switches open when it alone should be closed. An open
phase has an arc, a constant voltage against its current, until the current is zero. From then on
the same constraint holds the current at zero, whatever the voltage is.
"""

import numpy as np
from numba import njit
from scipy.integrate import ode, solve_ivp
from scipy.optimize import brentq

from hexatorque.plant.legs import BREAK, HIGH, KINDS, LOW, OFF

#: A third state besides the rails LOW and HIGH: the diodes block, and there is no current.
FLOATS = -1
RTOL, ATOL = 1e-11, 1e-12
BROKEN_S = 10e-6
ROUNDING_A = 1e-12
#: Rail of the diode that conducts, by the sign of the current.
DIODES = {1: LOW, -1: HIGH, 0: FLOATS}
#: Commands that leave both switches of a leg open.
DEAD = {"blocked": (LOW, HIGH), "upper": (HIGH,), "lower": (LOW,)}


@njit(cache=True)
def slopes(_, x, a):
    """dx/dt. Rows 0..5 of `a` have the linear terms (6), the terms times speed (6) and the constant
    (1). Row 6 has torque per inertia for each pair of a stator and a rotor current (8), friction
    and load."""
    out = np.empty(7)
    w = x[6]
    for r in range(6):
        total = a[r, 12]
        for c in range(6):
            total += (a[r, c] + w * a[r, 6 + c]) * x[c]
        out[r] = total
    total = -a[6, 8] * w - a[6, 9]
    for c in range(4):
        total += x[c] * (a[6, c] * x[4] + a[6, 4 + c] * x[5])
    out[6] = total
    return out


class Compiled:
    """Hairer's DOP853. On such short intervals it is some ten times as fast as solve_ivp."""

    def __init__(self):
        # The first step tried is the whole interval.
        # A function of Python: older SciPy cannot count the arguments of a compiled one.
        self._ode = ode(lambda t, x, a: slopes(t, x, a)).set_integrator(
            "dop853", rtol=RTOL, atol=ATOL, first_step=1.0
        )

    def __call__(self, x, dt, a):
        x = self._ode.set_f_params(a).set_initial_value(x).integrate(dt)
        assert self._ode.successful()
        return x


def interpreted(x, dt, a):
    done = solve_ivp(slopes, (0, dt), x, "DOP853", rtol=RTOL, atol=ATOL, args=(a,))
    assert done.success
    return done.y[:, -1]


class DriveReference:
    """model: PhaseModel; a constant load torque."""

    def __init__(self, model, vdc_V, load_Nm, integrate=None, arc_V=0.0):
        p = model.p
        self.vdc_V = vdc_V
        self.arc_V = arc_V
        self.integrate = integrate or Compiled()
        self._free = model.free
        self._rotor = model.rotor
        basis = np.block([[model.free, np.zeros((6, 2))], [np.zeros((6, 4)), model.rotor]])
        inductance = basis.T @ model.inductance(0.0) @ basis
        coils = np.concatenate([model.r_stator, np.full(6, p.rr_ohm)])
        motion = np.zeros((6, 6))
        motion[4:] = p.pole_pairs * np.array([[0, -1], [1, 0]]) @ inductance[4:]
        self._inverse = np.linalg.inv(inductance)
        self._linear = -self._inverse @ basis.T @ np.diag(coils) @ basis
        self._motion = self._inverse @ motion
        torque = [
            model.torque(stator, rotor, 0.0) for rotor in model.rotor.T for stator in model.free.T
        ]
        shaft = [*torque, p.viscous_Nms, load_Nm]
        self._shaft = np.array(shaft) / p.inertia_kgm2
        self._ties = {}
        self.legs = [OFF] * 6
        self.diodes = [FLOATS] * 6  #: rail of each open leg's conducting diode
        self.blocked = self.reopened = 0  #: how often diodes changed
        self.commands = [OFF] * 6
        self.kinds = ["none"] * 6
        self.arcs = [0] * 6  #: sign of the current in an open phase
        self.arc_s = 0.0  #: how long arcs burnt

    def start(self, i_s, i_r, omega, legs):
        """Start from these currents and leg states. The rotor's currents are those in coils that
        stand at angle 0. The diodes follow from the currents."""
        self.x = np.concatenate([i_s[:4], self._rotor.T @ i_r / 3, [omega]])
        for leg, state in enumerate(legs):
            self.set_leg(leg, state)

    @property
    def i(self):
        """Phase currents."""
        return self._free @ self.x[:4]

    def _sign(self, leg):
        """Sign of a current. If other legs hold it at zero, it consists of rounding."""
        i = self.i[leg]
        return int(np.sign(i)) if abs(i) > ROUNDING_A else 0

    def set_leg(self, leg, state):
        if state >= BREAK:
            if self.kinds[leg] == "open":  # mended: a current goes on in a diode
                self.legs[leg] = OFF
                self.diodes[leg] = DIODES[self.arcs[leg]]
            self.kinds[leg] = KINDS[state - BREAK]
            state = self.commands[leg]
            if self.kinds[leg] == "open":
                self.arcs[leg] = self._sign(leg)
        self.commands[leg] = state
        if state in DEAD.get(self.kinds[leg], ()):
            state = OFF
        if state == OFF and self.legs[leg] != OFF:
            # Current that leaves the leg comes from the negative rail.
            self.diodes[leg] = DIODES[self._sign(leg)]
        self.legs[leg] = state

    def _tie(self, volts):
        """For each leg at a voltage, or None if it floats: (coefficients of `slopes`, floating
        legs, coefficients of their voltages)."""
        found = self._ties.get(volts)
        if found is None:
            floating = [leg for leg in range(6) if volts[leg] is None]
            u = np.zeros(6)
            u[:4] = self._free.T @ [v or 0.0 for v in volts]
            key = volts
            free = np.hstack([self._linear, self._motion, (self._inverse @ u)[:, None]])
            held = np.hstack([self._free[floating], np.zeros((len(floating), 2))])
            response = held @ self._inverse @ held.T
            # If a whole set floats, any common voltage of its legs will do.
            volts = -np.linalg.pinv(response, rcond=1e-9, hermitian=True) @ held @ free
            a = np.zeros((7, 13))
            a[:6] = free + self._inverse @ held.T @ volts
            a[6, :10] = self._shaft
            found = self._ties[key] = (a, floating, volts)
        return found

    def _volts(self):
        return tuple(self._volts_of(leg) for leg in range(6))

    def _volts_of(self, leg):
        state, arc = self.legs[leg], self.arcs[leg]
        if self.kinds[leg] == "open":
            if arc == 0:
                return None
            rail = state if state != OFF else LOW if arc > 0 else HIGH
            return self.vdc_V * rail - self.arc_V * arc
        rail = self.diodes[leg] if state == OFF else state
        return None if rail == FLOATS else self.vdc_V * rail

    def _room(self, x, leg):
        """A value that is positive while the diodes of an open leg stay as they are: the current of
        the conducting diode or of the arc, or the distance of a floating leg from the nearer rail
        in parts of Vdc."""
        if self.kinds[leg] == "open":
            return (self._free[leg] @ x[:4]) * self.arcs[leg]
        if self.diodes[leg] != FLOATS:
            return (self._free[leg] @ x[:4]) * (1 if self.diodes[leg] == LOW else -1)
        return 0.5 - abs(self._voltage(x, leg) / self.vdc_V - 0.5)

    def _voltage(self, x, leg):
        """The voltage of a floating leg. A set that floats as a whole is in the middle between the
        rails with those of its legs that have diodes."""
        _, floating, volts = self._tie(self._volts())
        found = volts @ np.concatenate([x[:6], x[6] * x[:6], [1.0]])
        set_of = range(leg % 2, 6, 2)
        shift = 0.0
        if all(other in floating for other in set_of):
            own = [found[floating.index(o)] for o in set_of if self.kinds[o] != "open"]
            shift = 0.5 * (self.vdc_V - min(own) - max(own))
        return found[floating.index(leg)] + shift

    def _change(self, leg):
        """Let the conducting diode of an open leg block, or the nearer one conduct; let an arc
        end."""
        if self.kinds[leg] == "open":
            self.arcs[leg] = 0
        elif self.diodes[leg] == FLOATS:
            self.diodes[leg] = HIGH if self._voltage(self.x, leg) > 0.5 * self.vdc_V else LOW
            self.reopened += 1
            return
        else:
            self.diodes[leg] = FLOATS
            self.blocked += 1
        # In a set with a lost phase the last currents end together. Their diodes block together,
        # too. Then the voltages of all of them decide which ones conduct next.
        for other in range(leg % 2, 6, 2):
            if self.legs[other] == OFF and self._sign(other) == 0:
                self.diodes[other] = FLOATS

    def _settle(self):
        """Let the diodes of floating legs conduct whose voltage is beyond the rails, the furthest
        one first."""
        while True:
            floating = [
                leg
                for leg in range(6)
                if self.legs[leg] == OFF
                and self.diodes[leg] == FLOATS
                and self.kinds[leg] != "open"
            ]
            room = {leg: self._room(self.x, leg) for leg in floating}
            if not room or min(room.values()) >= 0:
                return
            self._change(min(room, key=room.get))

    def _end_of_room(self, begin, dt, a, leg):
        def room(t):
            return self._room(self.integrate(begin, t, a) if t > 0 else begin, leg)

        # A diode that has just opened has no current yet, but has some soon.
        start = 0.0
        if room(0.0) <= ROUNDING_A:
            sooner = (dt * 2.0**-k for k in range(1, 20))
            start = next(t for t in sooner if room(t) > 0)
        return brentq(room, start, dt, xtol=1e-20, rtol=1e-14)

    def advance(self, dt):
        """Advance the time, without edges."""
        longest = BROKEN_S if any(kind != "none" for kind in self.kinds) else dt
        while dt > 0:
            piece = min(dt, longest)
            self._advance(piece)
            dt -= piece

    def _advance(self, dt):
        if OFF not in self.legs and "open" not in self.kinds:
            self.x = self.integrate(self.x, dt, self._tie(self._volts())[0])
            return
        while dt > 0:
            self._settle()
            open_legs = [
                leg
                for leg in range(6)
                if (self.arcs[leg] if self.kinds[leg] == "open" else self.legs[leg] == OFF)
            ]
            a = self._tie(self._volts())[0]
            begin, end = self.x, self.integrate(self.x, dt, a)
            first, changing = dt, None
            for leg in open_legs:
                # A current that has just been zero has no sign, only rounding.
                if self._room(end, leg) < -1e-12:
                    t = self._end_of_room(begin, dt, a, leg)
                    if t < first:
                        first, changing = t, leg
            self.arc_s += first * any(map(abs, self.arcs))
            if changing is None:
                self.x = end
                return
            self.x = self.integrate(begin, first, a)
            self._change(changing)
            dt -= first

    def follow(self, edges, begin, instants, clock_Hz):
        """Advance from count `begin` through edges (count, leg, state), which are in order. Edges
        at one of the `instants` are applied after it. Returns phase currents (n, 6) and speeds (n,)
        at `instants` (counts)."""
        currents, speeds = np.empty((len(instants), 6)), np.empty(len(instants))
        now, e = begin, 0
        for n, instant in enumerate(instants):
            while now < instant:
                while e < len(edges) and edges[e][0] == now:
                    self.set_leg(edges[e][1], edges[e][2])
                    e += 1
                stop = min(instant, edges[e][0]) if e < len(edges) else instant
                self.advance((stop - now) / clock_Hz)
                now = stop
            currents[n], speeds[n] = self.i, self.x[6]
        return currents, speeds
