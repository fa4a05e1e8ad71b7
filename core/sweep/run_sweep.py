"""A sweep at work: points asked for, replays done once each, rows written as they come, and what
the whole says.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from palpate.dataset import Dataset
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import PalpateError, RunError
from palpate.foundation.progress import Report, part, silent
from palpate.mesh.graded_mesh import REPLAY_GRID
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import Setup
from palpate.sweep.executors import ReplayExecutor, make_executor, run_tasks
from palpate.sweep.flat_directions import assess_direction
from palpate.sweep.parameter_space import Axis, Values
from palpate.sweep.replay_cache import ReplayCache, replay_key
from palpate.sweep.result_rows import ResultRows
from palpate.sweep.samplers import point_batches
from palpate.sweep.sweep_data import SweepSequence, read_sweep_data
from palpate.sweep.sweep_error import ReplayResult, error_from_sums
from palpate.sweep.sweep_spec import SweepSpec

__all__ = ["run_sweep"]

_SCAN = 5
"""Values along each parameter through the best point, where the method itself leaves no line
through it."""


def run_sweep(
    dataset: Dataset,
    request: SweepSpec,
    folder: Path,
    *,
    store: Path,
    workers: int = 2,
    scheduler: str | None = None,
    grid: Meshing | None = None,
    report: Report = silent,
) -> dict[str, Any]:
    """Do a sweep, or go on with it, in `folder`: request.json, points.jsonl as points end, and
    summary.json at the end.

    Args:
        store: folder of replays that are known, for all sweeps.
        workers: processes.
        scheduler: address of a dask scheduler instead.
        grid: the mesh; that of all replays unless given.

    RunError where the folder has another sweep.
    """
    registered = {"registration": dataset.accepted.name} if dataset.accepted else {}
    _claim(folder, {**request.to_json(), "dataset": str(dataset.path.name), **registered})
    stated, data = read_sweep_data(
        dataset, request.sequences, request.frames, part(report, 0.0, 0.05)
    )
    grid = grid or REPLAY_GRID.for_tool(stated.tool.radius)
    executor = make_executor(workers, scheduler, data, grid)
    try:
        run = _Run(
            request,
            stated,
            data,
            grid,
            executor,
            ReplayCache(store),
            ResultRows(folder / "points.jsonl"),
            part(report, 0.05, 1.0),
        )
        summary = run.whole()
    finally:
        executor.close()
    _write(folder / "summary.json", summary)
    report(1.0, "done")
    return summary


def _claim(folder: Path, said: dict[str, Any]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "request.json"
    if file.is_file() and json.loads(file.read_text()) != said:
        raise RunError(f"{folder} has another sweep; name another folder", file="request.json")
    _write(file, said)


def _write(file: Path, value: Any) -> None:
    aside = file.with_name(f".{file.name}.part")
    aside.write_text(json.dumps(value, indent=1))
    os.replace(aside, file)


class _Run:
    """One sweep under way; `sums` are those of each point that has an error, over the probes of all
    sequences.
    """

    def __init__(
        self,
        request: SweepSpec,
        stated: Setup,
        data: Sequence[SweepSequence],
        grid: Meshing,
        executor: ReplayExecutor,
        store: ReplayCache,
        rows: ResultRows,
        report: Report,
    ) -> None:
        self.request, self.stated, self.data, self.grid = request, stated, data, grid
        self.executor, self.store, self.rows, self.report = executor, store, rows, report
        self.digests = [item.digest for item in data]
        self.points: list[dict[str, Any]] = []
        self.sums: dict[int, FloatArray] = {}
        self.old = {row["number"]: row for row in rows.read()}
        rows.start(list(self.old.values()))
        self.computed = 0
        axes = request.space.axes
        scans = 0 if request.method == "grid" else _SCAN * len(axes)
        self.planned = 1 + request.planned + scans

    def whole(self) -> dict[str, Any]:
        """All points, then the lines through the best one, then the summary."""
        asked = point_batches(self.request)
        # Along with the first batch, so that no process waits for the stated setup alone.
        errors = self._batch([None, *next(asked)], "search")[1:]
        while True:
            try:
                points = asked.send(errors)
            except StopIteration:
                break
            errors = self._batch(points, "search")
        best = self._best()
        directions = (
            [self._direction(axis, best) for axis in self.request.space.axes] if best else []
        )
        best = self._best()
        failed = [row for row in self.points if row["error"] is None]
        return {
            "format": 1,
            "request": self.request.to_json(),
            "measure": self.request.measure,
            "unit": "m",
            "sequences": [item.name for item in self.data],
            "frames": sum(len(item.times) for item in self.data),
            "probes": sum(len(np.unique(item.probes)) for item in self.data),
            "stated": self.points[0]["error"],
            "best": best,
            "points": len(self.points),
            "failed": len(failed),
            "replays_computed": self.computed,
            "directions": [one for one in directions if one],
        }

    def _best(self) -> dict[str, Any] | None:
        known = [row for row in self.points if row["error"] is not None and row["kind"] != "stated"]
        return min(known, key=lambda row: (row["error"], row["number"]), default=None)

    def _direction(self, axis: Axis, best: dict[str, Any]) -> dict[str, Any] | None:
        """Of a grid the best point at each value of its first level; else a line through the best
        point.
        """
        if self.request.method == "grid":
            first = self.points[1 : 1 + self.request.steps ** len(self.request.space.axes)]
            line = [
                min(rows, key=lambda row: row["error"])
                for rows in _by_value(first, axis.name)
                if rows
            ]
        else:
            begin = len(self.points)
            self._batch(
                [{**best["values"], axis.name: value} for value in axis.line(_SCAN)], "scan"
            )
            line = [row for row in self.points[begin:] if row["error"] is not None]
        if len(line) < 2:
            return None
        sums = np.array([self.sums[row["number"]] for row in line])
        values = [float(row["values"][axis.name]) for row in line]
        return assess_direction(
            axis.name, values, sums, self.request.measure, self.request.seed
        ).to_json()

    def _batch(self, points: Sequence[Values | None], kind: str) -> list[float | None]:
        """Errors [m] of these points, in their order; None is the stated setup, and a kind of its
        own.
        """
        begin = len(self.points)
        setups = [self._setup(point) for point in points]
        keys = [
            []
            if isinstance(one, str)
            else [replay_key(one, digest, self.grid) for digest in self.digests]
            for one in setups
        ]
        self.points += [{} for _ in points]
        known: dict[str, ReplayResult] = {}
        tasks: dict[str, tuple[Setup, int]] = {}
        for setup, own in zip(setups, keys, strict=True):
            if isinstance(setup, str):
                continue
            for number, key in enumerate(own):
                found = known.get(key) or self.store.get(key)
                if found is not None:
                    known[key] = found
                else:
                    tasks.setdefault(key, (setup, number))
        open_rows = dict(enumerate(keys))
        self._settle(open_rows, known, begin, points, setups, kind)
        names = list(tasks)
        for told in run_tasks(self.executor, list(tasks.values())):
            if told is not None:
                known[names[told[0]]] = told[1]
                self.computed += 1
                if not told[1].lost:
                    self.store.put(names[told[0]], told[1])
                self._settle(open_rows, known, begin, points, setups, kind)
            done = begin + len(points) - len(open_rows)
            self.report(min(1.0, done / self.planned), f"{done} of {self.planned} points")
        return [row["error"] for row in self.points[begin:]]

    def _settle(
        self,
        waiting: dict[int, list[str]],
        known: dict[str, ReplayResult],
        begin: int,
        points: Sequence[Values | None],
        setups: Sequence[Setup | str],
        kind: str,
    ) -> None:
        """Write the rows of those points of a batch whose replays are all there."""
        for place in [
            place for place, keys in waiting.items() if all(key in known for key in keys)
        ]:
            setup, keys = setups[place], waiting.pop(place)
            failure = (
                setup
                if isinstance(setup, str)
                else " ".join(filter(None, (known[key].failure for key in keys)))
            )
            values = dict(points[place] or {})
            own = "stated" if points[place] is None else kind
            row: dict[str, Any] = {
                "number": begin + place,
                "kind": own,
                "values": values,
                "error": None,
                "paper": None,
            }
            row["failure"] = failure
            if not failure:
                sums = np.array([probe for key in keys for probe in known[key].sums])
                self.sums[begin + place] = sums
                row["error"] = float(error_from_sums(sums.sum(axis=0), self.request.measure))
                row["paper"] = float(error_from_sums(sums.sum(axis=0), "paper"))
            self.points[begin + place] = row
            if self.old.get(begin + place) != row:
                self.rows.add(row)

    def _setup(self, point: Values | None) -> Setup | str:
        """The setup of a point, or why there is none."""
        try:
            return self.stated if point is None else self.request.space.setup(self.stated, point)
        except PalpateError as error:
            return error.message


def _by_value(rows: Iterable[dict[str, Any]], name: str) -> list[list[dict[str, Any]]]:
    """Points with an error, parted by the value of one parameter."""
    parted: dict[float, list[dict[str, Any]]] = {}
    for row in rows:
        if row["error"] is not None:
            parted.setdefault(row["values"][name], []).append(row)
    return [parted[value] for value in sorted(parted)]
