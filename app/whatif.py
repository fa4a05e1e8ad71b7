"""What-if over the wire: one process that solves single frames again, kept warm, started when first asked for."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures import TimeoutError as TooLong
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any, TypeVar

from app.runs import Run
from core.errors import RunError
from core.processes import bound_to_parent

if TYPE_CHECKING:
    from core.whatif import Moment

__all__ = ["WhatIfs"]

T = TypeVar("T")
_PATIENCE = 60.0
"""A frame that finds no equilibrium, or a long past, may take so long [s] before it is given up."""


class WhatIfs:
    """Solves frames of runs again, one at a time, in a process of its own."""

    def __init__(self, patience: float = _PATIENCE) -> None:
        self._patience = patience
        self._pool: ProcessPoolExecutor | None = None
        self._lock = threading.Lock()

    def beginnings(self, run: Run, sequence: str) -> list[dict[str, Any]]:
        """A finite size of each effect, from which to go on by hand."""
        return self._ask(_beginnings, *_key(run, sequence))

    def solve(self, run: Run, sequence: str, frame: int, effects: list[dict[str, Any]], tuned: bool) -> Moment:
        """The frame with these effects; RunError where the solve takes too long or its process ends."""
        return self._ask(_solve, *_key(run, sequence), frame, effects, tuned)

    def close(self) -> None:
        """End the process."""
        with self._lock:
            self._end()

    def _ask(self, task: Callable[..., T], *args: Any) -> T:
        with self._lock:  # one question at a time: the newest answer is what a page waits for
            if self._pool is None:
                self._pool = ProcessPoolExecutor(1, get_context("spawn"), bound_to_parent)
            try:
                return self._pool.submit(task, *args).result(self._patience)
            except TooLong:
                self._end()
                raise RunError(
                    f"this frame found no answer within {self._patience:.0f} s and was given up; take values nearer to the model's"
                ) from None
            except BrokenProcessPool:
                self._end()
                raise RunError("the process that solves ended, most likely for want of memory; try again") from None

    def _end(self) -> None:
        if self._pool is None:
            return
        processes = list((self._pool._processes or {}).values())
        self._pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.terminate()
        self._pool = None


def _key(run: Run, sequence: str) -> tuple[str, str, tuple[int, ...], str]:
    folder = run.origin.get("dataset")
    if folder is None:
        raise RunError(f"run {run.name} does not say where its dataset is; make the run again", run=run.name)
    if "setup" not in run.model:
        raise RunError(f"run {run.name}: model.json states no setup; make the run again", run=run.name, file="model.json")
    clouds = tuple(int(index) for index in run.replay(sequence)["cloud_index"])
    return str(folder), sequence, clouds, json.dumps(run.model)


def _beginnings(folder: str, sequence: str, clouds: tuple[int, ...], model: str) -> list[dict[str, Any]]:
    from core.whatif import opened  # noqa: PLC0415 (heavy)

    return opened(folder, sequence, clouds, model).beginnings()


def _solve(
    folder: str, sequence: str, clouds: tuple[int, ...], model: str, frame: int, effects: list[dict[str, Any]], tuned: bool
) -> Moment:
    from core.diagnosis.kept import effects_from  # noqa: PLC0415 (heavy)
    from core.whatif import opened  # noqa: PLC0415 (heavy)

    return opened(folder, sequence, clouds, model).solve(frame, effects_from(effects), tuned)
