"""Sweeps of a virtual phantom with a known fault: what is found, what is flat, what survives a
kill, and who may do the work.
"""

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
    """Whether these are the same points with the same errors, in any order; a registration's last
    digits differ from run to run.
    """
    pairs = zip(
        *(sorted(points, key=lambda row: row["number"]) for points in (some, others)), strict=True
    )
    return all(
        (a["number"], a["kind"], a["failure"]) == (b["number"], b["kind"], b["failure"])
        and a["values"] == pytest.approx(b["values"], rel=1e-9)
        and a["error"] == pytest.approx(b["error"], rel=1e-9)
        for a, b in pairs
    )


def test_a_grid_from_coarse_to_fine_finds_the_hidden_radius_and_says_that_it_matters(
    phantom: Path, tmp_path: Path
) -> None:
    found = sweep(
        phantom, tmp_path, SweepSpec(space=ParameterSpace((RADIUS,)), steps=5, levels=3, frames=6)
    )
    assert found["best"]["values"]["tool_radius.radius"] == pytest.approx(6e-3, abs=0.6e-3)
    assert found["best"]["error"] < found["stated"]
    (direction,) = found["directions"]
    assert direction["flat"] is False
    assert 0 < direction["low"] < direction["change"] < direction["high"]
    # Two of five places of each later level are those of the level before.
    assert found["points"] == 16 and found["replays_computed"] < 13


@pytest.mark.parametrize("method", ["random", "tpe", "cmaes"])
def test_other_methods_call_the_modulus_flat_and_not_the_radius(
    phantom: Path, tmp_path: Path, method: Any
) -> None:
    space = ParameterSpace((RADIUS, Axis("young_modulus.E", 2e3, 2e5)))
    found = sweep(phantom, tmp_path, SweepSpec(space=space, method=method, points=16, frames=4))
    flat = {one["name"]: one["flat"] for one in found["directions"]}
    assert flat == {"tool_radius.radius": False, "young_modulus.E": True}
    assert found["best"]["values"]["tool_radius.radius"] == pytest.approx(6e-3, abs=1.2e-3)


def test_what_cannot_be_is_kept_with_its_reason(phantom: Path, tmp_path: Path) -> None:
    buried = ParameterSpace(
        (Axis("stiff_inclusion.z", 0.005, 0.4),),
        {"stiff_inclusion.stiffness_ratio": 5.0, "stiff_inclusion.radius": 0.5},
    )
    found = sweep(phantom, tmp_path, SweepSpec(space=buried, steps=2, frames=1))
    assert found["failed"] == 2 and found["best"] is None
    searched = [row for row in rows(tmp_path) if row["kind"] == "search"]
    assert len(searched) == 2 and all(
        "radius" in row["failure"] and row["error"] is None for row in searched
    )


def test_a_process_that_is_killed_costs_nothing(phantom: Path) -> None:
    stated, data = read_sweep_data(open_dataset(phantom), (), 2)
    tasks = [(RADIUS_SPACE.setup(stated, {RADIUS.name: value}), 0) for value in RADIUS.line(4)]
    executor, found, killed = ProcessExecutor(2, data, GRID), {}, False
    try:
        for told in run_tasks(executor, tasks):
            if told is not None:
                found[told[0]] = told[1]
            if len(found) == 1 and not killed:
                killed = True
                for pool in executor._busy.values():
                    for process in (pool._processes or {}).values():
                        process.kill()
    finally:
        executor.close()
    assert sorted(found) == list(range(4))
    for number, (setup, _) in enumerate(
        tasks
    ):  # another process has another memory, and sums in it another last digit
        alone = replay_errors(setup, data[0], GRID)
        assert (
            (found[number].failure, found[number].lost)
            == (alone.failure, alone.lost)
            == ("", False)
        )
        np.testing.assert_allclose(found[number].sums, alone.sums, rtol=1e-9)


RADIUS_SPACE = ParameterSpace((RADIUS,))
KILLED = """
from pathlib import Path
from palpate.dataset import open_dataset
from palpate.mesh.graded_mesh import SCREEN_GRID
from palpate.sweep import SweepSpec
from palpate.sweep.run_sweep import run_sweep
import json, sys
if __name__ == "__main__":
    data, folder, said = sys.argv[1:]
    folder = Path(folder)
    request = SweepSpec.from_json(json.loads(said))
    run_sweep(open_dataset(Path(data)), request, folder, grid=SCREEN_GRID.for_tool(5e-3), store=folder / "store")
"""


def test_a_sweep_that_is_killed_goes_on_where_it_was(phantom: Path, tmp_path: Path) -> None:
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
        stream.write('{"number": 99, "kin')  # what a kill in the middle of a row leaves
    taken_up = sweep(phantom, folder, request)
    whole = sweep(phantom, tmp_path / "whole", request)
    assert taken_up["replays_computed"] <= whole["replays_computed"] - len(before)
    assert rows(folder)[: len(before)] == before
    assert same(rows(folder), rows(tmp_path / "whole"))
    assert (
        sweep(phantom, tmp_path / "again", request, store=folder / "store")["replays_computed"] == 0
    )


def test_a_dask_cluster_gives_the_same(phantom: Path, tmp_path: Path) -> None:
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


def test_the_error_is_that_of_the_sums(phantom: Path) -> None:
    stated, data = read_sweep_data(open_dataset(phantom), (), 3)
    sums = np.array(replay_errors(stated, data[0], GRID).sums)
    assert error_from_sums(sums.sum(axis=0), "distance") == pytest.approx(
        np.sqrt(sums[:, 0].sum() / sums[:, 1].sum())
    )
    assert error_from_sums(sums.sum(axis=0), "paper") == pytest.approx(sums[:, 2].sum() / 3)
