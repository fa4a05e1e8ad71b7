"""Execution of a sweep: sample points, replay each setup once, write rows, and summarise."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from palpate.dataset import Dataset
from palpate.dataset.provenance import check_data, check_unchanged, made_from
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import PalpateError, RunError
from palpate.foundation.progress import Report, part, silent
from palpate.mesh.default_meshes import Use, motion_mesh
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import Setup
from palpate.sweep.executors import ReplayExecutor, make_executor, run_tasks
from palpate.sweep.flat_directions import assess_direction, assess_gain
from palpate.sweep.parameter_space import Axis, Values
from palpate.sweep.replay_cache import ReplayCache, replay_key
from palpate.sweep.result_rows import ResultRows
from palpate.sweep.samplers import point_batches
from palpate.sweep.sweep_data import SweepSequence, read_sweep_data
from palpate.sweep.sweep_error import ReplayResult, error_from_sums
from palpate.sweep.sweep_sentence import sweep_sentence
from palpate.sweep.sweep_spec import SweepSpec

__all__ = ["run_sweep"]

_SCAN = 5
"""Values along each parameter through the best point, after a method that is not a grid."""


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
    """Run a sweep in `folder`, or resume the one that is there; return its summary.

    Writes request.json, a row of points.jsonl as each point finishes, and summary.json at the end.

    Args:
        dataset: the dataset.
        request: what to sweep.
        folder: folder of this sweep.
        store: folder of the replay cache, which all sweeps share.
        workers: number of local processes.
        scheduler: address of a dask scheduler, which is used instead of local processes.
        grid: mesh protocol; that of a replay if None.
        report: receives the progress.

    Raises RunError where the folder holds another sweep.
    """
    registered = {"registration": dataset.accepted.name} if dataset.accepted else {}
    made = made_from(dataset.path)
    _claim(folder, {**request.to_json(), "dataset": str(dataset.path.name), **registered}, made)
    read = read_sweep_data(
        dataset, request.sequences, request.frames, part(report, 0.0, 0.05), request.space
    )
    grid = grid or _mesh_of(read.stated, read.sequences)
    executor = make_executor(workers, scheduler, read.sequences, grid)
    try:
        run = _SweepRun(
            request,
            read.stated,
            read.sequences,
            grid,
            executor,
            ReplayCache(store),
            ResultRows(folder / "points.jsonl"),
            part(report, 0.05, 1.0),
            {**made, "seed": request.seed},
            read.rest_error(grid, request.measure),
        )
        summary = {**run.run(), "made_from": {**made, "seed": request.seed}}
        check_unchanged(dataset.path, made)
    finally:
        executor.close()
    _write(folder / "summary.json", summary)
    report(1.0, "done")
    return summary


def _mesh_of(stated: Setup, data: Sequence[SweepSequence]) -> Meshing:
    """The mesh of a replay of all sequences."""
    centres = [
        stated.phantom_from_robot.apply(smooth_centres(one.kinematics, one.times)) for one in data
    ]
    every = np.concatenate(centres)
    return motion_mesh(Use.REPLAY, stated.geometry, stated.tool.radius, every)


def _claim(folder: Path, content: dict[str, Any], made: dict[str, Any]) -> None:
    """Write the request, or compare it with the one that is there, and the data with its data."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "request.json"
    if file.is_file():
        known = json.loads(file.read_text())
        before = known.pop("made_from", {})
        if known != content:
            raise RunError(
                f"{folder} holds another sweep; name another folder", file="request.json"
            )
        check_data(before, made, "sweep", folder.name)
    _write(file, {**content, "made_from": made})


def _write(file: Path, value: Any) -> None:
    aside = file.with_name(f".{file.name}.part")
    aside.write_text(json.dumps(value, indent=1))
    os.replace(aside, file)


