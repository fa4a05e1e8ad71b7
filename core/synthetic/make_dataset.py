"""Whole virtual datasets: a folder as a bench would export it, and the truth beside it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import as_completed
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import EffectError
from palpate.foundation.frames import Transform
from palpate.foundation.processes import ProcessPool
from palpate.foundation.progress import Report, silent
from palpate.synthetic.atomic_write import write_atomically
from palpate.synthetic.bench.depth_camera import CameraScene, DepthCamera, place_camera
from palpate.synthetic.bench.depth_image import nuisance_cloud, shown
from palpate.synthetic.bench.formed_surface import FormedSurface
from palpate.synthetic.bench.motion_plan import MotionPlan, draw_motion
from palpate.synthetic.bench.sequence_recording import SequenceJob, SequenceRecord, record_motion
from palpate.synthetic.bench.virtual_experiment import rest_surface
from palpate.synthetic.dataset_writer import write_config, write_ply, write_touches
from palpate.synthetic.laws.sensor_laws import depth_curvature
from palpate.synthetic.nuisances.nuisance import StatedMotion
from palpate.synthetic.nuisances.nuisance_chain import stated_centres
from palpate.synthetic.scenario.scenario import STRAYED, Scenario
from palpate.synthetic.scenario.truth_file import Truth

__all__ = [
    "TOUCH_NOISE",
    "draw_camera",
    "draw_camera_shift",
    "make_dataset",
    "motions",
    "record_all",
]

TOUCH_NOISE = 0.15e-3
"""Standard deviation of a touch [m]."""
_BETWEEN = 60.0
"""Time from `rest.ply` to the first sequence, and between the beginnings of sequences [s]."""


def make_dataset(
    folder: Path, scenario: Scenario, seed: int, workers: int = 1, report: Report = silent
) -> Truth:
    """Make the dataset `folder` and its truth `<folder>.truth.json`, both whole or neither.

    The same scenario and seed give the same files, whatever the number of workers. Raises RunError
    where `folder` exists, and EffectError for an effect that only free forms can have.
    """
    if scenario.hidden("geometry_local"):
        raise EffectError(
            "the virtual bench casts no block that differs from its drawing; hide geometry_local "
            "in a shape (`draw_shape_scenario`)",
            effect="geometry_local",
        )
    truth = write_atomically(folder, lambda aside: _fill(aside, scenario, seed, workers, report))
    report(1.0, f"made {folder.name}")
    return truth


def _fill(folder: Path, scenario: Scenario, seed: int, workers: int, report: Report) -> Truth:
    rng = np.random.default_rng([seed, 1])
    seen = _visible_sides(scenario, rng.choice([-1.0, 1.0], size=2))
    robot_from_phantom = Transform(
        Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.25, 0.25, 3)
    )
    report(0.0, "letting the block settle")
    rest, settled, faces = rest_surface(scenario)
    block = (rest + settled, faces)
    camera = draw_camera(scenario, block, seen, rng)
    shift = draw_camera_shift(scenario, rng)
    scene = CameraScene(block, None, np.array([0.0, 0.0, -1.0]), 1.0)
    write_ply(folder / "rest.ply", _rest_cloud(scenario, camera, scene, rest, seed, rng))
    _write_touches(folder, scenario, robot_from_phantom, (rest, settled), rng)
    guess = (
        Transform.from_vector(rng.normal(size=3) * 2.5e-3, rng.normal(size=3) * 0.02)
        @ camera.phantom_from_camera
    )
    name = f"block-{rng.integers(16**4):04x}"
    write_config(folder / "dataset.toml", name, scenario, _landmarks(scenario.size), guess)
    jobs = [
        SequenceJob(
            scenario,
            motion,
            camera,
            robot_from_phantom,
            shift,
            seen,
            folder / "sequences" / motion.name,
            seed,
            session=_BETWEEN * (place + 1),
        )
        for place, motion in enumerate(motions(scenario, seen, seed))
    ]
    return record_all(jobs, workers, report)


def _rest_cloud(
    scenario: Scenario,
    camera: DepthCamera,
    scene: CameraScene,
    rest: FloatArray,
    seed: int,
    rng: np.random.Generator,
) -> FloatArray:
    """The cloud (k, 3) [m], camera frame, of a `scene` with the block in its place `rest`."""
    if not scenario.nuisances:
        return camera.cloud(scene, rng)
    vertices, faces = scene.block
    form = FormedSurface(rest, faces, scenario.true_size, scenario.nuisances)
    scene = replace(scene, block=(form.displaced(vertices - rest), form.faces), rest=form.rest)
    drawn = np.random.default_rng([seed, 6])
    return nuisance_cloud(scenario.nuisances, camera, shown(camera, scene), 0.0, drawn)


def draw_camera(
    scenario: Scenario, block: tuple[FloatArray, Any], seen: FloatArray, rng: np.random.Generator
) -> DepthCamera:
    noise = scenario.noise * rng.uniform(0.9, 1.1)
    camera = place_camera(rng, scenario.true_size, block, seen, scenario.density, noise)
    offset, scale = _depth_error(scenario)
    return replace(
        camera,
        disturbances=scenario.disturbances,
        offset=offset,
        scale=scale,
        curvature=depth_curvature(scenario.hidden("depth_bias")),
    )


def record_all(jobs: list[SequenceJob], workers: int, report: Report) -> Truth:
    """Record all sequences and sum up the truth."""
    squares: list[float] = []
    shortened: dict[str, list[float]] = {}
    begun: dict[str, tuple[float, float]] = {}
    for done, record in enumerate(_records(jobs, workers)):
        squares += record.squares
        begun |= {record.sequence: record.begun} if any(record.begun) else {}
        shortened |= {record.sequence: record.shortened} if any(record.shortened) else {}
        stopped = (
            "; a push there stopped short where the block gives way"
            if any(record.shortened)
            else ""
        )
        report(
            0.05 + 0.95 * (done + 1) / len(jobs),
            f"recorded {done + 1} of {len(jobs)} sequences{stopped}",
        )
    job = jobs[0]
    return Truth(
        job.scenario.effects,
        float(np.sqrt(np.mean(squares))) if squares else 0.0,
        job.camera.phantom_from_camera,
        job.robot_from_phantom,
        job.camera_shift,
        shortened,
        job.scenario.disturbances,
        begun,
        job.scenario.nuisances,
    )


def _visible_sides(scenario: Scenario, seen: FloatArray) -> FloatArray:
    """Signs (2,) of the x and y sides that the camera sees, never one with a body against it."""
    body = scenario.disturbance("second_body")
    if body is None:
        return seen
    side = str(body.parameters["side"])
    return np.where([side[1] == axis for axis in "xy"], 1.0 if side[0] == "-" else -1.0, seen)


def _depth_error(scenario: Scenario) -> tuple[float, float]:
    """Offset [m] and scale [1] of the depth readings, of the rest cloud too."""
    hidden = scenario.hidden("depth_bias")
    return (hidden.value("offset"), hidden.value("scale")) if hidden else (0.0, 1.0)


def motions(scenario: Scenario, seen: FloatArray, seed: int) -> list[MotionPlan]:
    """Plan the motions of all sequences, for the true size of the block."""
    kinds, size, radius = (
        [name.rpartition("-")[0] for name in scenario.sequences],
        scenario.true_size,
        scenario.tool_radius,
    )
    upright = scenario.disturbance("shaft_contact")
    return [
        draw_motion(
            name,
            kinds[:place].count(kinds[place]),
            size,
            radius,
            seen,
            seed,
            scenario.rounds.get(name, 1),
            None if upright is None else upright.value("lean"),
        )
        for place, name in enumerate(scenario.sequences)
    ]


def _records_in_turn(jobs: list[SequenceJob]) -> Iterator[SequenceRecord]:
    """Record sequences in turn, each from where the one before left the block."""
    begun = (0.0, 0.0)
    for job in jobs:
        record = record_motion(replace(job, begun=begun))
        begun = record.slid if math.hypot(*record.slid) < STRAYED else (0.0, 0.0)
        yield record


def _records(jobs: list[SequenceJob], workers: int) -> Iterator[SequenceRecord]:
    if not jobs[0].scenario.put_back:
        yield from _records_in_turn(jobs)
        return
    if workers <= 1:
        yield from (record_motion(job) for job in jobs)
        return
    with ProcessPool(min(workers, len(jobs)), start="forkserver") as pool:
        futures = [pool.submit(record_motion, job) for job in jobs]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def draw_camera_shift(scenario: Scenario, rng: np.random.Generator) -> Transform:
    """Motion of the camera after `rest.ply`: hidden magnitudes along random directions."""
    step, turn = rng.normal(size=(2, 3))
    hidden = scenario.hidden("camera_registration")
    if hidden is None:
        return Transform()
    step *= hidden.value("translation") / np.linalg.norm(step)
    return Transform.from_vector(step, turn * hidden.value("rotation") / np.linalg.norm(turn))


def _landmarks(size: tuple[float, float, float]) -> dict[str, FloatArray]:
    """Corners (3,) [m] of a block's top by name."""
    signs = ((1, 1), (1, -1), (-1, -1), (-1, 1))
    x, y, z = size
    return {
        f"corner_{number}": np.array([a * x / 2, b * y / 2, z])
        for number, (a, b) in enumerate(signs)
    }


