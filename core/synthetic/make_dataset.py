"""A whole virtual dataset: the folder a bench would export, and the truth beside it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import as_completed
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.foundation.processes import ProcessPool
from palpate.foundation.progress import Report, silent
from palpate.synthetic.atomic_write import whole_or_nothing
from palpate.synthetic.bench.depth_camera import DepthCamera, Scene, place_camera
from palpate.synthetic.bench.force_sensor import ForceSensor
from palpate.synthetic.bench.motion_plan import Motion, draw_motion
from palpate.synthetic.bench.solved_track import Track
from palpate.synthetic.bench.true_body import true_offset, true_radius
from palpate.synthetic.bench.virtual_experiment import neutral_displacement, perform, rest_surface
from palpate.synthetic.bench.visibility import changed, visible_weights
from palpate.synthetic.dataset_writer import (
    write_clouds,
    write_config,
    write_forces,
    write_kinematics,
    write_ply,
    write_touches,
)
from palpate.synthetic.scenario.disturbance import drifted
from palpate.synthetic.scenario.scenario import STRAYED, Scenario
from palpate.synthetic.scenario.truth import Truth

__all__ = ["make_dataset", "motions"]

KINEMATICS_NOISE = 0.05e-3
TOUCH_NOISE = 0.15e-3
MARGIN = 0.35
_SEEN_OTHERWISE = ("time_offset", "camera_registration", "depth_bias", "landmark_mismatch")
"""Effects that leave the block as it is at any instant."""


@dataclass(frozen=True)
class _Job:
    scenario: Scenario
    motion: Motion
    camera: DepthCamera
    robot_from_phantom: Transform
    camera_shift: Transform
    seen: FloatArray
    folder: Path
    seed: int
    begun: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class _Record:
    """Of one sequence: mean squares of the change by what is hidden [m^2], how far each push
    stopped short [m], and how far the base lies from its place (x, y) [m] at the beginning and at
    the end.
    """

    sequence: str
    squares: list[float]
    shortened: list[float]
    begun: tuple[float, float]
    slid: tuple[float, float]


def make_dataset(
    folder: Path, scenario: Scenario, seed: int, workers: int = 1, report: Report = silent
) -> Truth:
    """Make the dataset `folder` and its truth `<folder>.truth.json`: both whole or neither.

    The same scenario and seed give the same files, whatever the number of workers. Raises RunError
    where `folder` exists.
    """
    truth = whole_or_nothing(folder, lambda aside: _fill(aside, scenario, seed, workers, report))
    report(1.0, f"made {folder.name}")
    return truth


def _fill(folder: Path, scenario: Scenario, seed: int, workers: int, report: Report) -> Truth:
    rng = np.random.default_rng([seed, 1])
    seen = _looking(scenario, rng.choice([-1.0, 1.0], size=2))
    robot_from_phantom = Transform(
        Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.25, 0.25, 3)
    )
    report(0.0, "letting the block settle")
    rest, settled, faces = rest_surface(scenario)
    camera = place_camera(
        rng,
        scenario.true_size,
        (rest + settled, faces),
        seen,
        scenario.density,
        scenario.noise * rng.uniform(0.9, 1.1),
    )
    offset, scale = _misread(scenario)
    camera = replace(camera, disturbances=scenario.disturbances, offset=offset, scale=scale)
    shift = _camera_shift(scenario, rng)
    write_ply(
        folder / "rest.ply",
        camera.cloud(Scene((rest + settled, faces), None, np.array([0.0, 0.0, -1.0]), 1.0), rng),
    )
    _write_touches(folder, scenario, robot_from_phantom, (rest, settled), rng)
    guess = (
        Transform.from_vector(rng.normal(size=3) * 2.5e-3, rng.normal(size=3) * 0.02)
        @ camera.phantom_from_camera
    )
    write_config(
        folder / "dataset.toml",
        f"block-{rng.integers(16**4):04x}",
        scenario,
        _landmarks(scenario.size),
        guess,
    )
    jobs = [
        _Job(
            scenario,
            motion,
            camera,
            robot_from_phantom,
            shift,
            seen,
            folder / "sequences" / motion.name,
            seed,
        )
        for motion in motions(scenario, seen, seed)
    ]
    squares: list[float] = []
    shortened: dict[str, list[float]] = {}
    begun: dict[str, tuple[float, float]] = {}
    for done, record in enumerate(_all(jobs, workers)):
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
    visibility = float(np.sqrt(np.mean(squares))) if squares else 0.0
    return Truth(
        scenario.effects,
        visibility,
        camera.phantom_from_camera,
        robot_from_phantom,
        shift,
        shortened,
        scenario.disturbances,
        begun,
    )


def _looking(scenario: Scenario, seen: FloatArray) -> FloatArray:
    """The signs (2,) of the sides that the camera sees: none that another body lies against."""
    body = scenario.disturbance("second_body")
    if body is None:
        return seen
    side = str(body.parameters["side"])
    return np.where([side[1] == axis for axis in "xy"], 1.0 if side[0] == "-" else -1.0, seen)


def _misread(scenario: Scenario) -> tuple[float, float]:
    """Offset [m] and scale [1] with which the camera misreads depth, from before it was
    registered."""
    hidden = scenario.hidden("depth_bias")
    return (hidden.value("offset"), hidden.value("scale")) if hidden else (0.0, 1.0)


def motions(scenario: Scenario, seen: FloatArray, seed: int) -> list[Motion]:
    """Planned by who sees the block as it is, whatever its stated size."""
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


def _one_after_another(jobs: list[_Job]) -> Iterator[_Record]:
    """Each from where the one before left the block."""
    begun = (0.0, 0.0)
    for job in jobs:
        record = _record(replace(job, begun=begun))
        begun = record.slid if math.hypot(*record.slid) < STRAYED else (0.0, 0.0)
        yield record


def _all(jobs: list[_Job], workers: int) -> Iterator[_Record]:
    if not jobs[0].scenario.put_back:
        yield from _one_after_another(jobs)
        return
    if workers <= 1:
        yield from (_record(job) for job in jobs)
        return
    with ProcessPool(min(workers, len(jobs)), start="forkserver") as pool:
        futures = [pool.submit(_record, job) for job in jobs]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def _camera_shift(scenario: Scenario, rng: np.random.Generator) -> Transform:
    """How the camera moved after `rest.ply`: the stated magnitudes along random directions."""
    step, turn = rng.normal(size=(2, 3))
    hidden = scenario.hidden("camera_registration")
    if hidden is None:
        return Transform()
    step *= hidden.value("translation") / np.linalg.norm(step)
    return Transform.from_vector(step, turn * hidden.value("rotation") / np.linalg.norm(turn))


def _landmarks(size: tuple[float, float, float]) -> dict[str, FloatArray]:
    """The top's corners (3,) [m] of a block."""
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
    """Touches of the corners where they really are, or where they were taken to be, with the error
    of a careful hand.
    """
    landmarks, (rest, settled) = _landmarks(scenario.true_size), surface
    places = _mistaken(scenario, np.array(list(landmarks.values())))
    corners = np.array(
        [place + settled[np.argmin(np.linalg.norm(rest - place, axis=1))] for place in places]
    )
    touched = corners + (0.0, 0.0, scenario.touch_offset) + rng.normal(size=(4, 3)) * TOUCH_NOISE
    write_touches(folder / "touches.csv", list(landmarks), robot_from_phantom.apply(touched))


