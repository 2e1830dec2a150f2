"""Many environments on all cores: a process for each core, a group of environments in each.

Gymnasium's own `async` mode has a process for each environment. To wake one up takes longer than a
period of the drive. Here a step is one message to each core.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Sequence
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from gymnasium.vector import SyncVectorEnv, VectorEnv
from gymnasium.vector.utils import batch_space

from ..errors import InputError
from ..system import usable_cores
from .environment import SixPhaseDrive


def _serve(line: Connection, number: int, given: dict[str, Any]) -> None:
    """A process's group of `number` environments: answers each (method, arguments) with (whether
    it went well, the result or the error), until the line ends."""
    try:
        envs = SyncVectorEnv([lambda: SixPhaseDrive(**given)] * number)
        line.send((True, (envs.metadata, envs.single_observation_space, envs.single_action_space)))
    except Exception as error:
        line.send((False, error))
        return
    while True:
        try:
            name, arguments = line.recv()
        except (EOFError, KeyboardInterrupt):
            return
        try:
            line.send((True, getattr(envs, name)(**arguments)))
        except Exception as error:
            line.send((False, error))


class Many(VectorEnv):
    """num_envs environments; cores: processes for them, all cores of this computer if None; given:
    what `SixPhaseDrive` takes. InputError if something is wrong. `close` ends the processes."""

    def __init__(self, num_envs: int = 1, cores: int | None = None, **given: Any) -> None:
        asked: dict[str, Any] = {"num_envs": num_envs, "cores": 1 if cores is None else cores}
        for name, value in asked.items():
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise InputError(f"{name} = {value!r}: a whole number from 1 on is needed")
        self.num_envs = num_envs
        groups = np.array_split(np.arange(num_envs), min(num_envs, cores or usable_cores()))
        self._groups = [slice(group[0], group[-1] + 1) for group in groups]
        context = multiprocessing.get_context("spawn")
        self._lines: list[Connection] = []
        self._processes = []
        for group in groups:
            here, there = context.Pipe()
            process = context.Process(
                target=_serve, args=(there, len(group), given), daemon=True, name="environments"
            )
            process.start()
            there.close()
            self._lines.append(here)
            self._processes.append(process)
        try:
            self.metadata, self.single_observation_space, self.single_action_space = (
                self._answers()[0]
            )
        except BaseException:
            self.close_extras()
            raise
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def _answers(self) -> list[Any]:
        """The answers of all processes. Raises the first error when all have answered."""
        answers = [line.recv() for line in self._lines]
        for well, found in answers:
            if not well:
                raise found
        return [found for _, found in answers]

    def _ask(self, name: str, each: Sequence[dict[str, Any]]) -> list[Any]:
        for line, arguments in zip(self._lines, each, strict=True):
            line.send((name, arguments))
        return self._answers()

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """seed: of each environment, or of the first: the others have the next ones. options: of
        each, as `SixPhaseDrive.reset` has them."""
        if seed is None or isinstance(seed, int):
            seed = [None if seed is None else seed + k for k in range(self.num_envs)]
        each = [{"seed": list(seed[group]), "options": options} for group in self._groups]
        seen, infos = zip(*self._ask("reset", each))
        return np.concatenate(seen), self._merged(infos)

    def step(
        self, actions: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        each = [{"actions": actions[group]} for group in self._groups]
        *found, infos = zip(*self._ask("step", each))
        seen, rewards, terminated, truncated = (np.concatenate(parts) for parts in found)
        return seen, rewards, terminated, truncated, self._merged(infos)

    def _merged(self, infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """One info of all groups. A group has a name only if one of its environments has it."""
        found: dict[str, np.ndarray] = {}
        for group, info in zip(self._groups, infos):
            for name, values in info.items():
                if name not in found:
                    empty = None if values.dtype == object else 0
                    shape = (self.num_envs, *values.shape[1:])
                    found[name] = np.full(shape, empty, values.dtype)
                found[name][group] = values
        return found

    def close_extras(self, **_: Any) -> None:
        for line in self._lines:
            line.close()
        for process in self._processes:
            process.join()
