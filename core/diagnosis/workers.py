"""Replays of all sequences under one setup, spread over processes that keep the measurements."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Generic, ParamSpec, Self, TypeVar

from core.diagnosis.columns import Wanted
from core.diagnosis.comparison import Sample
from core.diagnosis.felt_prediction import predict_forces
from core.diagnosis.observations import Observations
from core.diagnosis.prediction import Prediction, predict
from core.diagnosis.traces import Trace, traces_of
from core.effects import Effect
from core.meshing import Meshing
from core.processes import bound_to_parent, giving_memory_back, keeping_memory
from core.replay import Equilibrium
from core.setup import Setup

__all__ = ["TOLERANCE", "Pending", "Workers"]

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
TOLERANCE = 3e-4
"""Residual of a replay over the tool's push [1]."""
P = ParamSpec("P")
T = TypeVar("T")
_DATA: dict[str, Observations] = {}


def _begin(data: Sequence[Observations]) -> None:
    """Keep the measurements in this process."""
    bound_to_parent()
    keeping_memory()
    _DATA.update({item.name: item for item in data})


@dataclass(frozen=True)
class _Tidily(Generic[P, T]):
    """A task of a module's top level that leaves its process holding no memory which is not in use."""

    task: Callable[P, T]

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return self.task(*args, **kwargs)
        finally:
            giving_memory_back()


def _task(
    name: str,
    setup: Setup,
    grid: Meshing,
    wanted: Wanted | None,
    starts: Sequence[Equilibrium] | None,
    samples: Sequence[Sample] | None,
    tolerance: float,
) -> Prediction:
    if _DATA[name].unseen:
        return predict_forces(_DATA[name], setup, grid, wanted, starts, tolerance)
    found = predict(_DATA[name], setup, grid, wanted, starts, tolerance, samples)
    return found if samples is None else replace(found, samples=())


@dataclass(frozen=True, eq=False)
class Pending:
    """A prediction under way. Points that were chosen before are not sent back: they are most of what there is to send."""

    future: Future[Prediction]
    samples: tuple[Sample, ...] | None

    def result(self) -> Prediction:
        """Wait for it."""
        found = self.future.result()
        return found if self.samples is None else replace(found, samples=self.samples)


def _trace(
    name: str, setup: Setup, grid: Meshing, frames: Sequence[Equilibrium], samples: Sequence[Sample], effects: Sequence[Effect]
) -> list[Trace]:
    return traces_of(_DATA[name], setup, grid, frames, samples, effects)


class Workers:
    """A pool of processes that predict sequences; use as a context manager.

    Args:
        data: measurements of each sequence. count: number of processes.
    """

    def __init__(self, data: Sequence[Observations], count: int) -> None:
        # One thread each: the processes are the parallelism, and small factorisations only lose by sharing cores.
        for name in _THREADS:
            os.environ.setdefault(name, "1")
        self._count = count
        self._pool = self._started(data)

    def _started(self, data: Sequence[Observations]) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self._count, multiprocessing.get_context("spawn"), _begin, (data,))

    def hold(self, data: Sequence[Observations]) -> None:
        """Keep other measurements from now on, in new processes: what the old ones are doing is still done."""
        self._pool.shutdown(wait=True)
        self._pool = self._started(data)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        processes = list(getattr(self._pool, "_processes", {}).values())
        self._pool.shutdown(wait=kind is None, cancel_futures=True)
        if kind is not None:
            for process in processes:
                process.terminate()

    def submit(
        self,
        names: Sequence[str],
        setup: Setup,
        grid: Meshing,
        wanted: Wanted | None = None,
        starts: Sequence[Prediction] | None = None,
        tolerance: float = TOLERANCE,
        same_points: bool = True,
    ) -> list[Pending]:
        """Begin predicting these sequences under a setup.

        Args:
            starts: predictions to begin from, in the same order. same_points: average the same points in the same patches as they.
        """
        pending = []
        for number, name in enumerate(names):
            begin = None if starts is None else starts[number].equilibria
            points = None if starts is None or not same_points else starts[number].samples or None
            future = self.run(_task, name, setup, grid, wanted, begin, points, tolerance)
            pending.append(Pending(future, points))
        return pending

    def trace(
        self, names: Sequence[str], setup: Setup, grid: Meshing, plain: Sequence[Prediction], effects: Sequence[Effect]
    ) -> list[Future[list[Trace]]]:
        """Begin the traces of these effects in these sequences, whose replays without them are `plain`."""
        return [
            self.run(_trace, name, setup, grid, item.equilibria, item.samples, effects)
            for name, item in zip(names, plain, strict=True)
        ]

    def run(self, task: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Begin a task of a module's top level."""
        return self._pool.submit(_Tidily(task), *args, **kwargs)
