"""A block that a ball has pushed, as the diagnosis sees it: points along camera rays, grouped, and
predictions made by hand.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.dataset import Kinematics
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.forward.ray_comparison import PointSample
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.box_mesh import GridSpec
from palpate.registration.registration import Registration
from palpate.replay.replay import Equilibrium, replay, rest
from palpate.setup.setup import Box, Setup, Tool

SIZE = (0.0687, 0.0393, 0.0358)
TOP = SIZE[2]
GRID = GridSpec(nodes=(9, 7, 6), spacing=2e-3)
FINER_GRID = GridSpec(nodes=(11, 9, 7), spacing=1.7e-3)
EYE = np.array([-0.19, -0.16, 0.28])
DWELL = 0.1


def looking_at(eye: FloatArray, target: FloatArray) -> Transform:
    """phantom_from_camera of a camera at `eye` (3,) that looks at `target` (3,) [m]."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return Transform(np.stack([right, np.cross(forward, right), forward], axis=1), eye)


POSE = looking_at(EYE, np.array([0.0, 0.0, TOP / 2]))
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3), mass=0.104, phantom_from_camera=POSE)
CORNERS = tuple(
    (x * SIZE[0] / 2, y * SIZE[1] / 2, TOP) for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))
)
"""Landmarks (x, y, z) [m] that are touched."""


def seen_points(
    frame: Equilibrium, count: int, noise: float, seed: int, truth: Setup = SETUP
) -> FloatArray:
    """Points (n, 3) [m] of the sides that face the camera, with noise [m] along the rays, as a
    camera reads them; camera frame.
    """
    random = np.random.default_rng(seed)
    low, high = (
        np.array([-SIZE[0] / 2, -SIZE[1] / 2, 0.0]),
        np.array([SIZE[0] / 2, SIZE[1] / 2, TOP]),
    )
    sides = []
    for axis, end in ((2, high), (0, low), (1, low)):
        sample = random.uniform(low, high, (count // 3, 3))
        sample[:, axis] = end[axis]
        sides.append(frame.move(sample * truth.scale))
    points = camera_model_for(truth).read(np.concatenate(sides))
    away = points / np.linalg.norm(points, axis=1)[:, None]
    return points + away * (noise * random.standard_normal(len(points)))[:, None]


def dwelling(centres: FloatArray) -> tuple[FloatArray, Kinematics]:
    """Times (g,) [s] at which a tool that jumps from place to place stands at each of the centres
    (g, 3) [m], and its stream.
    """
    time = np.arange(0, DWELL * len(centres), 1e-3)
    index = np.minimum((time / DWELL).astype(int), len(centres) - 1)
    stream = Kinematics(time, centres[index], np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1)))
    return np.asarray(DWELL * (np.arange(len(centres)) + 0.5)), stream


def observed(
    truth: Setup, centres: FloatArray, *, count: int = 6000, noise: float = 3e-4, seed: int = 0
) -> Observations:
    """One sequence of a block that behaves like `truth`; one group per place (g, 3) [m] at which
    the tool is stated to be.
    """
    times, stream = dwelling(centres)
    frames = replay(truth, touch_correction(truth, GRID).apply(centres), GRID)
    groups = [
        Group(
            (number,),
            seen_points(frame, count, noise, seed + number, truth),
            not frame.in_contact,
            push=1,
        )
        for number, frame in enumerate(frames)
    ]
    return Observations("poke-01", times, stream, tuple(groups))


def poke(depth: float, x: float = 4e-3, y: float = -2e-3) -> FloatArray:
    """Centre (3,) [m] of the ball pressed into the top by `depth` [m]."""
    return np.array([x, y, TOP + 5e-3 - depth])


def poked(name: str, truth: Setup, seed: int) -> Observations:
    """A sequence of this name, with the ball out of contact and at three depths."""
    centres = np.array([poke(-6e-3), poke(2e-3), poke(4e-3), poke(6e-3)])
    return replace(observed(truth, centres, count=20000, noise=2e-4, seed=seed), name=name)


def prediction(
    gap: FloatArray,
    *,
    name: str = "poke-01",
    count: float | FloatArray = 10.0,
    spread: float | FloatArray = 0.0,
    columns: FloatArray | None = None,
    failed: tuple[int, ...] = (),
) -> Prediction:
    """Made by hand: gap (g, p) [m], NaN where unseen; columns (g, p, k); `failed` groups have no
    equilibrium.
    """
    still = rest(SETUP, GridSpec())
    frames = [
        replace(still, outcome=Outcome.ITERATIONS if g in failed else Outcome.CONVERGED)
        for g in range(len(gap))
    ]
    none = np.zeros((*gap.shape, 0)) if columns is None else columns
    whole, real = np.zeros(0, np.int32), np.zeros(0)
    nothing = PointSample(whole, whole, real, real, np.zeros((0, 3)), whole)
    full = np.where(np.isfinite(gap), count, 0.0)
    return Prediction(
        name,
        gap,
        full,
        np.broadcast_to(spread, gap.shape),
        none,
        tuple(frames),
        (nothing,) * len(gap),
    )


def registration() -> Registration:
    """Touches good to 0.2 mm, a camera to 0.3 mm; no warnings."""
    accuracy = np.diag([2e-4] * 3 + [5e-3] * 3) ** 2
    return Registration(
        phantom_from_robot=Transform(),
        robot_covariance=accuracy,
        robot_pivot=np.array([0.0, 0.0, TOP]),
        touch_residuals=np.zeros((4, 3)),
        touch_rms=0.0,
        phantom_from_camera=POSE,
        camera_covariance=2.25 * accuracy,
        camera_pivot=np.array([0.0, 0.0, TOP]),
        weak_directions=(),
        warnings=("the touches disagree",),
        proposal=None,
        camera=None,
    )
