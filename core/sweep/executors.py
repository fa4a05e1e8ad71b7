"""Executors of a sweep's replays: processes of this machine or the workers of a dask cluster."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Protocol

from palpate.foundation.errors import SetupError
from palpate.foundation.processes import ProcessPool, keeping_memory
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import Setup
from palpate.sweep.sweep_data import SweepSequence
from palpate.sweep.sweep_error import ReplayResult, replay_errors

__all__ = ["ReplayExecutor", "Task", "make_executor", "run_tasks"]

Task = tuple[Setup, int]
"""A setup, and the number of the sequence that is replayed under it."""
_ATTEMPTS = 2
"""Attempts at a task before it counts as failed."""
_SHARED: tuple[tuple[SweepSequence, ...], Meshing] | None = None


def _begin(data: tuple[SweepSequence, ...], grid: Meshing) -> None:
    global _SHARED  # noqa: PLW0603 (set once, when a process starts)
    _SHARED = (data, grid)


def _run_in_process(setup: Setup, number: int) -> ReplayResult:
    assert _SHARED is not None
    return replay_errors(setup, _SHARED[0][number], _SHARED[1])


def _run_on_worker(setup: Setup, sequence: SweepSequence, grid: Meshing) -> ReplayResult:
    keeping_memory()
    return replay_errors(setup, sequence, grid)


class ReplayExecutor(Protocol):
    """Runs replay tasks asynchronously, at most `slots` of them at a time."""

    slots: int

    def submit(self, task: Task) -> Future[ReplayResult]:
        """Start a task and return its future."""

    def close(self) -> None:
        """Stop all running tasks."""


class ProcessExecutor:
    """Local processes, one pool per process: a process that dies interrupts no other task."""

    def __init__(self, count: int, data: tuple[SweepSequence, ...], grid: Meshing) -> None:
        self.slots, self._given = count, (data, grid)
        self._idle: list[ProcessPool] = []
        self._busy: dict[Future[ReplayResult], ProcessPool] = {}

    def submit(self, task: Task) -> Future[ReplayResult]:
        """Start a task in an idle process, or in a new one."""
        for future in [future for future in self._busy if future.done()]:
            pool = self._busy.pop(future)
            if isinstance(future.exception(), BrokenProcessPool):
                pool.shutdown(wait=False)
            else:
                self._idle.append(pool)
        pool = (
            self._idle.pop()
            if self._idle
            else ProcessPool(
                1, start="forkserver", preload=[__name__], begin=_begin, args=self._given
            )
        )
        future = pool.submit(_run_in_process, *task)
        self._busy[future] = pool
        return future

    def close(self) -> None:
        """Terminate all processes."""
        for pool in (*self._idle, *self._busy.values()):
            pool.terminate()


class DaskExecutor:
    """Workers of a dask cluster (`distributed`).

    The workers need this package installed, but no access to this machine's disk: the data are
    sent to them.
    """

    def __init__(self, address: str, data: tuple[SweepSequence, ...], grid: Meshing) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise SetupError(
                "dask.distributed is not installed: pip install 'palpate[cluster]'", key="scheduler"
            ) from error
        try:
            self._client: Any = Client(address, timeout="20s")
        except (OSError, ValueError) as error:
            raise SetupError(
                f"no dask scheduler answers at {address} ({error})", key="scheduler", value=address
            ) from error
        threads = sum(self._client.nthreads().values())
        if not threads:
            self._client.close()
            raise SetupError(
                f"the dask scheduler at {address} has no workers; "
                f"start some with: dask worker {address}",
                key="scheduler",
            )
        self.slots = 2 * threads
        self._executor = self._client.get_executor(pure=False, retries=1)
        self._data = [self._client.scatter(item, broadcast=True) for item in data]
        self._grid = grid

    def submit(self, task: Task) -> Future[ReplayResult]:
        """Start a task on any worker."""
        setup, number = task
        future: Future[ReplayResult] = self._executor.submit(
            _run_on_worker, setup, self._data[number], self._grid
        )
        return future

    def close(self) -> None:
        """Disconnect from the cluster; its workers keep running."""
        self._executor.shutdown(wait=False)
        self._client.close()


def make_executor(
    workers: int, scheduler: str | None, data: tuple[SweepSequence, ...], grid: Meshing
) -> ReplayExecutor:
    """Return an executor: local processes, or a dask cluster where a scheduler is given.

    Args:
        workers: number of local processes.
        scheduler: address of a dask scheduler, or None.
        data: the sequences that tasks refer to by number.
        grid: the mesh protocol of all replays.
    """
    return (
        ProcessExecutor(workers, data, grid)
        if scheduler is None
        else DaskExecutor(scheduler, data, grid)
    )


def run_tasks(
    executor: ReplayExecutor, tasks: Sequence[Task], pause: float = 1.0
) -> Iterator[tuple[int, ReplayResult] | None]:
    """Yield the number and the result of each task as it finishes.

    Yields None after each `pause` [s] in which no task finished. A task whose process died is
    tried once more; then its result is a failure.
    """
    waiting = deque((number, 1) for number in range(len(tasks)))
    running: dict[Future[ReplayResult], tuple[int, int]] = {}
    while waiting or running:
        while waiting and len(running) < executor.slots:
            number, attempt = waiting.popleft()
            running[executor.submit(tasks[number])] = (number, attempt)
        done = wait(running, timeout=pause, return_when=FIRST_COMPLETED).done
        if not done:
            yield None
        for future in done:
            number, attempt = running.pop(future)
            error = future.exception()
            if error is None:
                yield number, future.result()
            elif attempt < _ATTEMPTS:
                waiting.append((number, attempt + 1))
            elif isinstance(error, BrokenProcessPool):
                yield (
                    number,
                    ReplayResult(
                        failure="its process was killed twice, or ran out of memory", lost=True
                    ),
                )
            else:
                yield number, ReplayResult(failure=f"{type(error).__name__}: {error}", lost=True)
