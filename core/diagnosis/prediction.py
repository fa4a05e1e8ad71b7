"""One sequence under one setup: gaps by group and patch, and how they would change with anything that might be wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from core.diagnosis.observations import Group, Observations
from core.fem.model import log_stiffness
from core.fem.newton import Outcome
from core.frames import FloatArray, Transform
from core.measurement import Gaps, PatchMeans, Surface, gaps, plain_means, within_spread
from core.mesh import GridSpec, IntArray
from core.registration.robot import fit_robot
from core.replay import Equilibrium, Replay, rest
from core.sensitivity import TOOL_STEP, displacement_changes, stiffness_changes
from core.setup import Inclusion, Setup

__all__ = ["TOOL_COLUMNS", "Prediction", "Sample", "Wanted", "predict", "touch_correction"]

TOOL_COLUMNS = 6
"""Columns that always come first: the tool moved along x, y, z and turned about the robot registration's pivot."""

_MOST_RESPONSE = 1.5
"""Where the body follows the tool by more than this [1], its tangent is about to give way."""
_SPAN = 4e-4
"""Half the tool's motion [m] over which the change is taken there."""
TOOL_REACH, CLEARLY = 1.5e-3, 5e-4
"""A point this near to a model's ball [m], and nearer to it by this much than to the model's surface, is of the tool: clouds are
cleaned of the tool where it was stated to be, and if it is somewhere else, some of its points remain."""

_MOST_STRETCH = 2.0
"""A model's surface may turn away from the camera so far that a gap along the ray counts this many times the gap itself."""
FARTHEST_CHANGE = 8e-3
"""A point's gap that changes by more than this [m] between models has met another side of the block: its old gap stands."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Wanted:
    """Which changes a prediction shall state.

    Attributes:
        setups: setups that differ a little. steps: by how much, each; the column is the change over the step.
        lumps: inclusions, whose columns are the change per unit logarithm of their stiffness ratio.
        pivot: (3,) [m] about which the robot registration turns.
    """

    setups: tuple[Setup, ...] = ()
    steps: tuple[float, ...] = ()
    lumps: tuple[Inclusion, ...] = ()
    pivot: FloatArray


@dataclass(frozen=True, eq=False)
class Sample:
    """Which of a group's points are averaged where: settled by the baseline and kept for every other model.

    Were each model to choose anew, points would change patches with the model, and the noise they carry would look like a
    difference between models. Nor may a model turn its sides towards the camera or away from it, and the noise along the rays
    with them: gaps count along the ray, times the cosine that the baseline's surface has.

    Attributes:
        index: (m,) of the group's points. patch: (m,). gap: (m,) of the baseline [m], which stands where a model's ray misses.
        facing: (m,) cosine between the baseline's normal and the way back to the camera.
    """

    index: IntArray
    patch: IntArray
    gap: FloatArray
    facing: FloatArray


@dataclass(frozen=True, eq=False)
class Prediction:
    """One sequence under one setup.

    Attributes:
        gap: (g, p) mean of measured minus simulated [m], NaN where unseen. count: (g, p) points. spread: (g, p) [m].
        columns: (g, p, k) change of gap: TOOL_COLUMNS, then setups, then lumps.
        equilibria: of each group. samples: of each group, for the predictions of other models.
    """

    name: str
    gap: FloatArray
    count: FloatArray
    spread: FloatArray
    columns: FloatArray
    equilibria: tuple[Equilibrium, ...]
    samples: tuple[Sample, ...]

    @property
    def failed(self) -> tuple[int, ...]:
        """Groups without equilibrium."""
        return tuple(i for i, frame in enumerate(self.equilibria) if frame.outcome is not Outcome.CONVERGED)


def touch_correction(setup: Setup, grid: GridSpec) -> Transform:
    """Stated to true phantom_from_robot: the touched landmarks had sagged, while the registration took them for unloaded."""
    if not setup.load.specific_weight_over_stiffness or len(setup.landmarks) < 3:
        return Transform()
    landmarks = np.array(setup.landmarks)
    return fit_robot(landmarks, rest(setup, grid).move(landmarks)).phantom_from_robot


@dataclass(frozen=True, eq=False)
class _Compared:
    """A group's sample under one model.

    Attributes:
        points: (m, 3) phantom frame [m]. seen: those that lie on the surface. means: of the gaps, by patch.
        tool: (t,) those that lie on the tool instead. away: (t, 3) unit vectors from its centre. patch: (t,) where they count.
    """

    points: FloatArray
    seen: Gaps
    means: PatchMeans
    tool: IntArray
    away: FloatArray
    patch: IntArray

    def average(self, values: FloatArray, patch: IntArray) -> FloatArray:
        """Sums over the points of each patch (p, k) of (n, k) values, over all the patch's points."""
        total = np.zeros((len(self.means.mean), values.shape[1]))
        np.add.at(total, patch, values)
        return np.asarray(total / np.maximum(self.means.count, 1)[:, None])

    def along_sight(self, moved: Transform) -> FloatArray:
        """Change of the averages (p,) [m] when the camera's points are moved."""
        shift = moved.apply(self.points) - self.points
        surface = np.einsum("mi,mi->m", shift[self.seen.index], self.seen.normal)
        ball = np.einsum("ti,ti->t", shift[self.tool], self.away)
        values, patch = np.concatenate([surface, ball]), np.concatenate([self.seen.patch, self.patch])
        return self.average(values[:, None], patch)[:, 0]


