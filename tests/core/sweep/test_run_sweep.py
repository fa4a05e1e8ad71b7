"""Sweeps of a virtual phantom with a known error: optimum, flat directions, resuming, executors."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from palpate.dataset import open_dataset
from palpate.mesh.graded_mesh import SCREEN_GRID
from palpate.sweep import Axis, ParameterSpace, SweepSpec
from palpate.sweep.executors import ProcessExecutor, run_tasks
from palpate.sweep.run_sweep import run_sweep
from palpate.sweep.sweep_data import read_sweep_data
from palpate.sweep.sweep_error import error_from_sums, replay_errors

RADIUS = Axis("tool_radius.radius", 4e-3, 8e-3)
GRID = SCREEN_GRID.for_tool(5e-3)


def sweep(phantom: Path, folder: Path, request: SweepSpec, **others: Any) -> dict[str, Any]:
    return run_sweep(
        open_dataset(phantom), request, folder, grid=GRID, **{"store": folder / "store", **others}
    )


def rows(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "points.jsonl").read_text().splitlines()]


def same(some: list[dict[str, Any]], others: list[dict[str, Any]]) -> bool:
    """Compare points and errors in any order, to the digits in which registrations agree."""
    pairs = zip(
        *(sorted(points, key=lambda row: row["number"]) for points in (some, others)), strict=True
    )
    return all(
        (a["number"], a["kind"], a["failure"]) == (b["number"], b["kind"], b["failure"])
        and a["values"] == pytest.approx(b["values"], rel=1e-9)
        and a["error"] == pytest.approx(b["error"], rel=1e-9)
        for a, b in pairs
    )


def test_refined_grid_finds_the_hidden_radius_and_it_is_not_flat(
    phantom: Path, tmp_path: Path
) -> None:
    summary = sweep(
        phantom, tmp_path, SweepSpec(space=ParameterSpace((RADIUS,)), steps=5, levels=3, frames=6)
    )
    assert summary["best"]["values"]["tool_radius.radius"] == pytest.approx(6e-3, abs=0.6e-3)
    assert summary["best"]["error"] < summary["stated"]
    (direction,) = summary["directions"]
    assert direction["flat"] is False
    assert 0 < direction["low"] < direction["change"] < direction["high"]
    assert direction["least"][0] < 6.1e-3 and direction["least"][1] > 5.9e-3
    assert (direction["little"], direction["edge"]) == (False, "")
    assert 0 < summary["gain"]["low"] < summary["gain"]["value"]
    assert 0 < summary["at_rest"] < summary["best"]["error"] * 1.5
    assert summary["sentence"].startswith("Least error 0.") and "tool radius" in summary["sentence"]
    # Two of five points of each later level repeat points of the level before.
    assert summary["points"] == 16 and summary["replays_computed"] < 13


@pytest.mark.parametrize("method", ["random", "tpe", "cmaes"])
def test_other_methods_report_the_modulus_flat_and_not_the_radius(
    phantom: Path, tmp_path: Path, method: Any
) -> None:
    space = ParameterSpace((RADIUS, Axis("young_modulus.E", 2e3, 2e5)))
    summary = sweep(phantom, tmp_path, SweepSpec(space=space, method=method, points=16, frames=4))
    flat = {one["name"]: one["flat"] for one in summary["directions"]}
    assert flat == {"tool_radius.radius": False, "young_modulus.E": True}
    assert "cannot tell young modulus" in summary["sentence"]
    assert "kPa" not in summary["sentence"]
    assert summary["best"]["values"]["tool_radius.radius"] == pytest.approx(6e-3, abs=1.2e-3)


def test_failed_points_are_stored_with_their_reason(phantom: Path, tmp_path: Path) -> None:
    buried = ParameterSpace(
        (Axis("stiff_inclusion.z", 0.005, 0.4),),
        {"stiff_inclusion.stiffness_ratio": 5.0, "stiff_inclusion.radius": 0.5},
    )
    summary = sweep(phantom, tmp_path, SweepSpec(space=buried, steps=2, frames=1))
    assert summary["failed"] == 2 and summary["best"] is None
    searched = [row for row in rows(tmp_path) if row["kind"] == "search"]
    assert len(searched) == 2 and all(
        "radius" in row["failure"] and row["error"] is None for row in searched
    )


def test_task_of_a_killed_process_is_repeated(phantom: Path) -> None:
    read = read_sweep_data(open_dataset(phantom), (), 2)
    stated, data = read.stated, read.sequences
    tasks = [(RADIUS_SPACE.setup(stated, {RADIUS.name: value}), 0) for value in RADIUS.line(4)]
    executor, results, killed = ProcessExecutor(2, data, GRID), {}, False
    try:
        for finished in run_tasks(executor, tasks):
            if finished is not None:
                results[finished[0]] = finished[1]
            if len(results) == 1 and not killed:
                killed = True
                for pool in executor._busy.values():
                    for process in (pool._processes or {}).values():
                        process.kill()
    finally:
        executor.close()
    assert sorted(results) == list(range(4))
    for number, (setup, _) in enumerate(tasks):
        # Sums differ in the last digit between processes, whose arrays are aligned differently.
        alone = replay_errors(setup, data[0], GRID)
        assert (
            (results[number].failure, results[number].lost)
            == (alone.failure, alone.lost)
            == ("", False)
        )
        np.testing.assert_allclose(results[number].sums, alone.sums, rtol=1e-9)


RADIUS_SPACE = ParameterSpace((RADIUS,))
KILLED = """
from pathlib import Path
from palpate.dataset import open_dataset
from palpate.mesh.graded_mesh import SCREEN_GRID
from palpate.sweep import SweepSpec
from palpate.sweep.run_sweep import run_sweep
import json, sys
if __name__ == "__main__":
    data, folder, text = sys.argv[1:]
    folder = Path(folder)
    request = SweepSpec.from_json(json.loads(text))
    grid = SCREEN_GRID.for_tool(5e-3)
    run_sweep(open_dataset(Path(data)), request, folder, grid=grid, store=folder / "store")
