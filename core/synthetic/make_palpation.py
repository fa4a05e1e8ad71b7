"""Palpation by force alone: many short pushes over a block's top or an organ, without a camera.

Each push follows the surface's normal, presses to a depth, holds and retracts. Kinematics and
forces are written with the errors of real sensors (`palpate.synthetic.bench.force_sensor`). The
operator finds the surface by feel, so each depth has an error; the kinematics show the true motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.foundation.processes import ProcessPool
from palpate.foundation.progress import Report, silent
from palpate.synthetic.atomic_write import write_atomically
from palpate.synthetic.bench.force_sensor import FORCE_NOISE, ForceSensor
from palpate.synthetic.bench.motion_plan import MotionPlan, PlannedPush
from palpate.synthetic.bench.virtual_experiment import solve_motion
from palpate.synthetic.bodies.organ_shape import (
    AXES,
    organ_block,
    organ_normals,
    organ_places,
    organ_surface,
    write_surface,
)
from palpate.synthetic.bodies.shape_mesher import lump_grading
from palpate.synthetic.bodies.shape_pushes import spread_places, timed_push
from palpate.synthetic.dataset_writer import (
    write_felt_config,
    write_forces,
    write_kinematics,
    write_touches,
)
from palpate.synthetic.scenario.hidden_effects import HiddenEffect
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.scenario.truth_file import Truth
from palpate.synthetic.solver.tet_block import TetBlock

__all__ = ["Body", "Palpation", "draw_palpation", "make_palpation"]

Body = Literal["box", "organ"]
HOVER, ABOVE = 5e-3, 12e-3
"""Distance from the surface before a push, and height of the travel above everything [m]."""
KINEMATICS_NOISE, TOUCH_NOISE, DEPTH_MISS = 0.05e-3, 0.15e-3, 0.3e-3
SPLITS = ("train", "validation", "test")


@dataclass(frozen=True, kw_only=True)
class Palpation:
    """One palpation.

    Attributes:
        body: box or organ.
        scenario: beliefs and hidden effects.
        pushes: number in each sequence.
        depth: smallest and largest depth of a push [m].
        splits: number of sequences for train, validation and test.
    """

    body: Body
    scenario: Scenario
    pushes: int = 6
    depth: tuple[float, float] = (3.2e-3, 4.8e-3)
    splits: tuple[int, int, int] = (2, 1, 2)

    @property
    def sequences(self) -> dict[str, list[str]]:
        """Names of the sequences of each split."""
        ends = np.cumsum([0, *self.splits])
        names = [f"palpation-{number:02d}" for number in range(1, ends[-1] + 1)]
        return {split: names[a:b] for split, a, b in zip(SPLITS, ends[:-1], ends[1:], strict=True)}


def draw_palpation(body: Body, effects: int, seed: int) -> Palpation:
    """Draw a palpation with one stiff lump, or none where `effects` is 0."""
    rng = np.random.default_rng([seed, 31])
    # A force sensor that is decoupled from the vibration of a driven arm has less noise.
    scenario = Scenario(force_noise=FORCE_NOISE / 2, robot_rate=250.0, young_modulus=5e3)
    if not effects:
        return Palpation(body=body, scenario=scenario)
    radius, ratio = float(rng.uniform(6.5e-3, 8.5e-3)), float(rng.uniform(4.0, 8.0))
    if body == "box":
        x, y = rng.uniform(-1, 1, 2) * (0.02, 0.008)
        place = np.array([x, y, scenario.size[2] - radius - rng.uniform(2e-3, 4e-3)])
    else:
        way = np.append(rng.uniform(-0.5, 0.5, 2), 1.0)
        top = organ_places(way[None])[0]
        place = top - organ_normals(top[None])[0] * (radius + rng.uniform(2e-3, 3.5e-3))
    values = {name: round(float(value), 5) for name, value in zip("xyz", place, strict=True)}
    lump = HiddenEffect(
        "stiff_inclusion",
        {**values, "radius": round(radius, 5), "stiffness_ratio": round(ratio, 2)},
    )
    return Palpation(body=body, scenario=replace(scenario, effects=(lump,)))


def make_palpation(
    folder: Path, palpation: Palpation, seed: int, workers: int = 1, report: Report = silent
) -> Truth:
    """Make the dataset `folder` and its truth beside it, both whole or neither.

    Raises RunError where `folder` exists.
    """
    truth = write_atomically(
        folder, lambda aside: _fill(aside, folder.name, palpation, seed, workers, report)
    )
    report(1.0, f"made {folder.name}")
    return truth


def _fill(
    folder: Path, name: str, palpation: Palpation, seed: int, workers: int, report: Report
) -> Truth:
    rng, scenario = np.random.default_rng([seed, 32]), palpation.scenario
    robot_from_phantom = Transform(
        Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.25, 0.25, 3)
    )
    landmarks = _landmarks(palpation)
    touched = (
        np.array(list(landmarks.values()))
        + (0.0, 0.0, scenario.touch_offset)
        + rng.normal(size=(len(landmarks), 3)) * TOUCH_NOISE
    )
    write_touches(folder / "touches.csv", list(landmarks), robot_from_phantom.apply(touched))
    surface = "" if palpation.body == "box" else "phantom.stl"
    if surface:
        write_surface(folder / surface, *organ_surface())
    write_felt_config(
        folder / "dataset.toml", name, scenario, surface, landmarks, palpation.sequences
    )
    motions = _motions(palpation, seed)
    jobs = [
        (palpation, motion, robot_from_phantom, folder / "sequences" / motion.name, seed)
        for motion in motions
    ]
    shortened: dict[str, list[float]] = {}
    with ProcessPool(workers, start="forkserver") as pool:
        for done, record in enumerate(pool.map(_record, *zip(*jobs, strict=True))):
            shortened |= record
            report((done + 1) / len(jobs), f"recorded {done + 1} of {len(jobs)} sequences")
    return Truth(scenario.effects, 0.0, Transform(), robot_from_phantom, shortened=shortened)


def _landmarks(palpation: Palpation) -> dict[str, FloatArray]:
    """Landmarks (3,) [m] by name: corners of a block's top, or marks on an organ."""
    if palpation.body == "organ":
        ways = [
            (0.0, 0.0, 1.0),
            (1.0, 0.1, 0.4),
            (-1.0, 0.2, 0.5),
            (0.1, 1.0, 0.5),
            (-0.1, -1.0, 0.4),
        ]
        return {
            f"mark_{number}": place for number, place in enumerate(organ_places(np.array(ways)))
        }
    x, y, z = palpation.scenario.size
    signs = ((1, 1), (1, -1), (-1, -1), (-1, 1))
    return {
        f"corner_{number}": np.array([a * x / 2, b * y / 2, z])
        for number, (a, b) in enumerate(signs)
    }


