"""The comparison a reviewer would ask for: the table schemes, our law, and what an expert would use
instead, on four machines, every method tuned by the same search with the same budget. Fronts, steps
and errors of every method, and the five sentences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from ..kept import Kept
from ..papers.engine.figure import Figure, Verdict, claim, not_printed
from ..papers.engine.job import Job
from . import errors, judging, limit, steps
from .judging import CASE_NAMES, LIMIT_HZ, At, Result, as_recording, balanced
from .methods import Method, methods
from .pictures import Look, fronts
from .places import MACHINES, PLACES, B, Place, label, machines_of
from .search import ANY_HZ, Search, each_at_each

#: Limits of switching frequency, and what is judged within them.
LIMITS_HZ = (1e3, 1.5e3, 2e3, 3e3, 4e3, 6e3, 8e3)
JUDGED = ("td_Nm", "thd_inf_pct", "loss_W")
#: The sentences' limit first.
SEARCH = Search(
    "references",
    17,
    tuple(
        (figure, limit_Hz, ANY_HZ)
        for limit_Hz in (4e3, 2e3, 6e3, 3e3, 1e3, 8e3, 1.5e3)
        for figure in JUDGED
    ),
    aims=True,
)
#: The references must come so near to the analytic line of their modulation.
LINE = 1.10
LOOK = Look(0.5, 8.0, False, 2.5, 1.0, 11.0, 7)


def searched(job: Job, rivals: int) -> list[At]:
    """Every method at every point. A quick run has the last point of each machine."""
    places = [machine.place for machine in MACHINES] if job.quick else list(PLACES)
    found = each_at_each(job, SEARCH, places, methods(), rivals)
    return [with_limit(job, At(place, rows)) for place, rows in found.items()]


def with_limit(job: Job, at: At) -> At:
    """The point, and the least that any pulse pattern can have there."""

    def least() -> dict[str, float]:
        front = limit.front(at.place.base, at.place, 1e3, at.flux_Wb, job.quick)
        first, last = front[0].ripple, front[-1].ripple
        return {"thd_inf_pct": first.thd_inf_pct, "td_Nm": last.td_Nm}

    key = (at.place, at.flux_Wb, job.quick)
    return replace(at, least_at_1kHz=Kept(job.folder, "limit", *key).get(least))


def _tests(
    job: Job, place: Place, method: Method, row: dict | None
) -> tuple[dict[str, dict], dict[str, dict]]:
    """Steps and errors with a setting. Of a quick run: the torque step, on paper B's machine, and
    no errors."""
    if row is None or (job.quick and place.setup != B):
        return {}, {}

    def kept(kind: str, name: str, measure: Callable[..., dict], what: object) -> dict:
        key = (name, place, method.name, row, job.quick)
        found: dict = Kept(job.folder, kind, *key).get(
            lambda: measure(what, method, place, row, job)
        )
        return found

    wanted = ("torque step",) if job.quick else tuple(steps.TESTS)
    cases = () if job.quick else zip(CASE_NAMES, errors.CASES)
    return (
        {test: kept("step", test, steps.run, test) for test in wanted},
        {name: kept("error", name, errors.run, case) for name, case in cases},
    )


def measured(job: Job, rivals: int) -> Result:
    points = searched(job, rivals)
    machines = machines_of(at.place for at in points)
    rows = {at.place: at.rows for at in points}
    chosen = {
        machine.name: {
            method.name: balanced(rows[machine.place][method.name]) for method in methods()
        }
        for machine in machines
    }
    tasks = [(machine, method) for machine in machines for method in methods()]
    found = job.each(lambda t: _tests(job, t[0].place, t[1], chosen[t[0].name][t[1].name]), tasks)
    made: dict[str, dict] = {}
    wrong: dict[str, dict] = {}
    for (machine, method), (own_steps, own_errors) in zip(tasks, found):
        if own_steps:
            made.setdefault(machine.name, {})[method.name] = own_steps
        if own_errors:
            wrong.setdefault(machine.name, {})[method.name] = own_errors
    return Result(points, methods(), chosen, made, wrong)


def _on_the_line(points: list[At]) -> list[Verdict]:
    """Field orientation over the analytic line of its modulation, at every point: so it is not
    held back by its tuning."""
    found = []
    for name, turned in (("foc", False), ("foc-24", True)):
        over, ratios = [], []
        for at in points:
            row = at.within(name, "td_Nm")
            line = at.line(row["f_sw_Hz"], turned) if row else None
            if row is None or line is None:
                continue
            worst = max(row[key] / getattr(line, key) for key in ("td_Nm", "thd_inf_pct"))
            ratios.append(worst)
            if worst > LINE:
                over.append(f"{label(at.place)}: {worst:.2f}")
        if ratios:
            found.append(
                claim(
                    f"{name}: torque ripple and distortion over the line of its modulation",
                    not over,
                    f"{min(ratios):.2f} … {max(ratios):.2f} at {len(ratios)} points",
                    f"≤ {LINE:g} (our target)",
                    why="Above at " + "; ".join(over) if over else "",
                )
            )
    return found


def _verdicts(first: Result, again: Result | None, rivals: int) -> list[Verdict]:
    found = [not_printed("take", sentence.text) for sentence in first.sentences()]
    found += _on_the_line(first.points)
    if again is not None:
        changed = [
            f"{old.words}; with {rivals} times the budget: {new.words}"
            for old, new in zip(first.sentences(), again.sentences())
            if old.words != new.words
        ]
        found.append(
            claim(
                f"sentences that change if the rivals get {rivals} times the budget",
                not changed,
                str(len(changed)),
                "0 (our target)",
                why="; ".join(changed),
            )
        )
    return found


def memory_bytes() -> dict[str, int]:
    """The memory of a law of the host from period to period."""
    base = MACHINES[0].place.base
    found = {}
    for method in methods():
        middle = {axis.name: axis.value(0.5) for axis in method.axes}
        law = method.law(base, middle)
        if law is not None:
            memory = law.memory({})
            found[method.name] = 0 if memory is None else memory.nbytes
    return found


def _json(result: Result) -> dict:
    return {
        "sentences": [sentence.as_json() for sentence in result.sentences()],
        "by_sampling": judging.by_sampling(result.points, result.methods),
        "steps": result.steps,
        "errors": result.errors,
        "chosen": result.chosen,
        "points": [
            {
                "point": label(at.place),
                "m_pu": at.m_pu,
                "line": vars(line) if (line := at.line(LIMIT_HZ)) else None,
                "least_at_1kHz": at.least_at_1kHz,
                "best": at.limits(JUDGED, LIMITS_HZ),
                "tried": {name: len(rows) for name, rows in at.rows.items()},
            }
            for at in result.points
        ],
    }


def draw(points: list[At], path: Path) -> Path:
    """The machines' last points at `path`; the others beside it."""

    def page(own: list[At], to: Path) -> Path:
        return fronts({f"{label(at.place)}: {at.m_pu:.2f} V_dc": at for at in own}, LOOK, to)

    last = [machine.place for machine in MACHINES]
    if others := [at for at in points if at.place not in last]:
        page(others, path.with_stem(f"{path.stem}-others"))
    return page([at for at in points if at.place in last], path)


def references(job: Job) -> Figure:
    """Every method at its best, on every machine. With more than one budget for the rivals the
    sentences are made twice: with equal budgets, and with theirs enlarged."""
    first = measured(job, 1)
    again = measured(job, job.rivals) if job.rivals > 1 else None
    shown = again or first
    metrics: dict = {"methods": [m.name for m in methods()], "equal": _json(first)}
    extent = methods()[0].quick if job.quick else methods()[0].extent
    metrics["settings"] = extent.settings
    metrics["families"] = {method.name: method.family for method in methods()}
    if again is not None:
        metrics["rivals"] = {"times": job.rivals, **_json(again)}
    return Figure(
        metrics=metrics,
        verdicts=_verdicts(first, again, job.rivals),
        draw=partial(draw, shown.points),
        recordings={
            "": as_recording(
                {label(at.place): at.rows for at in shown.points},
                "method",
                [method.name for method in methods()],
            )
        },
        setups=[m.place.base for m in machines_of(at.place for at in first.points)],
        caption=f"Each staircase is the best of a method's {extent.settings} settings within a "
        "switching frequency. Computed are carrier modulation with double zero-sequence injection "
        "(dashed) and the least of each figure that any pulse pattern can have (thin).",
    )