"""


def test_killed_sweep_resumes_where_it_was(phantom: Path, tmp_path: Path) -> None:
    request = SweepSpec(space=RADIUS_SPACE, method="tpe", points=10, frames=3, seed=2)
    folder, script = tmp_path / "killed", tmp_path / "killed.py"
    script.write_text(KILLED)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, str(script), str(phantom), str(folder), json.dumps(request.to_json())],
        env=environment,
    )
    file = folder / "points.jsonl"
    while process.poll() is None and not (file.is_file() and file.read_text().count("\n") >= 3):
        time.sleep(0.05)
    process.kill()
    process.wait()
    before = rows(folder)
    assert 3 <= len(before) < 16
    with file.open("a") as stream:
        stream.write('{"number": 99, "kin')  # left by a kill while a row is written
    resumed = sweep(phantom, folder, request)
    whole = sweep(phantom, tmp_path / "whole", request)
    assert resumed["replays_computed"] <= whole["replays_computed"] - len(before)
    assert rows(folder)[: len(before)] == before
    assert same(rows(folder), rows(tmp_path / "whole"))
    assert (
        sweep(phantom, tmp_path / "again", request, store=folder / "store")["replays_computed"] == 0
    )


def test_dask_cluster_gives_the_same_points(phantom: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    request = SweepSpec(space=RADIUS_SPACE, steps=4, frames=2)
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        dashboard_address=None,
        scheduler_kwargs={"dashboard": False},
    ) as cluster:
        shared = sweep(phantom, tmp_path / "cluster", request, scheduler=cluster.scheduler_address)
    here = sweep(phantom, tmp_path / "here", request)
    assert shared["points"] == here["points"] == 5
    assert same(rows(tmp_path / "cluster"), rows(tmp_path / "here"))
    assert shared["best"]["values"] == here["best"]["values"]
    assert [one["flat"] for one in shared["directions"]] == [
        one["flat"] for one in here["directions"]
    ]


def test_error_is_computed_from_the_sums(phantom: Path) -> None:
    read = read_sweep_data(open_dataset(phantom), (), 3)
    stated, data = read.stated, read.sequences
    sums = np.array(replay_errors(stated, data[0], GRID).sums)
    assert error_from_sums(sums.sum(axis=0), "distance") == pytest.approx(
        np.sqrt(sums[:, 0].sum() / sums[:, 1].sum())
    )
    assert error_from_sums(sums.sum(axis=0), "paper") == pytest.approx(sums[:, 2].sum() / 3)
