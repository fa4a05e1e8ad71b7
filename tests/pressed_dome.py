"""A dataset of a dome pressed from above, seen by a camera, made by the replay itself in seconds.

The tool is larger than stated. Robot and phantom have one frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from shapes import dome

from palpate.dataset import Dataset, open_dataset
from palpate.dataset.accepted_registration import AcceptedRegistration
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.mesh.tet_fill import TetSpec
from palpate.replay.equilibrium import Equilibrium
from palpate.replay.replay import replay
from palpate.setup.setup import Setup, Tool
from palpate.synthetic import Scenario
from palpate.synthetic.bodies.organ_shape import write_surface
from palpate.synthetic.dataset_writer import (
    write_clouds,
    write_config,
    write_kinematics,
    write_ply,
    write_touches,
)

__all__ = ["write_pressed_dome"]

SHAPE = dome((0.035, 0.028, 0.022))
STATED = Setup(geometry=SHAPE, tool=Tool(radius=5e-3))
TRUE = replace(STATED, tool=Tool(radius=8e-3))
MESH = TetSpec(path=((0.0, 0.0, 0.022),), radius=0.012, spacing=2.6e-3, coarsest=4e-3)
EYE = np.array([0.05, -0.12, 0.30])
PUSH, RATE, NOISE = 2.0, 4.0, 2e-4
"""Time of a push [s], clouds a second [1/s], and noise of a point along its ray [m]."""
POINTS = SHAPE.surface_points((60, 30, 20))
NORMALS = SHAPE.facing(POINTS)[1]


def write_pressed_dome(root: Path, splits: Mapping[str, tuple[str, ...]], seed: int = 0) -> Dataset:
    """Write and open a dataset of three pushes a sequence, registered as it was taken."""
    rng, names = np.random.default_rng(seed), [name for names in splits.values() for name in names]
    root.mkdir(parents=True)
    scenario = Scenario(size=SHAPE.size, mass=0.05, sequences=tuple(names), splits=dict(splits))
    high = POINTS[POINTS[:, 2] > 0.6 * SHAPE.height]
    marks = {f"mark_{n}": np.round(high[n * len(high) // 6], 5) for n in range(6)}
    write_surface(root / "phantom.stl", SHAPE.vertices, SHAPE.triangles)
    write_config(root / "dataset.toml", "dome", scenario, marks, None, "phantom.stl")
    lift = np.array([0.0, 0.0, scenario.touch_offset])
    write_touches(root / "touches.csv", list(marks), np.array(list(marks.values())) + lift)
    camera = _camera()
    table = np.column_stack([rng.uniform(-0.08, 0.08, (4000, 2)), np.zeros(4000)])
    beside = table[np.hypot(*(table[:, :2] / np.array(SHAPE.size[:2]) * 2).T) > 1.05]
    rest = np.concatenate([_seen(None, rng), beside])
    write_ply(root / "rest.ply", camera.inverse().apply(rest))
    for name in names:
        _write_sequence(root / "sequences" / name, camera, rng)
    accuracy = np.diag([(2e-4) ** 2] * 3 + [(2e-3) ** 2] * 3)
    accepted = AcceptedRegistration("as taken", camera, accuracy, np.zeros(3))
    return open_dataset(root).registered(accepted)


def _camera() -> Transform:
    """The pose phantom_from_camera: the camera looks at the dome."""
    forward = np.array([0.0, 0.0, 0.01]) - EYE
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return Transform(np.column_stack([right, np.cross(forward, right), forward]), EYE)


def _write_sequence(folder: Path, camera: Transform, rng: np.random.Generator) -> None:
    (folder / "clouds").mkdir(parents=True)
    times = np.arange(0.0, 3 * PUSH + 1.0, 0.01)
    centres = _motion(times, rng)
    write_kinematics(folder / "kinematics.csv", times, centres, np.array([0.0, 0.0, 0.0, 1.0]))
    stamps = np.arange(0.1, times[-1] - 0.1, 1 / RATE)
    rows = np.searchsorted(times, stamps)
    frames = replay(TRUE, centres[rows], MESH, tolerance=1e-3)
    files = [f"clouds/{number:03d}.ply" for number in range(len(frames))]
    for frame, file in zip(frames, files, strict=True):
        write_ply(folder / file, camera.inverse().apply(_seen(frame, rng)))
    write_clouds(folder / "clouds.csv", times[rows], files)


def _motion(times: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Tool centres (n, 3) [m] of three pushes into the upper part of the dome."""
    places = rng.uniform([-0.014, -0.010], [0.014, 0.010], (3, 2))
    tops = SHAPE.heights(places) + STATED.tool.radius
    number = np.clip((times / PUSH).astype(int), 0, 2)
    share = np.clip(times / PUSH - number, 0.0, 1.0)
    depth = np.clip(np.minimum(share - 0.25, 0.85 - share) / 0.2, 0.0, 1.0)
    # Between two pushes the tool travels above the body.
    place = (
        places[number]
        + (places[np.minimum(number + 1, 2)] - places[number])
        * np.clip((share - 0.9) / 0.1, 0.0, 1.0)[:, None]
    )
    height = np.where(depth > 0, tops[number], tops.max())
    return np.column_stack([place, height + 8e-3 - 12e-3 * depth])


def _seen(frame: Equilibrium | None, rng: np.random.Generator) -> FloatArray:
    """Points (n, 3) [m] of the dome that the camera sees beside the tool, with noise."""
    moved = POINTS if frame is None else frame.move(POINTS)
    rays = moved - EYE
    away = np.linalg.norm(rays, axis=1)
    rays /= away[:, None]
    seen = np.einsum("ni,ni->n", rays, NORMALS) < -0.15
    if frame is not None:
        centre = frame.tool.centre - EYE
        along = rays @ centre
        apart = np.linalg.norm(centre - along[:, None] * rays, axis=1)
        seen &= (apart > frame.tool.radius + 5e-4) | (along > away)
    noise = rng.normal(0.0, NOISE, (int(seen.sum()), 1))
    return np.asarray(moved[seen] + noise * rays[seen])