def _motions(palpation: Palpation, seed: int) -> list[MotionPlan]:
    """Plan the sequences, each with its own places, spread over all that can be reached."""
    names = [name for names in palpation.sequences.values() for name in names]
    found = []
    for name in names:
        rng = np.random.default_rng([seed, 33, *name.encode()])
        reachable = _reachable(palpation, rng)
        places = reachable[spread_places(reachable, palpation.pushes)]
        found.append(_motion(palpation, name, places[rng.permutation(len(places))], rng))
    return found


def _reachable(palpation: Palpation, rng: np.random.Generator) -> FloatArray:
    """Draw many places (n, 3) [m] where a push is possible."""
    drawn = rng.uniform(-1, 1, size=(400, 2))
    if palpation.body == "box":
        x, y, z = palpation.scenario.size
        margin = 1.6 * palpation.scenario.tool_radius
        return np.column_stack([drawn * (x / 2 - margin, y / 2 - margin), np.full(400, z)])
    places = organ_places(
        np.column_stack([drawn * 1.3, np.full(400, 0.9)]) * (AXES[0], AXES[1], AXES[2])
    )
    return places[places[:, 2] > 0.4 * AXES[2]]


def _motion(
    palpation: Palpation, name: str, places: FloatArray, rng: np.random.Generator
) -> MotionPlan:
    radius, normals = palpation.scenario.tool_radius, _normals(palpation, places)
    top = (
        max(
            palpation.scenario.size[2] if palpation.body == "box" else AXES[2],
            float(places[:, 2].max()),
        )
        + radius
        + ABOVE
    )
    time, pushes = 2.0, []
    for place, normal in zip(places, normals, strict=True):
        depth = rng.uniform(*palpation.depth) + DEPTH_MISS * rng.normal()
        hover, deep = place + (radius + HOVER) * normal, place + (radius - depth) * normal
        way = np.array(
            [hover, deep] if palpation.body == "box" else [[hover[0], hover[1], top], hover, deep]
        )
        pushes.append(timed_push(way, time, rng))
        time = float(pushes[-1].times[-1]) + rng.uniform(0.5, 0.8)
    return MotionPlan(name, np.array([0.0, 0.0, -1.0]), tuple(pushes), time + 1.5)


