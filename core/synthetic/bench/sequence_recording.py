"""Recording of one sequence on the virtual bench: solve its motion and write its files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.synthetic.bench.depth_camera import CameraScene, DepthCamera
from palpate.synthetic.bench.depth_image import nuisance_cloud, take_image
from palpate.synthetic.bench.force_sensor import ForceSensor
from palpate.synthetic.bench.formed_surface import FormedSurface
from palpate.synthetic.bench.motion_plan import MotionPlan
from palpate.synthetic.bench.solved_track import SolvedTrack
from palpate.synthetic.bench.true_body import true_offset, true_radius
from palpate.synthetic.bench.virtual_experiment import Mesher, neutral_displacement, solve_motion
from palpate.synthetic.bench.visibility import mean_square_change, visible_weights
from palpate.synthetic.dataset_writer import write_clouds, write_forces, write_kinematics, write_ply
from palpate.synthetic.laws.sensor_laws import camera_motion, clock_offset
from palpate.synthetic.nuisances.nuisance import DepthImage, StatedMotion
from palpate.synthetic.nuisances.nuisance_chain import robot_rate, stamped_frames, stated_centres
from palpate.synthetic.scenario.disturbance import drifted
from palpate.synthetic.scenario.scenario import Scenario

__all__ = ["SequenceJob", "SequenceRecord", "record_motion", "scene_at"]

KINEMATICS_NOISE = 0.05e-3
"""Standard deviation of a tool position [m]."""
MARGIN = 0.35
"""Time at both ends of a sequence without clouds [s]."""
_NOT_MECHANICAL = ("time_offset", "camera_registration", "depth_bias", "landmark_mismatch")
"""Effects that do not deform the block."""


@dataclass(frozen=True)
class SequenceJob:
    """One sequence to be recorded.

    Attributes:
        scenario: beliefs and hidden effects.
        motion: as planned.
        camera: as `rest.ply` was taken.
        robot_from_phantom: true pose.
        camera_shift: of the camera after `rest.ply`, phantom frame.
        seen: (2,) signs of the x and y sides that the camera sees.
        folder: of the sequence.
        seed: of everything random.
        begun: offset of the base from its place (x, y) [m] at the beginning.
        session: time from `rest.ply` to the beginning [s].
        body: meshes the body; a block without it. The changes by hidden effects are measured on
            blocks only.
    """

    scenario: Scenario
    motion: MotionPlan
    camera: DepthCamera
    robot_from_phantom: Transform
    camera_shift: Transform
    seen: FloatArray
    folder: Path
    seed: int
    begun: tuple[float, float] = (0.0, 0.0)
    session: float = 0.0
    body: Mesher | None = None


@dataclass(frozen=True)
class SequenceRecord:
    """Facts about one recorded sequence.

    Attributes:
        sequence: its name.
        squares: mean square changes of the visible surface by hidden effects [m^2].
        shortened: how much shallower than planned each push was [m].
        begun: offset of the base from its place (x, y) [m] at the beginning.
        slid: the same at the end.
    """

    sequence: str
    squares: list[float]
    shortened: list[float]
    begun: tuple[float, float]
    slid: tuple[float, float]


def record_motion(job: SequenceJob) -> SequenceRecord:
    """Solve one sequence and write its kinematics, forces and clouds."""
    planned = job.motion
    track = solve_motion(job.scenario, planned, body=job.body, begun=job.begun)
    job = replace(job, motion=track.motion)
    pressed = 1 if job.body is None else -1
    shortened = [
        float(before.corners[pressed] - after.corners[pressed])
        for before, after in zip(planned.pushes, track.motion.pushes, strict=True)
    ]
    rng = np.random.default_rng([job.seed, 2, *job.motion.name.encode()])
    (job.folder / "clouds").mkdir(parents=True)
    start = rng.uniform(5.0, 45.0)
    _write_kinematics(job, track, start, rng)
    _write_forces(job, track, start)
    hidden = job.scenario.hidden("time_offset")
    count = int((job.motion.duration - 2 * MARGIN) * job.scenario.rate)
    instants = MARGIN + np.arange(count) / job.scenario.rate + rng.uniform(-0.6e-3, 0.6e-3, count)
    instants = instants[rng.random(count) >= 0.02]
    disturbing = np.random.default_rng([job.seed, 6, *job.motion.name.encode()])
    index, stamped = stamped_frames(job.scenario.nuisances, instants, disturbing)
    files = [f"clouds/{number:06d}.ply" for number in range(len(index))]
    stamps = (
        start
        + stamped
        + clock_offset(hidden, stamped, job.motion.duration)
        + rng.uniform(-1e-3, 1e-3, len(index))
    )
    write_clouds(job.folder / "clouds.csv", stamps, files)
    taken = job.scenario.nuisances and _NuisanceCamera(job, track, disturbing)
    for file, instant in zip(files, instants[index].tolist(), strict=True):
        cloud = (
            taken.cloud(instant)
            if taken
            else _camera(job, instant).cloud(scene_at(job, track, instant), rng)
        )
        write_ply(job.folder / file, cloud)
    return SequenceRecord(planned.name, _visibility(job, track), shortened, job.begun, track.slid)


class _NuisanceCamera:
    """The camera in front of one motion, with the nuisances of the scenario."""

    def __init__(self, job: SequenceJob, track: SolvedTrack, rng: np.random.Generator) -> None:
        self.job, self.track, self.rng = job, track, rng
        self._forms: dict[int, FormedSurface] = {}
        self._last: tuple[float, FloatArray] | None = None

    def cloud(self, instant: float) -> FloatArray:
        """The cloud (k, 3) [m] of an instant [s]; a frame that is repeated is the same one."""
        if self._last is None or self._last[0] != instant:
            cloud = nuisance_cloud(
                self.job.scenario.nuisances,
                self.job.camera,
                self._image,
                instant + self.job.session,
                self.rng,
            )
            self._last = instant, cloud
        return self._last[1]

    def _image(self, time: float) -> DepthImage:
        instant = float(np.clip(time - self.job.session, 0.0, self.job.motion.duration))
        solved, scenario = self.track.at(instant), self.job.scenario
        if id(solved) not in self._forms:
            self._forms[id(solved)] = FormedSurface(
                solved.rest, solved.faces, scenario.true_size, scenario.nuisances
            )
        form = self._forms[id(solved)]
        scene = replace(
            scene_at(self.job, self.track, instant),
            block=(form.displaced(solved.displacement(instant)), form.faces),
            rest=form.rest,
            nuisances=scenario.nuisances,
        )
        return take_image(_camera(self.job, instant), scene)


def _camera(job: SequenceJob, instant: float) -> DepthCamera:
    """The camera with its pose at a time [s] of the sequence."""
    away = np.random.default_rng([job.seed, 3])  # in the same direction in all sequences
    drift = drifted(job.scenario.disturbances, instant / job.motion.duration, away)
    moved = job.scenario.hidden("camera_registration")
    shift = camera_motion(moved, job.camera_shift, job.session + instant)
    return replace(job.camera, phantom_from_camera=drift @ shift @ job.camera.phantom_from_camera)


def scene_at(job: SequenceJob, track: SolvedTrack, instant: float) -> CameraScene:
    """The scene in front of the camera at a time [s] of the sequence."""
    stated = job.motion.centre(np.array([instant]))[0]
    centre = stated + true_offset(job.scenario, stated) + track.at(instant).deflection(instant)
    return CameraScene(track.surface(instant), centre, job.motion.axis, true_radius(job.scenario))


def _write_kinematics(
    job: SequenceJob, track: SolvedTrack, start: float, rng: np.random.Generator
) -> None:
    """Write the stated poses at about the robot's rate with jitter; the tool's z axis points from
    shaft to tip.
    """
    rate = robot_rate(job.scenario.nuisances, job.scenario.robot_rate)
    count = int(job.motion.duration * rate)
    times = np.cumsum(np.clip(1 + 0.15 * rng.normal(size=count), 0.3, 1.7)) / rate
    times = np.unique(np.round(start + times[times < job.motion.duration], 5))
    centres = _stated_centres(job, track, times - start)
    centres = centres + rng.normal(size=(len(times), 3)) * KINEMATICS_NOISE
    turn = Rotation.align_vectors(job.motion.axis[None], [[0.0, 0.0, 1.0]])[
        0
    ] * Rotation.from_euler("z", rng.uniform(0, 2 * np.pi))
    quaternion = (Rotation.from_matrix(job.robot_from_phantom.rotation) * turn).as_quat()
    write_kinematics(
        job.folder / "kinematics.csv", times, job.robot_from_phantom.apply(centres), quaternion
    )


def _stated_centres(job: SequenceJob, track: SolvedTrack, times: FloatArray) -> FloatArray:
    """Tool centres (n, 3) [m] that the robot states at times (n,) [s], phantom frame."""
    centres, step = job.motion.centre(times), 1e-3
    if not job.scenario.nuisances:
        return centres
    velocities = (job.motion.centre(times + step) - job.motion.centre(times - step)) / (2 * step)
    motion = StatedMotion(times, centres, velocities, -track.tool_force(times))
    return stated_centres(job.scenario.nuisances, motion)


def _write_forces(job: SequenceJob, track: SolvedTrack, start: float) -> None:
    """Write the force readings on the robot's clock; they use random generators of their own."""
    if job.scenario.force_noise is None:
        return
    sensor = ForceSensor.draw(job.scenario.force_noise, np.random.default_rng([job.seed, 4]))
    rng = np.random.default_rng([job.seed, 5, *job.motion.name.encode()])
    times = sensor.instants(job.motion.duration, rng)
    on_tool = -track.tool_force(times) @ job.robot_from_phantom.rotation.T
    write_forces(job.folder / "forces.csv", start + times, sensor.read(times, on_tool, rng))


def _visibility(job: SequenceJob, track: SolvedTrack) -> list[float]:
    """Mean square changes of the visible surface in the hardest push [m^2].

    Errors of touches and depth are not included.
    """
    if not job.scenario.effects or job.body is not None:
        return []
    hidden = job.scenario.hidden("time_offset")
    late = hidden.value("offset") if hidden else 0.0
    mechanical = any(effect.effect not in _NOT_MECHANICAL for effect in job.scenario.effects)
    solved, begun = track.hardest, np.array([*job.begun, 0.0])
    weights = visible_weights(solved.rest, solved.faces, job.scenario.true_size, job.seen)
    squares = []
    for instant in solved.deepest[1:] if mechanical else solved.deepest:
        centre = job.motion.centre(np.array([instant + late]))[0] - begun
        moved = solved.displacement(instant) - begun
        believed = (
            neutral_displacement(job.scenario, solved, centre)
            if mechanical
            else solved.displacement(instant + late) - begun
        )
        squares.append(mean_square_change(solved.rest, moved, believed, job.camera_shift, weights))
    return squares
