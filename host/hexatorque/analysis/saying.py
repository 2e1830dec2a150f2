"""The figures of a comparison, in sentences. Every number is computed from the runs."""

from __future__ import annotations

import math

from .reference import Reference, reference_values
from .run import Run, by_point

#: Td, of which the samples between the control instants are a part.
RIPPLE = "torque_ripple_td_Nm"
XY = "ixy_rms_A"
#: Of the fundamental: a smaller x–y current is rounding, and a ratio to it means nothing.
ROUNDING = 1e-6
#: What the sentences compare: key, name, unit, scale.
FIGURES = (
    (RIPPLE, "torque ripple Td", "N m", 1.0),
    ("thd_inf_pct", "distortion THD∞", "%", 1.0),
    (XY, "x–y current", "A", 1.0),
    ("f_sw_Hz", "switching frequency", "kHz", 1e-3),
)
#: Where there are too few samples for Td, its place takes the ripple at the control instants.
AT_INSTANTS = ("torque_ripple_Nm", "torque ripple", "N m", 1.0)
#: What each paper is about: the second scheme is its answer to the first.
PAIRS = (("fdr", "ddr"), ("dtc1", "dtc3"))
#: Values this near to the best one share its place.
TIE = 0.02
#: A mean torque that is further from its reference, in %, is told.
HELD_PCT = 2.0
#: A deviation from a printed value by more than this factor gets its reason.
FAR = 1.3


def sentences(runs: list[Run], reference: Reference) -> list[str]:
    """One line for each operating point, then which schemes hold another torque than they are
    asked for, then what latency does, then why printed values differ."""
    groups = by_point(runs).values()
    lines = [f"{group[0].point}: {line}" for group in groups for line in _of_point(group)]
    lines += [line for group in groups for line in _of_mean_torque(group)]
    lines += [line for group in groups for line in _of_latency(group)]
    return lines + [line for group in groups for line in _of_paper(group, reference)]


def _of_point(group: list[Run]) -> list[str]:
    """The runs of one operating point: the first one of each scheme has the set-up's latency."""
    own: dict[str, Run] = {}
    for run in group:
        own.setdefault(run.scheme, run)
    if len(own) == 1:
        return [_alone(group[0])]
    if len(own) == 2:
        return [_pair(*own.values())]
    pairs = [_pair(own[a], own[b]) for a, b in PAIRS if a in own and b in own]
    return [*pairs, _extremes(list(own.values()))]


def _figures(*runs: Run) -> tuple[tuple[str, str, str, float], ...]:
    seen = all(math.isfinite(_value(run, RIPPLE)) for run in runs)
    return FIGURES if seen else (AT_INSTANTS, *FIGURES[1:])


def _value(run: Run, key: str) -> float:
    """A figure of merit; NaN if this run has none."""
    value = run.metrics[key]
    if value is not None and key == XY and value < ROUNDING * (run.metrics.get("i1_A") or 0.0):
        return 0.0
    return math.nan if value is None else float(value)


def _shown(value: float, unit: str, scale: float) -> str:
    return f"{scale * value:.3g} {unit}"


def _listed(parts: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(parts[:-1]), *parts[-1:])))


def _alone(run: Run) -> str:
    known = [
        f"{name} {_shown(_value(run, key), unit, scale)}"
        for key, name, unit, scale in _figures(run)
        if math.isfinite(_value(run, key))
    ]
    return (
        f"{run.scheme.upper()} has {_listed(known)}." if known else "no figure could be computed."
    )


def _pair(a: Run, b: Run) -> str:
    """The second scheme relative to the first. The figure that differs most comes first."""
    ratios = {
        name: _value(b, key) / _value(a, key)
        for key, name, _, _ in _figures(a, b)
        if _value(a, key) > 0 and _value(b, key) > 0
    }
    if not ratios:
        return f"{a.scheme.upper()} and {b.scheme.upper()} have no figure in common."
    first, *rest = sorted(ratios, key=lambda name: -abs(math.log(ratios[name])))
    at = [f"{_times(ratios[name])} its {name}" for name in rest]
    return (
        f"{b.scheme.upper()} has {_times(ratios[first])} {a.scheme.upper()}'s {first}"
        + (f" at {_listed(at)}" if at else "")
        + "."
    )