def _write_touches(
    folder: Path,
    scenario: Scenario,
    robot_from_phantom: Transform,
    surface: tuple[FloatArray, FloatArray],
    rng: np.random.Generator,
) -> None:
    """Write touches of the true corners, or of mistaken ones, with the error of a careful hand."""
    landmarks, (rest, settled) = _landmarks(scenario.true_size), surface
    places = _touched_corners(scenario, np.array(list(landmarks.values())))
    corners = np.array(
        [place + settled[np.argmin(np.linalg.norm(rest - place, axis=1))] for place in places]
    )
    touched = corners + (0.0, 0.0, scenario.touch_offset) + rng.normal(size=(4, 3)) * TOUCH_NOISE
    still = np.zeros_like(touched)
    motion = StatedMotion(np.arange(4.0), touched, still, still)
    touched = stated_centres(scenario.nuisances, motion)
    write_touches(folder / "touches.csv", list(landmarks), robot_from_phantom.apply(touched))


def _touched_corners(scenario: Scenario, corners: FloatArray) -> FloatArray:
    """Places (4, 3) [m] that are touched for these corners, in the stated order."""
    hidden = scenario.hidden("landmark_mismatch")
    if hidden is None:
        return corners
    kind, *rows = str(hidden.parameters["pairing"]).split("-")
    touched = np.roll(corners, -int(rows[0]), axis=0) if kind == "turn" else corners.copy()
    if kind == "swap":
        one, other = (int(row) - 1 for row in rows)
        touched[[one, other]] = corners[[other, one]]
    flat = touched[:, :2] * hidden.value("scale")
    return np.column_stack([flat - hidden.value("inset") * np.sign(flat), touched[:, 2]])
