"""Diagnosis: what the simulation gets wrong, the cause by name, the extended model, and the gain on
data nothing was fitted on.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from concurrent.futures import Future
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from palpate.dataset import Dataset
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.gain.test_gain import held_out_gain, tuned_setup
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.inference.rest_cloud import StaticChannel
from palpate.diagnosis.inference.rest_evidence import RestEvidence
from palpate.diagnosis.observation.force_only import observe_each, pushed_places
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.report.error_patterns import draw_patterns, error_patterns
from palpate.diagnosis.report.force_report import with_palpation
from palpate.diagnosis.report.palpation_figure import draw_palpation
from palpate.diagnosis.report.report import report_of, verdict_of
from palpate.diagnosis.report.supplements import with_supplements
from palpate.diagnosis.search.findings import Findings
from palpate.diagnosis.search.forward_selection import search
from palpate.diagnosis.validation.held_out_test import check_held_out
from palpate.diagnosis.validation.rejection import rejection_reason
from palpate.diagnosis.validation.stiffness_error_test import largest_stiffness_error
from palpate.foundation.errors import DiagnosisError, RunError
from palpate.foundation.progress import Report, part, rising, silent
from palpate.measurement.phantom_drift import align_sequences
from palpate.measurement.segmentation import cleaner_for
from palpate.measurement.tool_pose import find_shaft_axis
from palpate.mesh.graded_mesh import FINE_GRID, PAGE_GRID, REPLAY_GRID, SCREEN_GRID
from palpate.mesh.protocol import Meshing
from palpate.mesh.push_meshes import FINE_PUSHES, REPLAY_PUSHES, SCREEN_PUSHES
from palpate.recording.record_sequence import record
from palpate.registration.registration import Registration, register, setup_from
from palpate.setup.setup import Sensor, Setup, Shape

__all__ = ["diagnose"]

Data = tuple[list[Observations], list[Observations]]
"""Of the sequences that are fitted and of those of the test."""


def diagnose(
    dataset: Dataset,
    out: Path,
    *,
    workers: int = 2,
    report: Report = silent,
    seed: int = 0,
    replays: bool = True,
    assurance: bool = True,
) -> dict[str, Any]:
    """Find what the stated simulation of a dataset gets wrong; write the run folder `out` and
    return the report.

    Args:
        dataset: as opened.
        out: folder to make; written aside and renamed, so it is whole or not there.
        workers: number of processes.
        report: progress; may raise Cancelled.
        seed: of the null draws and the bootstrap.
        replays: whether to record every sequence for the page, too.
        assurance: whether to work out what changes no verdict: controls, profiles, and the next
            probe.

    Fits and choices use the train and validation sequences, the gain the test sequences. Raises
    DiagnosisError where the data cannot carry a diagnosis, DatasetError and RegistrationError where
    they are off.
    """
    out = Path(out)
    if out.exists():
        raise RunError(f"{out} exists already; name another folder or move it away", file=str(out))
    report = rising(report)
    _check_splits(dataset)
    report(0.0, "reading every cloud")
    with Workers([], workers) as pool:
        pool.start()
        dataset.validate(part(report, 0.0, 0.02))
        dataset, registration = align_sequences(dataset, register(dataset))
        setup = setup_from(dataset, registration)
        data = _observed(dataset, registration.repaired, setup.sensor, pool, part(report, 0.02, 0.05))
        out.parent.mkdir(parents=True, exist_ok=True)
        making = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
        try:
            result = _run(
                dataset, registration, setup, data, pool, making, report, seed, (replays, assurance)
            )
            os.rename(making, out)
        finally:
            shutil.rmtree(making, ignore_errors=True)
    report(1.0, "done")
    return result


def _check_splits(dataset: Dataset) -> None:
    config = dataset.config
    fitted = (*config.train, *config.validation)
    if len(fitted) < 2:
        raise DiagnosisError(
            f"[splits] train and validation name {len(fitted)} sequences, at least 2 are needed: causes are fitted on some "
            "and judged on others",
            key="splits",
        )
    seen = any(len(dataset.sequence(name)) for name in (*fitted, *config.test))
    if seen and not any(len(dataset.sequence(name)) for name in fitted):
        raise DiagnosisError(
            "[splits] only the test sequences have clouds; fit on some that have, or leave them out",
            key="splits",
        )
    if seen and config.test and not any(len(dataset.sequence(name)) for name in config.test):
        raise DiagnosisError(
            "[splits] no test sequence has clouds, though some that are fitted have; name one in test",
            key="splits",
        )


def _observed(
    dataset: Dataset, registration: Registration, sensor: Sensor, pool: Workers, report: Report
) -> Data:
    """What the fitted and the test sequences say, their frames by the clock of this sensor; the
    pool holds it from now on.
    """
    config, setup = dataset.config, replace(setup_from(dataset, registration), sensor=sensor)
    fitted, tested = (*config.train, *config.validation), tuple(config.test)
    data = (
        observe_each(
            dataset,
            fitted,
            setup,
            registration,
            (CRITERIA.grouping.fitted_groups, CRITERIA.grouping.fitted_force_groups),
            part(report, 0.0, 0.7),
            pool.run,
        ),
        observe_each(
            dataset,
            tested,
            setup,
            registration,
            (CRITERIA.grouping.test_groups, CRITERIA.grouping.test_force_groups),
            part(report, 0.7, 1.0),
            pool.run,
        ),
    )
    pool.hold([*data[0], *data[1]])
    return data


def _bench(
    dataset: Dataset,
    registration: Registration,
    setup: Setup,
    data: Data,
    pool: Workers,
    report: Report,
) -> Bench:
    """All that a search needs."""
    fitted, held_out = data
    grid, fine, rough = _meshings(setup, [*fitted, *held_out])
    seen = any(not item.force_only for item in fitted)
    static = (
        RestEvidence(
            StaticChannel.of(dataset.rest_cloud(), cleaner_for(dataset, registration), setup, grid)
        )
        if seen
        else None
    )
    names, forces = [item.name for item in fitted], any(item.forces for item in fitted)
    bench = Bench(setup, registration, pool, names, static, grid, fine, report, forces, seen)
    bench.rough, bench.pushed = rough, pushed_places(fitted, setup)
    return bench


def _searched(
    dataset: Dataset,
    registration: Registration,
    setup: Setup,
    data: Data,
    pool: Workers,
    report: Report,
    seed: int,
) -> tuple[Data, Bench, Findings]:
    """What was found, the bench it was found on, and the data: grouped anew where another clock
    than the stated one was found.

    A group is replayed at one place of the tool. Frames that were near one another by a clock that
    is a quarter of a second off were taken up to 4 mm apart by the right one: replayed so, a clock
    of 238 ms was found as 229 ms.
    """
    bench = _bench(dataset, registration, setup, data, pool, report)
    findings = search(bench, seed)
    late = (
        findings.best.model.setup.sensor.time_offset if findings.best else setup.sensor.time_offset
    )
    clock = replace(setup, sensor=replace(setup.sensor, time_offset=late))
    if late == setup.sensor.time_offset or all(item.grouping_holds(clock) for item in data[0]):
        return data, bench, findings
    del bench, findings
    data = _observed(dataset, registration.repaired, clock.sensor, pool, silent)
    bench = _bench(dataset, registration, setup, data, pool, report)
    bench.tell("searching again, with the frames grouped by the clock that was found")
    return data, bench, search(bench, seed)


def _meshings(setup: Setup, data: list[Observations]) -> tuple[Meshing, Meshing, Meshing]:
    """Of a diagnosis, the fine one and the rough one."""
    radius = setup.tool.radius
    if not isinstance(setup.geometry, Shape):
        return (
            REPLAY_GRID.for_tool(radius),
            FINE_GRID.for_tool(radius),
            SCREEN_GRID.for_tool(radius),
        )
    places = pushed_places(data, setup)[0]
    found = [
        spec.for_tool(radius).at(places) for spec in (REPLAY_PUSHES, FINE_PUSHES, SCREEN_PUSHES)
    ]
    return found[0], found[1], found[2]


def _run(
    dataset: Dataset,
    registration: Registration,
    setup: Setup,
    data: Data,
    pool: Workers,
    making: Path,
    report: Report,
    seed: int,
    wanted: tuple[bool, bool],
) -> dict[str, Any]:
    replays, assurance = wanted
    (fitted, held_out), bench, findings = _searched(
        dataset, registration, setup, data, pool, part(report, 0.05, 0.75), seed
    )
    fine, seen, names = bench.fine, bench.seen, list(bench.names)
    model = findings.best.model if findings.best else findings.baseline
    report(0.75, "measuring the gain on test sequences")
    gain = (
        held_out_gain(bench, findings, held_out, pool, fine, seed, assurance) if held_out else None
    )
    if why := rejection_reason(findings, gain):
        findings.withdraw(why)
        model, gain = (
            findings.baseline,
            held_out_gain(bench, findings, held_out, pool, fine, seed) if held_out else None,
        )
    if verdict_of(findings) == "none":
        report(0.77, "looking whether every sequence, also of the test, is as clear")
        findings.asked = largest_stiffness_error(bench, findings.baseline)
        findings.beyond = check_held_out(bench, held_out, seed)
    found = tuned_setup(bench, model) if findings.best else setup
    (making / "replays").mkdir()
    (making / "pictures").mkdir()
    # Begun before what is worked out meanwhile: that leaves a process idle now and then.
    recordings = (
        _recordings(dataset, registration, (setup, found), pool, making / "replays")
        if replays and seen
        else []
    )
    result = report_of(dataset, bench, findings, gain, "test")
    if dataset.accepted is not None:
        result["registration"] = dataset.accepted.to_json()
    if assurance:
        result = with_supplements(result, bench, fitted, findings)
    if seen:
        pictured = error_patterns(bench, fitted, findings.baseline, model)
        pictured.save(making / "patterns.npz")
        draw_patterns(pictured, bench.surface, making / "pictures" / "patterns.png")
    else:
        result, pushes, shown = with_palpation(result, bench, fitted, findings)
        lump = next((cause for cause in result["causes"] if "cover" in cause), None)
        draw_palpation(making / "pictures" / "palpation.png", setup.geometry, pushes, shown, lump)
    for number, task in enumerate(recordings):
        part(report, 0.8, 1.0)(number / len(recordings), "replaying every sequence for the page")
        task.result()
    (making / "model.json").write_text(
        json.dumps(_model(dataset, found, findings, names), indent=1)
    )
    (making / "report.json").write_text(json.dumps(result, indent=1))
    return result


def _recordings(
    dataset: Dataset,
    registration: Registration,
    setups: tuple[Setup, Setup],
    pool: Workers,
    folder: Path,
) -> list[Future[str]]:
    """Begin to record every sequence under the stated and the extended setup, for the page."""
    stated, found = setups
    cleaner, shaft = (
        cleaner_for(dataset, registration),
        find_shaft_axis(dataset, registration.repaired),
    )
    page = PAGE_GRID.for_tool(stated.tool.radius)
    return [
        pool.run(
            record,
            dataset.sequence(name),
            stated,
            found,
            cleaner,
            shaft,
            page,
            folder / f"{name}.npz",
        )
        for name in dataset.sequences
        if len(dataset.sequence(name))
    ]


def _model(dataset: Dataset, setup: Setup, findings: Findings, fitted: list[str]) -> dict[str, Any]:
    """The extended model and where it comes from."""
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
    """How the model is meshed, plain values."""
    spec = REPLAY_PUSHES if isinstance(setup.geometry, Shape) else REPLAY_GRID
    return asdict(spec.for_tool(setup.tool.radius))