class _Columns:
    """Changes of a group's displacement, projected on what is seen of it."""

    def __init__(self, block: Replay, wanted: Wanted) -> None:
        self.block, self.wanted = block, wanted

    def displacement(self, frame: Equilibrium, moves: FloatArray) -> FloatArray:
        """(k, n, 3) for the tool's motion, the setups and the lumps; `moves` (s, 3) are the setups' own tool motions [m]."""
        setup, wanted = self.block.setup, self.wanted
        steps = [(setup, TOOL_STEP * axis) for axis in np.eye(3)]
        steps += [(other, move) for other, move in zip(wanted.setups, moves, strict=True)]
        changed = displacement_changes(self.block, frame, steps)
        tool = changed[:3] / TOOL_STEP
        for axis in np.flatnonzero(np.abs(tool).max(axis=(1, 2)) > _MOST_RESPONSE):
            self._span(frame, int(axis), tool, changed[3:], moves)
        arm = frame.probe.centre - wanted.pivot
        turned = [np.tensordot(np.cross(axis, arm), tool, axes=1) for axis in np.eye(3)]
        scaled = changed[3:] / np.array(wanted.steps)[:, None, None] if wanted.steps else changed[3:]
        corners = frame.mesh.nodes[frame.mesh.hexahedra] if wanted.lumps else np.empty((0, 2, 3))
        factors = np.array([log_stiffness((replace(lump, stiffness_ratio=np.e),), corners) for lump in wanted.lumps])
        lumps = stiffness_changes(self.block, frame, factors) if wanted.lumps else changed[:0]
        return np.concatenate([tool, np.array(turned), scaled, lumps])

    def _span(self, frame: Equilibrium, axis: int, tool: FloatArray, changed: FloatArray, moves: FloatArray) -> None:
        """Put what a finite motion of the tool along an axis does in place of its derivative, in all columns it has a share in.

        Under a deep push a coarse grid may be about to give way sideways. Its derivative then is many times what any motion that
        matters brings about, and would hide an offset of the tool from the screening.
        """
        step = _SPAN * np.eye(3)[axis]
        sides = [self.block.held(replace(frame.probe, centre=frame.probe.centre + sign * step), frame) for sign in (1, -1)]
        if any(side.outcome is not Outcome.CONVERGED for side in sides):
            return
        ahead, behind = (side.mesh.interpolate(side.displacement, frame.mesh.nodes) for side in sides)
        wrong, tool[axis] = tool[axis].copy(), (ahead - behind) / (2 * _SPAN)
        stated = np.array(self.block.setup.tool.offset)
        for column, (other, move) in enumerate(zip(self.wanted.setups, moves, strict=True)):
            share = (np.array(other.tool.offset) - stated + move)[axis]
            changed[column] += share * (tool[axis] - wrong)

    def of_ball(self, frame: Equilibrium, moves: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How the ball's centre (k, 3) and radius (k,) change, in the order of `displacement`."""
        stated, steps = self.block.setup.tool, np.array(self.wanted.steps)[:, None]
        arm = frame.probe.centre - self.wanted.pivot
        shifts = [np.subtract(other.tool.offset, stated.offset) for other in self.wanted.setups]
        growth = [other.tool.radius - stated.radius for other in self.wanted.setups]
        own = (moves + np.array(shifts)) / steps if shifts else np.zeros((0, 3))
        lumps = np.zeros((len(self.wanted.lumps), 3))
        centre = np.concatenate([np.eye(3), np.cross(np.eye(3), arm), own, lumps])
        radius = np.concatenate([np.zeros(6), np.array(growth) / steps[:, 0] if growth else [], np.zeros(len(lumps))])
        return centre, radius

    def project(self, frame: Equilibrium, moves: FloatArray, compared: _Compared, reference: bool) -> FloatArray:
        """(p, k) changes of the patch averages; the reference was seen before the camera could move."""
        values = np.zeros((len(compared.means.mean), TOOL_COLUMNS + len(self.wanted.setups) + len(self.wanted.lumps)))
        if frame.in_contact or self.block.setup.load.specific_weight_over_stiffness:
            fields = self.displacement(frame, moves)
            values = -(_observe(frame, compared) @ fields.reshape(len(fields), -1).T)
        if len(compared.tool):
            centre, radius = self.of_ball(frame, moves)
            values -= compared.average(compared.away @ centre.T + radius, compared.patch)
        here = self.block.setup.phantom_from_camera_true
        for number, (other, step) in enumerate(zip(self.wanted.setups, self.wanted.steps, strict=True)):
            if not reference and other.sensor.camera_shift is not self.block.setup.sensor.camera_shift:
                moved = other.phantom_from_camera_true @ here.inverse()
                values[:, TOOL_COLUMNS + number] += compared.along_sight(moved) / step
        return values


def _observe(frame: Equilibrium, compared: _Compared) -> sp.csr_matrix:
    """Patch averages of the displacement along the normal as a linear function of the nodes' displacement (p, 3n)."""
    seen, patches = compared.seen, len(compared.means.mean)
    nodes, weights = frame.mesh.locate(seen.foot)
    share = 1.0 / np.maximum(compared.means.count, 1)[seen.patch]
    entries = (weights[:, :, None] * seen.normal[:, None, :] * share[:, None, None]).ravel()
    columns = (3 * nodes[:, :, None] + np.arange(3)).ravel()
    rows = np.repeat(seen.patch, 3 * nodes.shape[1])
    return sp.coo_matrix((entries, (rows, columns)), shape=(patches, 3 * len(frame.mesh.nodes))).tocsr()


def _chosen(group: Group, setup: Setup, frame: Equilibrium, surface: Surface) -> Sample:
    """The points to average, by the model at hand: those on clear parts of the surface, without stray ones."""
    points, pose = _placed(group, setup)
    seen = gaps(points, pose.translation, frame, surface)
    kept = within_spread(seen.gap, seen.patch, surface.patches)
    index, patch = seen.index[kept].astype(np.int32), seen.patch[kept].astype(np.int32)
    return Sample(index, patch, seen.gap[kept].astype(np.float32), seen.facing[kept].astype(np.float32))


def _placed(group: Group, setup: Setup) -> tuple[FloatArray, Transform]:
    """The group's points in the phantom frame, and the camera's pose; the reference was seen before the camera could move."""
    pose = setup.phantom_from_camera if group.reference else setup.phantom_from_camera_true
    return pose.apply(group.points), pose


def _along_rays(seen: Gaps, sample: Sample) -> Gaps:
    """Gaps, and the normals that say how they change, as long as the baseline's surface would have made them of these rays."""
    factor = np.minimum(sample.facing[seen.index] / np.maximum(seen.facing, 1e-6), _MOST_STRETCH)
    return replace(seen, gap=seen.gap * factor, normal=seen.normal * factor[:, None])


def _compare(group: Group, setup: Setup, frame: Equilibrium, surface: Surface, sample: Sample) -> _Compared:
    """The sample's points, where they meet the surface, and their averages; points of the model's tool lie off the tool."""
    points, pose = _placed(group, setup)
    points = points[sample.index]
    seen = _along_rays(gaps(points, pose.translation, frame, surface, everything=True), sample)
    values = sample.gap.astype(float)
    near = np.abs(seen.gap - values[seen.index]) < FARTHEST_CHANGE
    values[seen.index[near]] = seen.gap[near]
    arm = points - frame.probe.centre
    distance = np.linalg.norm(arm, axis=1)
    off_tool = distance - frame.probe.radius
    on_tool = (np.abs(off_tool) < TOOL_REACH) & (np.abs(off_tool) < np.abs(values) - CLEARLY)
    values[on_tool] = off_tool[on_tool]
    kept, tool = ~on_tool[seen.index], np.flatnonzero(on_tool)
    index = seen.index[kept]
    seen = Gaps(
        index, seen.gap[kept], seen.foot[kept], seen.normal[kept], seen.facing[kept], sample.patch[index], seen.side[kept]
    )  # fmt: skip
    means = plain_means(values, sample.patch, surface.patches)
    return _Compared(points, seen, means, tool, arm[tool] / distance[tool, None], sample.patch[tool])


def predict(
    data: Observations,
    setup: Setup,
    grid: GridSpec,
    wanted: Wanted | None = None,
    starts: Sequence[Equilibrium] | None = None,
    tolerance: float = 3e-4,
    samples: Sequence[Sample] | None = None,
) -> Prediction:
    """Replay a sequence's groups and compare each with its points.

    Args:
        starts: equilibria of a similar setup, one per group, to begin from.
        wanted: changes to state; none without it. samples: which points to average; chosen anew without them.
    """
    surface, block = Surface(setup.geometry), Replay(setup, grid, tolerance)
    true_from_stated = touch_correction(setup, grid)
    centres = true_from_stated.apply(data.centres(setup))
    moves = np.zeros((len(wanted.setups) if wanted else 0, len(data.groups), 3))
    for number, other in enumerate(wanted.setups if wanted else ()):
        moves[number] = touch_correction(other, grid).apply(data.centres(other)) - centres
    columns = _Columns(block, wanted) if wanted else None
    gap, count, spread, changes, frames, chosen = [], [], [], [], [], []
    turns = data.turns(setup) if setup.support.friction_coefficient is not None else [None] * len(centres)
    previous: Equilibrium | None = None
    for number, (group, centre) in enumerate(zip(data.groups, centres, strict=True)):
        turn = turns[number]
        if turn is not None:
            block.step(true_from_stated.apply(turn[None])[0], previous)
        start = starts[number] if starts is not None and starts[number].in_contact else previous
        frame = block.step(centre, start)
        if frame.outcome is not Outcome.CONVERGED and start is not previous:
            frame = block.step(centre, previous)
        previous = frame if frame.outcome is Outcome.CONVERGED else None
        sample = samples[number] if samples is not None else _chosen(group, setup, frame, surface)
        compared = _compare(group, setup, frame, surface, sample)
        means = compared.means
        chosen.append(sample)
        gap.append(means.mean)
        count.append(means.count)
        spread.append(means.spread)
        frames.append(frame)
        if columns is not None:
            changes.append(columns.project(frame, moves[:, number], compared, group.reference).astype(np.float32))
    stacked: FloatArray = np.stack(changes) if changes else np.zeros((len(gap), surface.patches, 0))
    return Prediction(
        data.name, np.array(gap), np.array(count, dtype=float), np.array(spread), stacked, tuple(frames), tuple(chosen)
    )
