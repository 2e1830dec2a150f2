"""The functions of every machine model, and the integration step that all share.

A model is a module in `machines/`. It has

- a class `Parameters`: its keys of the set-up's section [machine],
- `make(parameters)`: a numpy record of constants, see below,
- `initial(record)`: the state at rest without a current, (8,),
- `fastest_per_s(record)`: the largest decay rate of the windings at standstill,
- a compiled function for each function below that is marked `_contract` (`implements`).

Fields that every record has: one with the model's own name, `inertia` [kg m2], `viscous` [N m s],
`g_leg` (6, 6), d/dt of a phase current per volt on each leg with unsaturated iron [1/H], and
`inv_l_max`, the largest slope that any stator voltage causes [1/H]. The field with the model's name
selects the model's functions when the code is compiled, so that the choice of a model takes no time
when it runs.

All models have the same state of eight numbers, SI units:

    y[0:4]  stator flux linkages alpha, beta, x, y        [Wb]
    y[4:6]  state of the rotor; the model defines it
    y[6]    mechanical speed                              [rad/s]
    y[7]    mechanical angle                              [rad]
"""

from __future__ import annotations

from collections.abc import Callable

from numba.extending import overload

from .compiled import INLINE, compiled

#: Function of the contract -> model's name -> compiled function.
_MODELS: dict[Callable, dict[str, Callable]] = {}


def _contract(declared: Callable) -> Callable:
    """A function that every model has. Called from Python, it looks up the model's function."""

    def function(m, *rest):
        for name, implementation in _MODELS[function].items():
            if name in m.dtype.names:
                return implementation(m, *rest)
        raise TypeError(f"{declared.__name__}: no machine model has a record {m.dtype.names}")

    function.__name__, function.__doc__ = declared.__name__, declared.__doc__
    _MODELS[function] = {}
    return function


def implements(function: Callable, model: str) -> Callable:
    """Decorator: the function is this model's implementation of `function`."""

    def register(implementation: Callable) -> Callable:
        @overload(function, strict=False, jit_options=INLINE)  # type: ignore[arg-type] # private
        def choose(m, *rest):
            return implementation if model in getattr(m, "fields", ()) else None

        _MODELS[function][model] = compiled(implementation)
        return _MODELS[function][model]

    return register


@_contract
def derivative(m, load, y, v, k):
    """Write d y/dt into k[0:8] for stator voltages v[0:4]."""


@_contract
def stator_currents(m, y, i):
    """Write the alpha, beta, x and y currents into i[0:4], A."""


@_contract
def torque_Nm(m, y, i):
    """Electromagnetic torque from the state and the stator currents i[0:4]."""


@_contract
def common_part(m, y):
    """The common part of a state's phase currents, computed once. Any type."""


@_contract
def current_with(m, y, common, leg):
    """`phase_current` with common = common_part(m, y)."""


@_contract
def constant_response(m):
    """Whether `leg_response` is the same at any state."""


@_contract
def incremental(m, y):
    """The part of the state on which the two slopes below depend, computed once. Any type."""


@_contract
def phase_current_slope(m, gain, k, leg):
    """d/dt of a phase current, A/s, for flux slopes k[0:6]; `gain` = incremental(m, y)."""


@_contract
def leg_response(m, gain, leg, other):
    """d/dt of a phase current per volt on leg `other`, 1/H; `gain` = incremental(m, y)."""


@_contract
def losses(m, y, drop):
    """Write the voltages that drive the rotor's currents, alpha and beta, into drop[0:2]. Returns
    the iron's loss, W."""


@_contract
def coast(m, load, y, dt, most_V):
    """Advance by dt without any stator current. Returns False and leaves y alone if the
    voltage that the rotor induces between two terminals can exceed `most_V`."""


@compiled(inline="always")
def phase_current(m, y, leg):
    """Current of the phase on this leg, A; it flows out of the leg."""
    return current_with(m, y, common_part(m, y), leg)


@compiled
def rk4_step(m, load, y, v, dt, out, k, z):
    """One classical Runge-Kutta step from y to out (may be the same array).

    `k` (8,) and `z` (2, 8) are work space.
    """
    total = z[0]
    stage = z[1]
    derivative(m, load, y, v, k)
    for r in range(8):
        total[r] = k[r]
        stage[r] = y[r] + 0.5 * dt * k[r]
    derivative(m, load, stage, v, k)
    for r in range(8):
        total[r] += 2.0 * k[r]
        stage[r] = y[r] + 0.5 * dt * k[r]
    derivative(m, load, stage, v, k)
    for r in range(8):
        total[r] += 2.0 * k[r]
        stage[r] = y[r] + dt * k[r]
    derivative(m, load, stage, v, k)
    for r in range(8):
        out[r] = y[r] + dt / 6.0 * (total[r] + k[r])


@compiled
def rk4_two_steps(m, load, y, v, dt0, dt1, out0, out1, k, z):
    """The same step twice from y: by dt0 to out0, and by dt1 to out1, which may be y. An operation
    of a step waits for the one before it, so the processor computes two steps in little more than
    the time of one.

    `k` (8,) and `z` (5, 8) are work space.
    """
    total0 = z[0]
    stage0 = z[1]
    total1 = z[2]
    stage1 = z[3]
    k1 = z[4]
    derivative(m, load, y, v, k)
    for r in range(8):
        total0[r] = k[r]
        total1[r] = k[r]
        stage0[r] = y[r] + 0.5 * dt0 * k[r]
        stage1[r] = y[r] + 0.5 * dt1 * k[r]
    derivative(m, load, stage0, v, k)
    derivative(m, load, stage1, v, k1)
    for r in range(8):
        total0[r] += 2.0 * k[r]
        total1[r] += 2.0 * k1[r]
        stage0[r] = y[r] + 0.5 * dt0 * k[r]
        stage1[r] = y[r] + 0.5 * dt1 * k1[r]
    derivative(m, load, stage0, v, k)
    derivative(m, load, stage1, v, k1)
    for r in range(8):
        total0[r] += 2.0 * k[r]
        total1[r] += 2.0 * k1[r]
        stage0[r] = y[r] + dt0 * k[r]
        stage1[r] = y[r] + dt1 * k1[r]
    derivative(m, load, stage0, v, k)
    derivative(m, load, stage1, v, k1)
    for r in range(8):
        out0[r] = y[r] + dt0 / 6.0 * (total0[r] + k[r])
        out1[r] = y[r] + dt1 / 6.0 * (total1[r] + k1[r])
