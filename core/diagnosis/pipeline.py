"""The diagnosis of a dataset: causes of the simulation's error, extended model, and report."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from palpate.dataset import Dataset
from palpate.dataset.provenance import check_unchanged, made_from
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.criteria.tolerance import Tolerance
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.gain.force_gain import ForceGain
from palpate.diagnosis.gain.held_out_gain import held_out_gain
from palpate.diagnosis.gain.surface_gain import SurfaceGain
from palpate.diagnosis.gain.tuned_setup import tuned_setup
from palpate.diagnosis.inference.credible_intervals import as_stated
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.problem_of_dataset import problem_of_dataset
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.observation.observe_splits import (
    SplitObservations,
    check_splits,
    observe_splits,
)
from palpate.diagnosis.report.error_clues import error_clues
from palpate.diagnosis.report.error_patterns import draw_patterns, error_patterns
from palpate.diagnosis.report.file_frame import with_places_in_file
from palpate.diagnosis.report.force_report import with_palpation
from palpate.diagnosis.report.palpation_figure import draw_palpation
from palpate.diagnosis.report.report import report_of, verdict_of
from palpate.diagnosis.report.stiffness.map_figure import draw_map
from palpate.diagnosis.report.stiffness.map_report import map_to_json
from palpate.diagnosis.report.stiffness.stiffness_map import stiffness_map_of
from palpate.diagnosis.report.supplements import with_supplements
from palpate.diagnosis.search.findings import Findings
from palpate.diagnosis.search.forward_selection import search
from palpate.diagnosis.validation.checks import AllClearChecks
from palpate.diagnosis.validation.force_contradiction import force_contradiction
from palpate.diagnosis.validation.held_out_check import check_held_out
from palpate.diagnosis.validation.held_out_evidence import gain_on_held_out
from palpate.diagnosis.validation.rejection import rejection_reason
from palpate.diagnosis.validation.stiffness_error_test import largest_stiffness_error
from palpate.experiment import Experiment
from palpate.foundation.errors import RunError
from palpate.foundation.progress import Report, part, rising, silent
from palpate.mesh.default_meshes import Use, default_spec
from palpate.recording.record_sequence import record
from palpate.setup.setup import Sensor, Setup

__all__ = ["diagnose"]


def diagnose(
    dataset: Dataset,
    out: Path,
    *,
    workers: int = 2,
    report: Report = silent,
    seed: int = 0,
    replays: bool = True,
    assurance: bool = True,
    tolerance: float | None = None,
) -> dict[str, Any]:
    """Find the causes of the stated simulation's error, write a run folder and return the report.

    Args:
        dataset: as opened.
        out: run folder to make. It is written aside and renamed, so that it is complete or absent.
        workers: number of processes.
        report: progress; may raise Cancelled.
        seed: of the null draws and the bootstrap.
        replays: whether every sequence is recorded for the page.
        assurance: whether controls, profiles and the next probe, which change no verdict, are
            computed.
        tolerance: size (RMS) of structured error from which on it matters [m]; the larger of 0.1 mm
            and 3 % of the surface's motion if None.

    Fits and choices use the train and validation sequences, the gain uses the test sequences.
    Raises DiagnosisError where the data cannot carry a diagnosis, DatasetError and
    RegistrationError where they are wrong.
    """
    out = Path(out)
    if out.exists():
        raise RunError(f"{out} exists already; name another folder or move it away", file=str(out))
    report = rising(report)
    check_splits(dataset)
    report(0.0, "reading every cloud")
    made = made_from(dataset.path)
    with Workers([], workers) as pool:
        pool.start()
        dataset.validate(part(report, 0.0, 0.02))
        experiment = Experiment.of(dataset)
        sensor = experiment.stated.sensor
        data = _observed(experiment, sensor, pool, part(report, 0.02, 0.05))
        out.parent.mkdir(parents=True, exist_ok=True)
        making = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
        try:
            options = _Options(seed, replays, assurance, Tolerance(tolerance))
            result = _run(experiment, data, pool, making, report, options, made)
            check_unchanged(dataset.path, made)
            os.rename(making, out)
        finally:
            shutil.rmtree(making, ignore_errors=True)
    report(1.0, "done")
    return result


def _observed(
    experiment: Experiment, sensor: Sensor, pool: Workers, report: Report
) -> SplitObservations:
    """Observe the sequences by the clock of a sensor, and hand them to the workers."""
    data = observe_splits(experiment, sensor, pool.run, report)
    pool.hold([*data[0], *data[1]])
    return data


def _searched(
    experiment: Experiment, data: SplitObservations, pool: Workers, report: Report, seed: int
) -> tuple[SplitObservations, Evaluator, Findings]:
    """Search for causes; a second time, with frames grouped anew, where another clock was found.

    A group is replayed at one place of the tool. Measured: frames that a clock with an error of a
    quarter of a second puts together are up to 4 mm apart by the right clock; replayed so, a clock
    error of 238 ms was found as 229 ms.
    """
    evaluator = Evaluator(problem_of_dataset(experiment, *data), pool, report)
    findings, setup = search(evaluator, seed), experiment.stated
    late = (
        findings.best.model.setup.sensor.time_offset if findings.best else setup.sensor.time_offset
    )
    clock = replace(setup, sensor=replace(setup.sensor, time_offset=late))
    if late == setup.sensor.time_offset or all(item.grouping_holds(clock) for item in data[0]):
        return data, evaluator, findings
    del evaluator, findings
    data = _observed(experiment, clock.sensor, pool, silent)
    evaluator = Evaluator(problem_of_dataset(experiment, *data), pool, report)
    evaluator.report("searching again, with the frames grouped by the clock that was found")
    return data, evaluator, search(evaluator, seed)


@dataclass(frozen=True)
class _Options:
    """Options of a diagnosis; attributes as the arguments of `diagnose`."""

    seed: int
    replays: bool
    assurance: bool
    tolerance: Tolerance


def _run(
    experiment: Experiment,
    data: SplitObservations,
    pool: Workers,
    making: Path,
    report: Report,
    options: _Options,
    made: dict[str, Any],
) -> dict[str, Any]:
    """Search, validate and write the files of a run, whose report states `made_from`."""
    (fitted, held_out), evaluator, findings = _searched(
        experiment, data, pool, part(report, 0.05, 0.75), options.seed
    )
    findings.tolerance = options.tolerance
    problem, dataset, setup = evaluator.problem, experiment.dataset, experiment.stated
    gain, checks = _validated(evaluator, findings, held_out, report, options)
    model = findings.best.model if findings.best else findings.baseline
    found = tuned_setup(evaluator, model) if findings.best else setup
    (making / "replays").mkdir()
    (making / "pictures").mkdir()
    # The recordings begin before the supplements, which leave a process idle now and then.
    recordings = (
        _recordings(experiment, found, pool, making / "replays")
        if options.replays and problem.clouds
        else []
    )
    result = report_of(dataset, evaluator, findings, gain, "test", checks)
    if clues := error_clues(evaluator, fitted, findings, result["verdict"]):
        result["unexplained"]["clues"] = clues
    result["made_from"] = {**made, "seed": options.seed, "tolerance": options.tolerance.stated}
    if dataset.accepted is not None:
        result["registration"] = dataset.accepted.to_json()
    pictures = making / "pictures"
    result = _with_stiffness_map(result, evaluator, fitted, findings, pictures, options.seed)
    if options.assurance:
        result = with_supplements(result, evaluator, fitted, findings)
    result = with_places_in_file(_with_pictures(result, evaluator, fitted, findings, making))
    for number, task in enumerate(recordings):
        part(report, 0.8, 1.0)(number / len(recordings), "replaying every sequence for the page")
        task.result()
    (making / "model.json").write_text(
        json.dumps(_model(dataset, found, findings, list(problem.names)), indent=1)
    )
    (making / "report.json").write_text(json.dumps(result, indent=1))
    return result


def _validated(
    evaluator: Evaluator,
    findings: Findings,
    held_out: list[Observations],
    report: Report,
    options: _Options,
) -> tuple[SurfaceGain | ForceGain | None, AllClearChecks]:
    """Return the gain on test sequences and the checks of an all-clear; reject a wrong cause."""
    fine, pool, seed = evaluator.problem.fine_grid, evaluator.workers, options.seed
    report(0.75, "measuring the gain on test sequences")
    gain = (
        held_out_gain(evaluator, findings, held_out, pool, fine, seed, options.assurance)
        if held_out
        else None
    )
    if findings.best is not None and findings.faint and held_out:
        findings.test_gain = gain_on_held_out(
            evaluator, findings.baseline, findings.best.model, held_out
        )
    stated = as_stated(evaluator, findings.best.model) if findings.best else ()
    if why := rejection_reason(findings, gain, stated):
        findings.withdraw(why)
        gain = held_out_gain(evaluator, findings, held_out, pool, fine, seed) if held_out else None
    last = findings.best.model if findings.best else findings.baseline
    if why := force_contradiction(findings.baseline, last):
        findings.contradict(why)
        gain = held_out_gain(evaluator, findings, held_out, pool, fine, seed) if held_out else None
    if verdict_of(findings) != "none":
        return gain, AllClearChecks(tolerance=options.tolerance)
    report(0.77, "looking whether every sequence, also of the test, is as clear")
    stiffness_error = largest_stiffness_error(evaluator, findings.baseline)
    return gain, AllClearChecks(
        stiffness_error, check_held_out(evaluator, held_out, seed), options.tolerance
    )


def _with_stiffness_map(
    result: dict[str, Any],
    evaluator: Evaluator,
    fitted: Sequence[Observations],
    findings: Findings,
    pictures: Path,
    seed: int,
) -> dict[str, Any]:
    """Add the free map of the stiffness to a report that leaves something open, and draw it."""
    made = stiffness_map_of(evaluator, fitted, findings, result["verdict"], seed)
    if made is None:
        return result
    if made.structured:
        draw_map(pictures / "stiffness.png", evaluator.problem.setup.geometry, made)
    return {**result, "stiffness_map": map_to_json(made)}


def _with_pictures(
    result: dict[str, Any],
    evaluator: Evaluator,
    fitted: Sequence[Observations],
    findings: Findings,
    making: Path,
) -> dict[str, Any]:
    """Draw the pictures of a run; return the report, with the palpation where there is one."""
    problem = evaluator.problem
    if problem.clouds:
        model = findings.best.model if findings.best else findings.baseline
        patterns = error_patterns(evaluator, fitted, findings.baseline, model)
        patterns.save(making / "patterns.npz")
        draw_patterns(patterns, making / "pictures" / "patterns.png")
        return result
    result, pushes, shown = with_palpation(result, evaluator, fitted, findings)
    lump = next((cause for cause in result["causes"] if "cover" in cause), None)
    body = problem.setup.geometry
    draw_palpation(making / "pictures" / "palpation.png", body, pushes, shown, lump)
    return result


def _recordings(
    experiment: Experiment, found: Setup, pool: Workers, folder: Path
) -> list[Future[str]]:
    """Begin to record every sequence with clouds under the stated and the extended setup."""
    dataset, stated = experiment.dataset, experiment.stated
    page = experiment.mesh(Use.PAGE, experiment.sequences)
    return [
        pool.run(
            record,
            dataset.sequence(name),
            stated,
            found,
            experiment.cleaner,
            experiment.shaft,
            page,
            folder / f"{name}.npz",
        )
        for name in experiment.sequences
    ]


def _model(dataset: Dataset, setup: Setup, findings: Findings, fitted: list[str]) -> dict[str, Any]:
    """Return the extended model and its origin, as `model.json` has them."""
    effects = [effect.to_json() for effect in findings.best.model.effects] if findings.best else []
    registered = {"registration": dataset.accepted.to_json()} if dataset.accepted else {}
    return {
        "format": 1,
        "version": 1,
        "dataset": dataset.name,
        "parent": None,
        "fitted_on": fitted,
        "effects": effects,
        "setup": setup.as_dict(),
        "grid": _described(setup),
        "criteria": CRITERIA.to_json(),
        **registered,
    }


def _described(setup: Setup) -> dict[str, Any]:
    """Return the mesh of the model as plain values."""
    return asdict(default_spec(Use.REPLAY, setup.geometry, setup.tool.radius))