def _times(ratio: float) -> str:
    return f"{ratio:.2g} of" if ratio < 0.995 else f"{ratio:.2f} times"


def _extremes(runs: list[Run]) -> str:
    parts = []
    for key, name, unit, scale in _figures(*runs):
        known = sorted(
            (run for run in runs if math.isfinite(_value(run, key))),
            key=lambda run: _value(run, key),
        )
        if len(known) < 2:
            continue
        low, high = _value(known[0], key), _value(known[-1], key)
        if high <= (1 + TIE) * low:
            parts.append(f"{name} {_shown(low, unit, scale)} under all")
            continue
        best = [run.scheme.upper() for run in known if _value(run, key) <= (1 + TIE) * low]
        parts.append(
            f"{name} from {_shown(low, unit, scale)} ({_listed(best)}) to "
            f"{_shown(high, unit, scale)} ({known[-1].scheme.upper()})"
        )
    return "; ".join(parts) + "." if parts else "no figure could be computed."


def _of_mean_torque(group: list[Run]) -> list[str]:
    """Which schemes hold another mean torque than their reference, and by how much."""
    own: dict[str, Run] = {}
    for run in group:
        if math.isfinite(_value(run, "torque_error_pct")):
            own.setdefault(run.scheme, run)
    off = {scheme: _value(run, "torque_error_pct") for scheme, run in own.items()}
    told = [
        f"{'below' if percent < 0 else 'above'} by {abs(percent):.2g} % "
        f"({abs(_value(own[scheme], 'torque_error_Nm')):.2g} N m) under {scheme.upper()}"
        for scheme, percent in sorted(off.items(), key=lambda item: -abs(item[1]))
        if abs(percent) > HELD_PCT
    ]
    if not told:
        return []
    held = [scheme.upper() for scheme, percent in off.items() if abs(percent) <= HELD_PCT]
    rest = f"; within {HELD_PCT:g} % under {_listed(held)}" if held else ""
    return [f"{group[0].point}: the mean torque is off its reference: {_listed(told)}{rest}."]


def _of_latency(group: list[Run]) -> list[str]:
    """The effect of one period of delay on the torque ripple, and its rest with prediction."""
    lines = []
    by_scheme: dict[str, dict[str, Run]] = {}
    for run in group:
        by_scheme.setdefault(run.scheme, {})[run.latency] = run
    for found in by_scheme.values():
        none, shadow, predicted = (
            _value(found[latency], "torque_ripple_Nm") if latency in found else math.nan
            for latency in ("none", "shadow", "predicted")
        )
        if not (shadow > 0 and none > 0):
            continue
        name = found["shadow"].scheme.upper()
        line = (
            f"{group[0].point}: a delay of one period (shadow) makes {name}'s torque ripple "
            f"{shadow / none:.2f} times that without latency (none)"
        )
        if predicted > 0:
            line += f"; with prediction (predicted) it is {predicted / none:.2f} times"
        lines.append(f"{line}.")
    return lines


def _of_paper(group: list[Run], reference: Reference) -> list[str]:
    """Why our distortion is far from the printed one."""
    why = reference.get(group[0].setup, {}).get("why_thd", "")
    far: dict[str, str] = {}
    for run in group:
        printed = reference_values(reference, run).get("thd_pct")
        ours = run.metrics["thd_pct"]["5kHz"]
        if printed and ours and not 1 / FAR < ours / printed < FAR:
            far.setdefault(
                run.scheme.upper(), f"{run.scheme.upper()} {ours:.1f} beside {printed:.1f}"
            )
    if not (far and why):
        return []
    differs = _listed(list(far.values()))
    return [f"{group[0].setup}: THD differs from the printed one ({differs} %): {why}."]