def _mistaken(scenario: Scenario, corners: FloatArray) -> FloatArray:
    """The places (4, 3) [m] touched for these corners, in the order in which they are stated."""
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


def _record(job: _Job) -> _Record:
    """Solve one sequence and write its files."""
    planned = job.motion
    track = perform(job.scenario, planned, begun=job.begun)
    job = replace(job, motion=track.motion)
    shortened = [
        float(before.corners[1] - after.corners[1])
        for before, after in zip(planned.probes, track.motion.probes, strict=True)
    ]
    rng = np.random.default_rng([job.seed, 2, *job.motion.name.encode()])
    (job.folder / "clouds").mkdir(parents=True)
    start = rng.uniform(5.0, 45.0)
    _write_kinematics(job, start, rng)
    _write_forces(job, track, start)
    hidden = job.scenario.hidden("time_offset")
    count = int((job.motion.duration - 2 * MARGIN) * job.scenario.rate)
    instants = MARGIN + np.arange(count) / job.scenario.rate + rng.uniform(-0.6e-3, 0.6e-3, count)
    instants = instants[rng.random(count) >= 0.02]
    files = [f"clouds/{number:06d}.ply" for number in range(len(instants))]
    stamps = (
        start
        + instants
        + (hidden.value("offset") if hidden else 0.0)
        + rng.uniform(-1e-3, 1e-3, len(instants))
    )
    write_clouds(job.folder / "clouds.csv", stamps, files)
    for file, instant in zip(files, instants.tolist(), strict=True):
        write_ply(job.folder / file, _camera(job, instant).cloud(_scene(job, track, instant), rng))
    return _Record(planned.name, _visibility(job, track), shortened, job.begun, track.slid)


