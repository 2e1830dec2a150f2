"""The study: Optuna proposes, the caller's function judges.

The candidates come in batches of a fixed size, and each has its own seed, from the study's seed and
its number. So neither the number of workers nor an interruption changes the result. All that is
known stands in a journal, a text file: no database is needed.
"""

from __future__ import annotations

import json
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import HexatorqueError
from ..parallel import in_order
from ..setups import SetupError
from .space import Knob

if TYPE_CHECKING:
    import optuna

#: Candidates that are proposed together.
BATCH = 8
#: So many are drawn at random before the sampler learns from them.
AT_RANDOM = 12
#: Aim of a candidate that does not hold: worse than any that does.
LOST = 10.0
STUDY = "hexatorque tune"


class NotInstalled(HexatorqueError):
    exit_code = 2


@dataclass(frozen=True)
class Judged:
    """The worth of a candidate. aim: the smaller the better; details: plain values for the
    journal."""

    aim: float
    details: dict[str, Any]


@dataclass(frozen=True)
class Tried:
    number: int
    values: dict[str, float]
    aim: float
    details: dict[str, Any]


#: A candidate's values by name.
Judge = Callable[[Mapping[str, float]], Judged]


def library() -> Any:
    """Optuna. It is imported only where it is needed, because it is optional."""
    try:
        import optuna
    except ImportError:
        raise NotInstalled(
            "tune needs Optuna, which is not installed: pip install 'hexatorque[tune]'"
        ) from None
    return optuna


@contextmanager
def _quiet() -> Iterator[None]:
    optuna = library()
    level = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            yield
    finally:
        optuna.logging.set_verbosity(level)


class Journal:
    """A study's file: an entry of Optuna's journal in each line. Optuna's own backend waits for the
    disk after each entry and locks the file against other processes. Here only one writes, and
    there are ten entries a candidate."""

    def __init__(self, file: Path) -> None:
        self._file = file
        text = file.read_text(encoding="utf-8") if file.exists() else ""
        whole = text[: text.rfind("\n") + 1]  # the last line is cut off if the process was killed
        self._entries: list[dict[str, Any]] = [json.loads(line) for line in whole.splitlines()]
        if whole != text:
            file.write_text(whole, encoding="utf-8")

    def read_logs(self, log_number_from: int) -> list[dict[str, Any]]:
        return self._entries[log_number_from:]

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        with self._file.open("a", encoding="utf-8") as file:
            file.write("".join(json.dumps(entry) + "\n" for entry in logs))
        self._entries += logs


def open_study(file: Path | None, what: Mapping[str, Any], resume: bool) -> optuna.Study:
    """The study in this file, a new one unless `resume`; without a file one in memory. `what` says
    what is studied: a study of anything else is refused."""
    optuna = library()
    if file is None:
        with _quiet():
            return optuna.create_study()
    there = file.exists() and file.stat().st_size > 0
    if there and not resume:
        raise SetupError(
            f"{file}: a study is there already; --resume goes on with it, -o names another folder"
        )
    if resume and not there:
        raise SetupError(f"{file}: no study is there that could be resumed")
    now = json.loads(json.dumps(what))
    try:
        with _quiet():
            storage = optuna.storages.JournalStorage(Journal(file))
            if not there:
                study = optuna.create_study(storage=storage, study_name=STUDY)
                study.set_user_attr("what", now)
                return study
            study = optuna.load_study(storage=storage, study_name=STUDY)
    except OSError as error:
        raise SetupError(f"{file}: {error.strerror}") from None
    except (KeyError, ValueError, TypeError):
        raise SetupError(f"{file}: not a study of `hexatorque tune`") from None
    before = study.user_attrs.get("what", {})
    differing = [key for key in {**before, **now} if before.get(key) != now.get(key)]
    if differing:
        raise SetupError(
            f"{file}: another study, which differs in {', '.join(differing)}; -o names another "
            "folder"
        )
    return study


def search(
    study: optuna.Study,
    knobs: Sequence[Knob],
    judge: Judge,
    trials: int,
    seed: int,
    jobs: int = 1,
    each: Callable[[Tried], None] | None = None,
) -> list[Tried]:
    """Try candidates until there are `trials`, those of earlier runs included. The first is the
    start. `each` is called with every candidate, also with those of earlier runs."""
    optuna = library()
    space = {
        knob.name: optuna.distributions.FloatDistribution(knob.low, knob.high, log=knob.log)
        for knob in knobs
    }
    with _quiet():
        return _batches(study, space, knobs, judge, trials, seed, jobs, each)


def _batches(
    study: optuna.Study,
    space: dict[str, Any],
    knobs: Sequence[Knob],
    judge: Judge,
    trials: int,
    seed: int,
    jobs: int,
    each: Callable[[Tried], None] | None,
) -> list[Tried]:
    if not study.get_trials(deepcopy=False):
        study.enqueue_trial({knob.name: knob.start for knob in knobs})
    done = tried(study)
    for one in done:
        if each:
            each(one)
    while True:
        # After an interruption some of the batch have been proposed, but not judged.
        pending = _proposed(study, len(space))
        end = min(trials, (len(done) // BATCH + 1) * BATCH)
        for number in range(len(done) + len(pending), end):
            study.sampler = _sampler(seed, number)
            trial = study.ask(space)
            pending[trial.number] = dict(trial.params)
        if not pending:
            return done
        for number, judged in zip(pending, in_order(judge, pending.values(), jobs, wait=False)):
            study.set_user_attr(f"trial {number}", judged.details)
            study.tell(number, judged.aim)
            done.append(Tried(number, pending[number], judged.aim, judged.details))
            if each:
                each(done[-1])


def _proposed(study: optuna.Study, parameters: int) -> dict[int, dict[str, float]]:
    """Number and values of the candidates that are not judged yet. One whose values were not
    written to the end is given up."""
    states = library().trial.TrialState
    found = {}
    for trial in study.get_trials(deepcopy=False, states=(states.RUNNING,)):
        if len(trial.params) == parameters:
            found[trial.number] = dict(trial.params)
        else:
            study.tell(trial.number, state=states.FAIL)
    return found


def _sampler(seed: int, number: int) -> Any:
    own = zlib.crc32(f"{seed} {number}".encode())
    return library().samplers.TPESampler(
        seed=own, multivariate=True, constant_liar=True, n_startup_trials=AT_RANDOM
    )


def tried(study: optuna.Study) -> list[Tried]:
    """The judged candidates, in the order of their numbers."""
    complete = library().trial.TrialState.COMPLETE
    details = study.user_attrs
    return [
        Tried(
            trial.number, dict(trial.params), float(trial.value), details[f"trial {trial.number}"]
        )
        for trial in study.get_trials(deepcopy=False, states=(complete,))
        if trial.value is not None
    ]
