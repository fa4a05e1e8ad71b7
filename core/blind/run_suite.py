"""Runs a suite: one process for each case, with results on disk as they come.

A run that is stopped leaves no processes and no temporary files.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.blind.case_results import RESULTS_FILE, CaseResult, add_result, read_results
from palpate.blind.case_scenarios import drawn_of
from palpate.blind.cases import Case
from palpate.foundation.errors import RunError
from palpate.foundation.processes import ProcessPool
from palpate.foundation.progress import Report, silent
from palpate.foundation.source_digest import source_digest

if TYPE_CHECKING:
    from palpate.synthetic import Scenario, ShapeScenario, Truth

__all__ = ["known_results", "run_case", "run_suite", "source_digest"]

Run = Callable[[Case, Path], CaseResult]
_PATIENCE = 5.0
"""Time that a terminated process gets before it is killed [s]."""


def run_suite(
    folder: Path,
    cases: Sequence[Case],
    workers: int,
    report: Report = silent,
    *,
    any_version: bool = False,
    again: bool = False,
    run: Run | None = None,
) -> list[CaseResult]:
    """Run all cases that have no result in `folder`/results.jsonl, and add the results to it.

    Args:
        folder: of the suite.
        cases: to be run.
        workers: number of cases at the same time.
        report: of the progress.
        any_version: whether results of other versions of the code are accepted; without it they
            raise a RunError.
        again: whether cases that ended in an error are repeated.
        run: runs one case; `run_case` without it.

    Returns:
        the results of all cases in their order.

    Raises:
        RunError: where a result of the same name belongs to another case.
    """
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / RESULTS_FILE
    read_results(file, mend=True)
    known = {
        one.name: one
        for one in known_results(folder, cases, any_version)
        if not (again and one.error)
    }
    missing = [case for case in cases if case.name not in known]
    done = len(cases) - len(missing)
    report(done / max(1, len(cases)), f"{done} of {len(cases)} were there already")
    place = Path(tempfile.mkdtemp(prefix=".making-", dir=folder))
    try:
        for result in _outcomes(missing, place, workers, run or run_case):
            known[result.name] = result
            add_result(file, result)
            done += 1
            report(done / len(cases), f"{result.name}: {result.verdict}")
    finally:
        shutil.rmtree(place, ignore_errors=True)
    return [known[case.name] for case in cases]


def known_results(
    folder: Path, cases: Sequence[Case], any_version: bool = False
) -> list[CaseResult]:
    """Read the results of these cases that are done, in their order; of two of one name the later.

    Raises RunError as `run_suite` does.
    """
    file = folder / RESULTS_FILE
    expected, digest = {case.name: case for case in cases}, source_digest()
    known: dict[str, CaseResult] = {}
    for result in read_results(file):
        case = expected.get(result.name)
        if case is None:
            continue
        if result.case != case:
            text = (
                f"{file}: {result.name} was {result.case}, now it is {case}; name another "
                "folder, or remove the row"
            )
            raise RunError(text, case=result.name)
        if result.code != digest and not any_version:
            text = (
                f"{file}: {result.name} was made by version {result.code or 'unknown'} of the "
                f"code, this is {digest}; "
                "name another folder, or allow any version: the summary then says which there are"
            )
            raise RunError(text, case=result.name)
        known[result.name] = result
    return [known[case.name] for case in cases if case.name in known]


def run_case(
    case: Case, folder: Path, kept: Path | None = None, store: Path | None = None
) -> CaseResult:
    """Make the dataset of a case, diagnose it without the truth, and score it.

    An error on the way is a result, too, and counts as wrong.

    Args:
        case: to be run.
        folder: for temporary files.
        kept: folder in which datasets/CASE and runs/CASE stay, the run with replays and controls;
            None keeps only the result.
        store: folder of made datasets, which stay there and are used again; None makes each anew.
    """
    from palpate.blind.dataset_store import make_drawn, scenario_in, stored_dataset
    from palpate.dataset import open_dataset
    from palpate.diagnosis.pipeline import diagnose

    place, doing, began, seconds = (
        kept or folder / case.name,
        "making the dataset",
        time.monotonic(),
        0.0,
    )
    dataset, run, whole = (
        place / "datasets" / case.name,
        place / "runs" / case.name,
        kept is not None,
    )
    hidden: list[dict[str, Any]] = []
    outside: list[dict[str, Any]] = []
    try:
        drawn = drawn_of(case)
        scenario = scenario_in(drawn)
        for older in (dataset, run):
            shutil.rmtree(older, ignore_errors=True)
        if store is None:
            made = make_drawn(dataset, drawn, case.seed)
        else:
            dataset, made = stored_dataset(store, case.name, drawn, case.seed)
        hidden, outside = _truth(made, drawn)
        doing, began = "diagnosing it", time.monotonic()
        result = diagnose(open_dataset(dataset), run, workers=1, replays=whole, assurance=whole)
        seconds = round(time.monotonic() - began, 1)
    except Exception as error:  # any one: 200 cases must not end with it
        return CaseResult(
            case,
            hidden,
            outside=outside,
            seconds=seconds,
            code=source_digest(),
            error=f"{doing}: {type(error).__name__}: {error}",
        )
    finally:
        if not whole:
            shutil.rmtree(place, ignore_errors=True)
    from palpate.blind.effect_sizes import size_over_limit

    ambiguity_map = result.pop("ambiguity_map", [])
    size = size_over_limit(made.effects, ambiguity_map, scenario, made.camera_shift)
    result["ambiguity_map"] = [row for row in ambiguity_map if row["effect"] in case.hidden]
    return CaseResult(case, hidden, result, outside, size, seconds, source_digest())


def _truth(
    made: Truth, drawn: Scenario | ShapeScenario
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Hidden effects and disturbances, with a camera's pose in the parameters of a report, and a
    tube's line.
    """
    from palpate.blind.dataset_store import scenario_in
    from palpate.blind.effect_sizes import camera_pose
    from palpate.blind.located_causes import true_line
    from palpate.setup.setup import Box
    from palpate.synthetic import ShapeScenario

    described, scenario = made.as_dict(), scenario_in(drawn)
    for entry, hidden in zip(described["effects"], made.effects, strict=True):
        if hidden.effect == "camera_registration":
            pose = camera_pose(made.camera_shift, scenario.size)
            entry["parameters"] |= {
                name: {"value": value, "unit": "m" if name[0] == "t" else "rad"}
                for name, value in pose.items()
            }
        if hidden.effect == "stiff_tube":
            block = Box(size=scenario.true_size)
            body = drawn.true if isinstance(drawn, ShapeScenario) else block
            entry["polyline"] = true_line(hidden, body)
    return described["effects"], described.get("disturbances", [])


def _outcomes(cases: Sequence[Case], place: Path, workers: int, run: Run) -> Iterator[CaseResult]:
    """Results as they come. Each case has a process of its own, so that one that dies takes no
    other along.
    """
    waiting = deque(cases)
    running: dict[Future[CaseResult], tuple[Case, ProcessPool]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                case, pool = (
                    waiting.popleft(),
                    ProcessPool(1, start="forkserver", preload=["palpate.blind"]),
                )
                running[pool.submit(run, case, place)] = (case, pool)
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                case, pool = running.pop(future)
                result = _result(future, case)
                pool.shutdown()
                yield result
    finally:
        for _, pool in running.values():
            pool.terminate(_PATIENCE)


def _result(future: Future[CaseResult], case: Case) -> CaseResult:
    try:
        return future.result()
    except BrokenProcessPool:
        error = "its process was ended from outside, or by running out of memory"
    except Exception as problem:
        error = f"{type(problem).__name__}: {problem}"
    return CaseResult(case, code=source_digest(), error=error)