class _SweepRun:
    """One running sweep.

    Attributes:
        points: the rows of all points so far.
        made: digests of data and code, version, commit and seed, which every row states.
        at_rest: error of the untouched phantom [m], which no push explains.
        sums: sums (p, 4) over the pushes of all sequences, by the number of each solved point.
        old: rows of an earlier, interrupted run by number.
        computed: number of replays that were not in the cache.
        planned: number of points, for the progress.
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
        made: dict[str, Any],
        at_rest: float,
    ) -> None:
        self.request, self.stated, self.data, self.grid = request, stated, data, grid
        self.executor, self.store, self.rows, self.report = executor, store, rows, report
        self.made, self.at_rest = made, at_rest
        self.digests = [item.digest for item in data]
        self.points: list[dict[str, Any]] = []
        self.sums: dict[int, FloatArray] = {}
        self.old = {row["number"]: row for row in rows.read()}
        rows.start(list(self.old.values()))
        self.computed = 0
        axes = request.space.axes
        scans = 0 if request.method == "grid" else _SCAN * len(axes)
        self.planned = 1 + request.planned + scans

    def run(self) -> dict[str, Any]:
        """Evaluate all points, then lines through the best one, and return the summary."""
        sampler = point_batches(self.request)
        # The stated setup joins the first batch, so that no process waits for it alone.
        errors = self._batch([None, *next(sampler)], "search")[1:]
        while True:
            try:
                points = sampler.send(errors)
            except StopIteration:
                break
            errors = self._batch(points, "search")
        best = self._best()
        directions = (
            [self._direction(axis, best) for axis in self.request.space.axes] if best else []
        )
        best = self._best()
        failed = [row for row in self.points if row["error"] is None]
        summary = {
            "format": 1,
            "request": self.request.to_json(),
            "measure": self.request.measure,
            "unit": "m",
            "sequences": [item.name for item in self.data],
            "frames": sum(len(item.times) for item in self.data),
            "probes": sum(len(np.unique(item.probes)) for item in self.data),
            "stated": self.points[0]["error"],
            "stated_values": self.request.space.stated_values(self.stated),
            "at_rest": self.at_rest,
            "best": best,
            "gain": self._gain(best),
            "points": len(self.points),
            "failed": len(failed),
            "replays_computed": self.computed,
            "directions": [one for one in directions if one],
        }
        return {**summary, "sentence": sweep_sentence(summary)}

    def _gain(self, best: dict[str, Any] | None) -> dict[str, float] | None:
        """Gain of the best point over the stated setup; None without either."""
        if best is None or 0 not in self.sums:
            return None
        tried = sum(row["error"] is not None for row in self.points) - 1
        found = self.sums[best["number"]]
        return assess_gain(self.sums[0], found, tried, self.request.measure, self.request.seed)

    def _best(self) -> dict[str, Any] | None:
        known = [row for row in self.points if row["error"] is not None and row["kind"] != "stated"]
        return min(known, key=lambda row: (row["error"], row["number"]), default=None)

    def _direction(self, axis: Axis, best: dict[str, Any]) -> dict[str, Any] | None:
        """Assess one parameter; None with fewer than two solved points along it.

        Uses the best point at each value of a grid's first level, or else a line of new points
        through the best one.
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
        """Evaluate points and return their errors [m] in order; None for a failed point.

        The point None is the stated setup; its row has the kind "stated".
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
                stored = known.get(key) or self.store.get(key)
                if stored is not None:
                    known[key] = stored
                else:
                    tasks.setdefault(key, (setup, number))
        open_rows = dict(enumerate(keys))
        self._settle(open_rows, known, begin, points, setups, kind)
        names = list(tasks)
        for finished in run_tasks(self.executor, list(tasks.values())):
            if finished is not None:
                key, result = names[finished[0]], finished[1]
                known[key] = result
                self.computed += 1
                if not result.lost:
                    self.store.put(key, result)
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
        """Write the rows of the points of a batch whose replays have all finished."""
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
            row |= {"failure": failure, **self.made}
            if not failure:
                sums = np.array([probe for key in keys for probe in known[key].sums])
                self.sums[begin + place] = sums
                row["error"] = float(error_from_sums(sums.sum(axis=0), self.request.measure))
                row["paper"] = float(error_from_sums(sums.sum(axis=0), "paper"))
            self.points[begin + place] = row
            if self.old.get(begin + place) != row:
                self.rows.add(row)

    def _setup(self, point: Values | None) -> Setup | str:
        """Return the setup of a point, or the reason why it is invalid."""
        try:
            return self.stated if point is None else self.request.space.setup(self.stated, point)
        except PalpateError as error:
            return error.message


def _by_value(rows: Iterable[dict[str, Any]], name: str) -> list[list[dict[str, Any]]]:
    """Group the solved points by the value of one parameter, in increasing order."""
    groups: dict[float, list[dict[str, Any]]] = {}
    for row in rows:
        if row["error"] is not None:
            groups.setdefault(row["values"][name], []).append(row)
    return [groups[value] for value in sorted(groups)]
