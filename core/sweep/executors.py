"""Who does the replays: processes of this machine, or the workers of a dask cluster, through one
call.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any, Protocol

from palpate.foundation.errors import SetupError
from palpate.foundation.processes import bound_to, keeping_memory
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import Setup
from palpate.sweep.sweep_data import Watched
from palpate.sweep.sweep_error import Outcomes, measure

__all__ = ["Crew", "Task", "crew_of", "outcomes"]

Task = tuple[Setup, int]
"""A setup, and the number of the sequence that is replayed under it."""
_ATTEMPTS = 2
_HELD: tuple[tuple[Watched, ...], Meshing] | None = None


def _begin(pid: int, data: tuple[Watched, ...], grid: Meshing) -> None:
    global _HELD  # noqa: PLW0603 (what a process is given once)
    bound_to(pid)
    keeping_memory()
    _HELD = (data, grid)


def _measured(setup: Setup, number: int) -> Outcomes:
    assert _HELD is not None
    return measure(setup, _HELD[0][number], _HELD[1])


def _on_worker(setup: Setup, seen: Watched, grid: Meshing) -> Outcomes:
    keeping_memory()
    return measure(setup, seen, grid)


class Crew(Protocol):
    """Something that replays tasks, at most `places` at a time."""

    places: int

    def submit(self, task: Task) -> Future[Outcomes]:
        """Begin one."""

    def close(self) -> None:
        """Stop what runs."""


class Processes:
    """A process for each place, used again; one that dies takes no other's work along."""

    def __init__(self, count: int, data: tuple[Watched, ...], grid: Meshing) -> None:
        for name in (
            "OMP_NUM_THREADS",
            "OPENBLAS_NUM_THREADS",
            "MKL_NUM_THREADS",
            "NUMBA_NUM_THREADS",
        ):
            os.environ.setdefault(name, "1")
        self.places, self._given = count, (os.getpid(), data, grid)
        self._context = get_context("forkserver")
        self._context.set_forkserver_preload(["palpate.sweep.executors"])
        self._idle: list[ProcessPoolExecutor] = []
        self._busy: dict[Future[Outcomes], ProcessPoolExecutor] = {}

    def submit(self, task: Task) -> Future[Outcomes]:
        """Begin one in a process that is free."""
        for future in [future for future in self._busy if future.done()]:
            pool = self._busy.pop(future)
            if isinstance(future.exception(), BrokenProcessPool):
                pool.shutdown(wait=False)
            else:
                self._idle.append(pool)
        pool = (
            self._idle.pop()
            if self._idle
            else ProcessPoolExecutor(1, self._context, _begin, self._given)
        )
        future = pool.submit(_measured, *task)
        self._busy[future] = pool
        return future

    def close(self) -> None:
        """End all processes."""
        for pool in (*self._idle, *self._busy.values()):
            processes = list((pool._processes or {}).values())
            pool.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.terminate()


class Cluster:
    """Workers of a dask cluster (`distributed`), which need this package and nothing of this
    machine's disk.
    """

    def __init__(self, address: str, data: tuple[Watched, ...], grid: Meshing) -> None:
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
                f"the dask scheduler at {address} has no workers; start some with: dask worker {address}",
                key="scheduler",
            )
        self.places = 2 * threads
        self._executor = self._client.get_executor(pure=False, retries=1)
        self._data = [self._client.scatter(item, broadcast=True) for item in data]
        self._grid = grid

    def submit(self, task: Task) -> Future[Outcomes]:
        """Begin one on some worker."""
        setup, number = task
        future: Future[Outcomes] = self._executor.submit(
            _on_worker, setup, self._data[number], self._grid
        )
        return future

    def close(self) -> None:
        """Leave the cluster; its workers stay."""
        self._executor.shutdown(wait=False)
        self._client.close()


def crew_of(workers: int, scheduler: str | None, data: tuple[Watched, ...], grid: Meshing) -> Crew:
    """Processes here, or the cluster whose scheduler is at this address."""
    return Processes(workers, data, grid) if scheduler is None else Cluster(scheduler, data, grid)


def outcomes(
    crew: Crew, tasks: Sequence[Task], pause: float = 1.0
) -> Iterator[tuple[int, Outcomes] | None]:
    """The number of each task with what it gave, as they come; None after each `pause` [s] in which
    none did.

    A task whose process died is tried once more, and then a failure.
    """
    waiting = deque((number, 1) for number in range(len(tasks)))
    running: dict[Future[Outcomes], tuple[int, int]] = {}
    while waiting or running:
        while waiting and len(running) < crew.places:
            number, attempt = waiting.popleft()
            running[crew.submit(tasks[number])] = (number, attempt)
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
                    Outcomes(
                        failure="its process was ended from outside twice, or by running out of memory",
                        lost=True,
                    ),
                )
            else:
                yield number, Outcomes(failure=f"{type(error).__name__}: {error}", lost=True)
