"""A pool of processes that hold the measurements and predict sequences."""

from __future__ import annotations

import importlib
import pickle
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Generic, ParamSpec, Self, TypeVar

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.force_prediction import predict_forces
from palpate.diagnosis.forward.history_columns import Trace, traces_of
from palpate.diagnosis.forward.jacobian import JacobianRequest
from palpate.diagnosis.forward.prediction import Prediction, predict
from palpate.diagnosis.forward.ray_comparison import PointSample
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.effects import Effect
from palpate.foundation.processes import ProcessPool, giving_memory_back
from palpate.mesh.graded_mesh import SCREEN_GRID
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Box, Setup, Tool

__all__ = ["Pending", "Workers"]

P = ParamSpec("P")
T = TypeVar("T")
_READ: dict[Path, Observations] = {}
"""Measurements that this process has read, by file."""


def _ready() -> None:
    """Load libraries and the compiled kernels of a replay, which every task needs."""
    importlib.import_module("open3d")
    block = Replay(
        Setup(geometry=Box(size=(0.03, 0.03, 0.02)), tool=Tool(radius=5e-3)),
        SCREEN_GRID,
        CRITERIA.replay.tolerance,
    )
    block.step(np.array([0.0, 0.0, 0.024]))


def _measured(file: Path) -> Observations:
    """Read a sequence's file once; measurements that were held before are dropped."""
    if file not in _READ:
        for other in [other for other in _READ if other.parent != file.parent]:
            del _READ[other]
        _READ[file] = pickle.loads(file.read_bytes())
    return _READ[file]


@dataclass(frozen=True)
class _Tidily(Generic[P, T]):
    """A task that returns the memory it has freed to the operating system.

    Attributes:
        task: function of a module's top level.
    """

    task: Callable[P, T]

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return self.task(*args, **kwargs)
        finally:
            giving_memory_back()


def _task(
    file: Path,
    setup: Setup,
    grid: Meshing,
    request: JacobianRequest | None,
    starts: Sequence[Equilibrium] | None,
    samples: Sequence[PointSample] | None,
    tolerance: float,
) -> Prediction:
    data = _measured(file)
    if data.force_only:
        return predict_forces(data, setup, grid, request, starts, tolerance)
    prediction = predict(data, setup, grid, request, starts, tolerance, samples)
    return prediction if samples is None else replace(prediction, samples=())


@dataclass(frozen=True, eq=False)
class Pending:
    """A pending prediction.

    Attributes:
        future: the prediction, without samples that were given.
        samples: given ones. They are not sent back, because they are most of the data.
    """

    future: Future[Prediction]
    samples: tuple[PointSample, ...] | None

    def result(self) -> Prediction:
        """Wait for the prediction."""
        prediction = self.future.result()
        return prediction if self.samples is None else replace(prediction, samples=self.samples)


def _trace(
    file: Path,
    setup: Setup,
    grid: Meshing,
    frames: Sequence[Equilibrium],
    samples: Sequence[PointSample],
    effects: Sequence[Effect],
) -> list[Trace]:
    return traces_of(_measured(file), setup, grid, frames, samples, effects)


class Workers:
    """A pool of processes that predict sequences; use as a context manager.

    Args:
        data: measurements of each sequence.
        count: number of processes.
    """

    def __init__(self, data: Sequence[Observations], count: int) -> None:
        self._count, self._held = count, 0
        self._folder = tempfile.TemporaryDirectory(prefix="palpate-", ignore_cleanup_errors=True)
        self._pool = ProcessPool(count)
        self.hold(data)

    def start(self) -> None:
        """Start the processes, which takes seconds, before the first tasks."""
        for _ in range(self._count):
            self._pool.submit(_ready)

    def hold(self, data: Sequence[Observations]) -> None:
        """Replace the measurements; pending predictions are of the old ones.

        They are passed in files, which a process reads when it first needs them.
        """
        self._held += 1
        self._home.mkdir()
        for item in data:
            self._file(item.name).write_bytes(pickle.dumps(item, pickle.HIGHEST_PROTOCOL))

    @property
    def _home(self) -> Path:
        return Path(self._folder.name) / str(self._held)

    def _file(self, name: str) -> Path:
        return self._home / f"{name}.pickle"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._pool.shutdown(cancel_futures=True)
        else:
            self._pool.terminate()
        self._folder.cleanup()

    def submit(
        self,
        names: Sequence[str],
        setup: Setup,
        grid: Meshing,
        request: JacobianRequest | None = None,
        starts: Sequence[Prediction] | None = None,
        tolerance: float = CRITERIA.replay.tolerance,
        same_points: bool = True,
    ) -> list[Pending]:
        """Start predicting sequences under a setup.

        Args:
            names: of the sequences.
            setup: under which they are replayed.
            grid: the mesh.
            request: the columns of the Jacobian that are computed; none without it.
            starts: predictions with initial guesses, in the same order.
            tolerance: of the replays, over the tool's push [1].
            same_points: whether to use the points of `starts`.
        """
        pending = []
        for number, name in enumerate(names):
            begin = None if starts is None else starts[number].equilibria
            points = None if starts is None or not same_points else starts[number].samples or None
            future = self.run(
                _task, self._file(name), setup, grid, request, begin, points, tolerance
            )
            pending.append(Pending(future, points))
        return pending

    def trace(
        self,
        names: Sequence[str],
        setup: Setup,
        grid: Meshing,
        plain: Sequence[Prediction],
        effects: Sequence[Effect],
    ) -> list[Future[list[Trace]]]:
        """Start computing the traces of effects in sequences, whose predictions without them are
        `plain`.
        """
        return [
            self.run(_trace, self._file(name), setup, grid, item.equilibria, item.samples, effects)
            for name, item in zip(names, plain, strict=True)
        ]

    def run(self, task: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Start a task of a module's top level."""
        return self._pool.submit(_Tidily(task), *args, **kwargs)