def _camera(job: _Job, instant: float) -> DepthCamera:
    """The camera where it stands at this time [s] of the sequence."""
    away = np.random.default_rng([job.seed, 3])  # in the same direction in all sequences
    drift = drifted(job.scenario.disturbances, instant / job.motion.duration, away)
    return replace(
        job.camera, phantom_from_camera=drift @ job.camera_shift @ job.camera.phantom_from_camera
    )


def _scene(job: _Job, track: Track, instant: float) -> Scene:
    centre = (
        job.motion.centre(np.array([instant]))[0]
        + true_offset(job.scenario)
        + track.at(instant).deflection(instant)
    )
    return Scene(track.surface(instant), centre, job.motion.axis, true_radius(job.scenario))


def _write_kinematics(job: _Job, start: float, rng: np.random.Generator) -> None:
    """The stated poses: about 1 kHz with jitter; the last axis of the orientation points from the
    shaft to the tip.
    """
    count = int(job.motion.duration * job.scenario.robot_rate)
    times = (
        np.cumsum(np.clip(1 + 0.15 * rng.normal(size=count), 0.3, 1.7)) / job.scenario.robot_rate
    )
    times = np.unique(np.round(start + times[times < job.motion.duration], 5))
    centres = job.motion.centre(times - start) + rng.normal(size=(len(times), 3)) * KINEMATICS_NOISE
    turn = Rotation.align_vectors(job.motion.axis[None], [[0.0, 0.0, 1.0]])[
        0
    ] * Rotation.from_euler("z", rng.uniform(0, 2 * np.pi))
    quaternion = (Rotation.from_matrix(job.robot_from_phantom.rotation) * turn).as_quat()
    write_kinematics(
        job.folder / "kinematics.csv", times, job.robot_from_phantom.apply(centres), quaternion
    )


def _write_forces(job: _Job, track: Track, start: float) -> None:
    """What the sensor in the tool says, on the robot's clock; its draws leave all others as they
    are without it.
    """
    if job.scenario.force_noise is None:
        return
    sensor = ForceSensor.draw(job.scenario.force_noise, np.random.default_rng([job.seed, 4]))
    rng = np.random.default_rng([job.seed, 5, *job.motion.name.encode()])
    times = sensor.instants(job.motion.duration, rng)
    on_tool = -track.push(times) @ job.robot_from_phantom.rotation.T
    write_forces(job.folder / "forces.csv", start + times, sensor.read(times, on_tool, rng))


def _visibility(job: _Job, track: Track) -> list[float]:
    """Mean squares over the visible surface, where it is pushed hardest [m^2]; what touches and
    depth are off by is not in it.
    """
    if not job.scenario.effects:
        return []
    hidden = job.scenario.hidden("time_offset")
    late = hidden.value("offset") if hidden else 0.0
    mechanical = any(effect.effect not in _SEEN_OTHERWISE for effect in job.scenario.effects)
    stretch, begun = track.hardest, np.array([*job.begun, 0.0])
    weights = visible_weights(stretch.rest, stretch.faces, job.scenario.true_size, job.seen)
    squares = []
    for instant in stretch.deepest[1:] if mechanical else stretch.deepest:
        centre = job.motion.centre(np.array([instant + late]))[0] - begun
        moved = stretch.displacement(instant) - begun
        believed = (
            neutral_displacement(job.scenario, stretch, centre)
            if mechanical
            else stretch.displacement(instant + late) - begun
        )
        squares.append(changed(stretch.rest, moved, believed, job.camera_shift, weights))
    return squares
