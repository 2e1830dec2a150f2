"""A study: many runs of the simulation, and one table of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..given import choice, pairs, several
from ..setups import Setup, load, parameters
from . import sensitivity, space, table, work
from .engine import rows
from .errors import StudyError
from .journal import Journal
from .space import GRID, SOBOL, Draw, Space, check_words
from .table import Results
from .work import Row, Runs, Work
from .workers import Given, Processes, Workers

if TYPE_CHECKING:
    import pandas as pd

#: Longest wall-clock time of a run.
LIMIT_S = 300.0
#: The journal, in the folder of the results.
JOURNAL = "study.journal"
SEEDS = (1, 1_000_000_000)  #: allowed range of a noise seed

#: Is called with each row as it comes.
Each = Callable[[Row], None]


class Study:
    """Many runs of a set-up with other values, and one table of their figures of merit.

    study = Study("paper-b", {"point.speed_rpm": {"from": 500, "to": 2500, "count": 5}},
                  metrics=["torque_ripple_Nm"], schemes=["dtc1", "ddr"])
    study.run()
    study.table()

    keys: key of the set-up -> a value, a list of values, or a range {from, to, count, log};
    metrics: names from `hexatorque.analysis.metrics.UNITS`, all without it; schemes, seeds: each
    point runs with every scheme, and with every seed of the sensors' noise; design: "grid", "list",
    or `Draw`, how the values are combined; run: "point", "profile", or `Runs`, what each run does;
    default: key -> a value for what the set-up leaves open; title: of table and picture; over: the
    picture draws the other metrics over this one, with the best compromises. StudyError or
    SetupError, both InputErrors, name what is wrong before anything runs.

    setup: the set-up as it is studied; runs: what each run does, cycle: the drive cycle that it
    follows, if it does; space: all runs, `space.case(n).values` are the keys that
    run n changes; results: what has been computed, `results.figures` is (runs, metrics).
    """

    def __init__(
        self,
        setup: str | Path | Setup,
        keys: Mapping[str, Any] | None = None,
        metrics: Sequence[str] | None = None,
        design: str | Draw = GRID,
        schemes: Sequence[str] = (),
        seeds: Sequence[int] = (),
        run: str | Runs = work.POINT,
        default: Mapping[str, Any] | None = None,
        title: str = "",
        over: str = "",
    ) -> None:
        from .. import firmware

        loaded = setup if isinstance(setup, Setup) else load(setup)
        self.setup = space.completed(loaded, pairs(default))
        self.title = title if title else self.setup.title
        self.runs = run if isinstance(run, Runs) else Runs(run)
        self.cycle = self.runs.checked()
        known = work.units(self.runs.kind)
        self.metrics = tuple(known if metrics is None else several(metrics, "metrics"))
        if not self.metrics:
            raise StudyError(f"no metric is given; known: {', '.join(known)}")
        check_words(self.metrics, known, "metric")
        schemes = [choice(name, firmware.schemes()) for name in several(schemes, "schemes")]
        check_words(schemes, firmware.schemes(), "scheme")
        self.over = over
        if over and over not in self.metrics:
            raise StudyError(f"over = {over!r}: choose one of {', '.join(self.metrics)}")
        for one in (seeds := several(seeds, "seeds")):
            if isinstance(one, bool) or not isinstance(one, int) or not SEEDS[0] <= one <= SEEDS[1]:
                raise StudyError(f"seeds: {one!r}: allowed range is {SEEDS[0]} .. {SEEDS[1]}")
        draw = design if isinstance(design, Draw) else Draw(design)
        points = space.points(draw, keys or {}, self.setup)
        self.space = Space(points, tuple(schemes), tuple(seeds))
        if self.cycle and not points.axes:
            self.cycle.over(self.setup)  # says what the drive cannot do before anything runs
        self.results = Results(self.space, self.metrics)

    def __len__(self) -> int:
        return len(self.space)

    def as_json(self) -> dict[str, Any]:
        """The study's subject, for JSON. Two studies with the same have the same table."""
        points = self.space.design
        cycle = {"cycle": asdict(self.cycle)} if self.cycle else {}
        setup = {**self.setup.summary(), "controller": parameters(self.setup)}
        return {
            "identity": work.identity(),
            "set-up": {**setup, "profile": asdict(self.setup.profile)},
            "run": {"run": self.runs.kind, "from_s": self.runs.from_s, **cycle},
            "design": {"design": points.kind, "samples": points.points, "seed": points.seed},
            "keys": {axis.path: axis.as_json() for axis in points.axes},
            "schemes": self.space.schemes,
            "seeds": self.space.seeds,
            "metrics": self.metrics,
        }

    def run(
        self,
        folder: str | Path | None = None,
        resume: bool = False,
        jobs: int | None = None,
        executor: Executor | None = None,
        scheduler: Any = None,
        limit_s: float = LIMIT_S,
        each: Each | None = None,
    ) -> None:
        """Run what is missing.

        folder: keeps a journal there, with which `resume` goes on; without one the rows are only in
        memory. The runs are made in `jobs` processes (default: one a core), or by an `executor` of
        `concurrent.futures`, or on a Dask cluster: `scheduler` is its address or its cluster
        object. limit_s: a run that takes longer fails. each: called with every row as it comes,
        first with those that were there.
        """
        for _ in self.rows(folder, resume, jobs, executor, scheduler, limit_s, each):
            pass

    def rows(
        self,
        folder: str | Path | None = None,
        resume: bool = False,
        jobs: int | None = None,
        executor: Executor | None = None,
        scheduler: Any = None,
        limit_s: float = LIMIT_S,
        each: Each | None = None,
    ) -> Iterator[Row]:
        """The same as `run`, row by row."""
        if not limit_s > 0:
            raise StudyError(f"time limit {limit_s:g} s: above 0 s is needed")
        if jobs is not None and jobs < 1:
            raise StudyError(f"jobs = {jobs}: 1 or more is needed")
        if executor is not None and scheduler is not None:
            raise StudyError("give an executor or a scheduler, not both")
        what = self.as_json()
        shared = Work(
            self.setup,
            self.metrics,
            self.runs.kind,
            float(self.runs.from_s),
            limit_s,
            what["identity"],
            self.cycle,
        )
        journal = Journal(Path(folder) / JOURNAL, what, resume) if folder is not None else None
        with journal or nullcontext():
            if journal:
                for row in journal.rows():
                    self.results.add(row)
                    if row.lost:
                        self.results.forget(row)
                    elif each:
                        each(row)
            missing = list(self.results.missing)
            if not missing:
                return
            workers = _workers(jobs, executor, scheduler, len(missing))
            for row in rows(shared, self.space.cases(missing), workers):
                self.results.add(row)
                if journal:
                    journal.add(row)
                if each:
                    each(row)
                yield row

    @property
    def failures(self) -> dict[int, str]:
        """Why runs failed, by their number."""
        return dict(sorted(self.results.failures.items()))

    def table(self) -> pd.DataFrame:
        """The runs that are done: a row a run, a column a key or a figure. The last column says why
        a run has no figures; `attrs["units"]` has the units."""
        return table.frame(self.results, self._meta())

    def save(self, folder: str | Path) -> list[Path]:
        """Write the table as CSV with a .json file beside it, and as Parquet if pyarrow is
        installed. Returns the files."""
        folder = Path(folder)
        files = [folder / "table.csv"]
        table.write_csv(self.results, self._meta(), files[0])
        if table.write_parquet(self.results, self._meta(), folder / "table.parquet"):
            files.append(folder / "table.parquet")
        if self.space.design.kind == SOBOL:
            lines = sensitivity.indices(self.results)
            files.append(folder / "indices.csv")
            table.write_lines(sensitivity.COLUMNS, lines, self._meta(), files[-1])
        return files

    def indices(self) -> pd.DataFrame:
        """The indices of a Sobol design, a row for each scheme, figure and key. S1 is the share of
        the figure's variance that the key causes alone, ST with all others; the columns _conf have
        their uncertainty (95 %)."""
        if self.space.design.kind != SOBOL:
            raise StudyError(f"design = {self.space.design.kind!r}: indices need {SOBOL!r}")
        columns = zip(*sensitivity.indices(self.results))
        return table.data_frame(dict(zip(sensitivity.COLUMNS, columns)))

    def map(self, file: str | Path) -> Path:
        """A picture: the figures over what varies, or over the figure `over`, or how much each key
        of a Sobol design matters."""
        from . import maps

        if self.space.design.kind == SOBOL:
            return maps.sensitivity(self.results, self.title, Path(file))
        if self.over:
            return maps.front(self.results, self.title, self.over, Path(file))
        if self.cycle and not maps.over_numbers(self.results):
            return maps.energies(self.results, self.title, self.cycle, self.setup, Path(file))
        return maps.draw(self.results, self.title, Path(file))

    def _meta(self) -> dict[str, Any]:
        return {"title": self.title, "study": self.as_json()}


def _workers(jobs: int | None, executor: Executor | None, scheduler: Any, runs: int) -> Workers:
    if scheduler is not None:
        from .cluster import Cluster

        return Cluster(scheduler, runs)
    return Given(executor, jobs) if executor is not None else Processes(jobs)
