"""The figure: fronts, steps and errors of every method on every machine, and the five sentences."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ..engine.figure import Figure, Verdict, claim, not_printed
from ..engine.job import Job
from ..fsw.comparison import as_recording
from . import errors, judging, pictures, steps
from .judging import CASE_NAMES, LIMIT_HZ, At, Result, balanced, limits_json
from .methods import Method, methods
from .places import MACHINES, PLACES, Machine, label
from .search import JUDGED, Kept, held, settings

#: The references must come so near to the analytic line of their modulation.
LINE = 1.10


def searched(job: Job, rivals: int) -> list[At]:
    """Every method at every point. A quick run has the last point of each machine."""
    places = [machine.place for machine in MACHINES] if job.quick else list(PLACES)
    tasks = [(place, method) for place in places for method in methods()]
    found = job.each(lambda task: held(settings(job, *task, 1 if task[1].ours else rivals)), tasks)
    points = [At(place, {}) for place in places]
    for (place, method), rows in zip(tasks, found):
        points[places.index(place)].rows[method.name] = rows
    return points


def _tests(
    job: Job, machine: Machine, method: Method, row: dict | None
) -> tuple[dict[str, dict], dict[str, dict]]:
    """Steps and errors with a setting. Of a quick run: the torque step, on paper B's machine, and
    no errors."""
    if row is None:
        return {}, {}
    key = (machine.name, method.name, row, job.quick)
    wanted = ("torque step",) if job.quick else tuple(steps.TESTS)
    if job.quick and machine.setup != "paper-b":
        return {}, {}
    made, wrong = {}, {}
    for test in wanted:
        kept = Kept(job.folder, "step", test, *key)
        made[test] = kept.get(partial(steps.run, test, method, machine, row, job))
    for name, case in () if job.quick else zip(CASE_NAMES, errors.CASES):
        kept = Kept(job.folder, "error", name, *key)
        wrong[name] = kept.get(partial(errors.run, case, method, machine, row, job))
    return made, wrong


def measured(job: Job, rivals: int) -> Result:
    points = searched(job, rivals)
    machines = judging.machines_of(points)
    last = {
        machine.name: next(a for a in points if a.place == machine.place) for machine in machines
    }
    chosen = {
        machine.name: {
            method.name: balanced(last[machine.name].rows[method.name]) for method in methods()
        }
        for machine in machines
    }
    tasks = [(machine, method) for machine in machines for method in methods()]
    found = job.each(lambda t: _tests(job, *t, chosen[t[0].name][t[1].name]), tasks)
    made: dict[str, dict] = {machine.name: {} for machine in machines}
    wrong: dict[str, dict] = {machine.name: {} for machine in machines}
    for (machine, method), (own_steps, own_errors) in zip(tasks, found):
        if own_steps:
            made[machine.name][method.name] = own_steps
        if own_errors:
            wrong[machine.name][method.name] = own_errors
    return Result(
        points,
        methods(),
        chosen,
        {name: own for name, own in made.items() if own},
        {name: own for name, own in wrong.items() if own},
    )


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
    """What a law of the host keeps from period to period."""
    base = MACHINES[0].base
    found = {}
    for method in methods():
        middle = {axis.name: axis.value(0.5) for axis in method.law_axes}
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
                "best": limits_json(at, result.methods, JUDGED),
                "tried": {name: len(rows) for name, rows in at.rows.items()},
            }
            for at in result.points
        ],
    }


def references(job: Job) -> Figure:
    """Every method at its best, on every machine. With more than one budget for the rivals the
    sentences are made twice: with equal budgets, and with theirs enlarged."""
    first = measured(job, 1)
    again = measured(job, job.rivals) if job.rivals > 1 else None
    shown = again or first

    def draw(path: Path) -> Path:
        return pictures.draw(shown.points, path)

    metrics: dict = {"methods": [m.name for m in methods()], "equal": _json(first)}
    extent = methods()[0].quick if job.quick else methods()[0].extent
    metrics["settings"] = extent.settings
    metrics["families"] = {method.name: method.family for method in methods()}
    if again is not None:
        metrics["rivals"] = {"times": job.rivals, **_json(again)}
    return Figure(
        metrics=metrics,
        verdicts=_verdicts(first, again, job.rivals),
        draw=draw,
        recordings={
            "": as_recording(
                {label(at.place): at.rows for at in shown.points},
                "method",
                [method.name for method in methods()],
            )
        },
        setups=[machine.base for machine in judging.machines_of(first.points)],
        caption=f"Each staircase is the best of a method's {extent.settings} settings within a "
        "switching frequency. The dashed line is carrier modulation with double zero-sequence "
        "injection, computed.",
    )