def _normals(palpation: Palpation, places: FloatArray) -> FloatArray:
    return (
        organ_normals(places)
        if palpation.body == "organ"
        else np.tile([0.0, 0.0, 1.0], (len(places), 1))
    )


def _organ(scenario: Scenario, pushes: Sequence[PlannedPush], fine: float) -> TetBlock:
    """Mesh the organ for its pushes, with small elements also in a lump."""
    places = np.array([push.waypoints[-1] for push in pushes])
    vertices = organ_surface()[0]
    within = lump_grading(scenario, vertices.min(axis=0), vertices.max(axis=0))
    return organ_block(places, 0.8 * scenario.tool_radius, fine, within)


def _record(
    palpation: Palpation, motion: MotionPlan, robot_from_phantom: Transform, folder: Path, seed: int
) -> dict[str, list[float]]:
    """Solve one sequence and write its files.

    Returns:
        by sequence, how much shallower than planned each push was [m]; empty if none was.
    """
    scenario = palpation.scenario
    track = solve_motion(scenario, motion, body=_organ if palpation.body == "organ" else None)
    rng = np.random.default_rng([seed, 34, *motion.name.encode()])
    folder.mkdir(parents=True)
    start = rng.uniform(5.0, 45.0)
    count = int(motion.duration * scenario.robot_rate)
    times = np.cumsum(np.clip(1 + 0.15 * rng.normal(size=count), 0.3, 1.7)) / scenario.robot_rate
    times = np.unique(np.round(start + times[times < motion.duration], 5))
    centres = (
        track.motion.centre(times - start) + rng.normal(size=(len(times), 3)) * KINEMATICS_NOISE
    )
    turn = Rotation.align_vectors(motion.axis[None], [[0.0, 0.0, 1.0]])[0]
    quaternion = (Rotation.from_matrix(robot_from_phantom.rotation) * turn).as_quat()
    write_kinematics(
        folder / "kinematics.csv", times, robot_from_phantom.apply(centres), quaternion
    )
    sensor = ForceSensor.draw(scenario.force_noise or FORCE_NOISE, np.random.default_rng([seed, 4]))
    stamps = sensor.instants(motion.duration, rng)
    on_tool = -track.tool_force(stamps) @ robot_from_phantom.rotation.T
    write_forces(folder / "forces.csv", start + stamps, sensor.read(stamps, on_tool, rng))
    short = _short(motion.pushes, track.motion.pushes)
    return {motion.name: short} if any(short) else {}


def _short(planned: Sequence[PlannedPush], made: Sequence[PlannedPush]) -> list[float]:
    return [
        float(np.linalg.norm(one.waypoints[-1] - other.waypoints[-1]))
        for one, other in zip(planned, made, strict=True)
    ]
