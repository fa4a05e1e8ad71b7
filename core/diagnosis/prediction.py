"""One sequence under one setup: gaps by group and patch, and how they would change with anything that might be wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from core.diagnosis.comparison import Compared, Sample, choose, compare, observe
from core.diagnosis.force import Felt
from core.diagnosis.leading import led
from core.diagnosis.observations import Observations
from core.diagnosis.ordered import Past, forgetful
from core.fem.model import rule_of
from core.fem.newton import Outcome
from core.fem.stiffness import lump_share
from core.frames import FloatArray
from core.local_stiffness import stiffness_changes
from core.measurement import Surface
from core.meshing import Meshing
from core.replay import Equilibrium, Replay
from core.sensitivity import TOOL_STEP, Change, displacement_changes, force_changes
from core.setup import Inclusion, Setup
from core.sight import sight_of

__all__ = ["TOOL_COLUMNS", "Columns", "Prediction", "Sample", "Wanted", "predict"]

TOOL_COLUMNS = 6
"""Columns that always come first: the tool moved along x, y, z and turned about the robot registration's pivot."""

_MOST_RESPONSE = 1.5
"""Where the body follows the tool by more than this [1], its tangent is about to give way."""
_SPAN = 4e-4
"""Half the tool's motion [m] over which the change is taken there."""


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
class Prediction:
    """One sequence under one setup.

    Attributes:
        gap: (g, p) mean of measured minus simulated [m], NaN where unseen. count: (g, p) points. spread: (g, p) [m].
        columns: (g, p, k) change of gap: TOOL_COLUMNS, then setups, then lumps.
        equilibria: of each group. samples: of each group, for the predictions of other models; none without clouds, where there
            are no patches. felt: forces, if there are any.
    """

    name: str
    gap: FloatArray
    count: FloatArray
    spread: FloatArray
    columns: FloatArray
    equilibria: tuple[Equilibrium, ...]
    samples: tuple[Sample, ...]
    felt: Felt | None = None

    @property
    def unseen(self) -> bool:
        """Whether there are forces alone."""
        return not self.gap.shape[1]

    @property
    def failed(self) -> tuple[int, ...]:
        """Groups without equilibrium."""
        return tuple(i for i, frame in enumerate(self.equilibria) if frame.outcome is not Outcome.CONVERGED)

    def of_groups(self, index: Sequence[int]) -> Prediction:
        """These groups alone."""
        own = list(index)
        frames = tuple(self.equilibria[row] for row in own)
        points = tuple(self.samples[row] for row in own) if self.samples else ()
        felt = None if self.felt is None else self.felt.of_groups(own)
        seen = (self.gap[own], self.count[own], self.spread[own], self.columns[own])
        return Prediction(self.name, *seen, frames, points, felt)

    def with_rows(self, columns: FloatArray) -> Prediction:
        """With other columns (g, p, k), or (g, p + 3, k) where the last rows are the force's."""
        patches = self.gap.shape[1]
        felt = None if self.felt is None else replace(self.felt, columns=columns[:, patches:])
        return replace(self, columns=columns[:, :patches], felt=felt)

    def beside(self, surface: FloatArray, force: FloatArray | None = None) -> Prediction:
        """With further columns last: of the surface's gap (g, p, m), and of the force's (g, 3, m), which are else zero."""
        columns = np.concatenate([self.columns, surface], axis=2)
        if self.felt is None:
            return replace(self, columns=columns)
        none = np.zeros((len(surface), 3, surface.shape[2]))
        return replace(self, columns=columns, felt=self.felt.beside(none if force is None else force))

    def with_column(self, other: Prediction, column: int, step: float) -> Prediction:
        """With what another setup changes over its step in place of a column."""
        surface, force = other.less(self)
        columns = [self.columns] if self.felt is None else [self.columns, self.felt.columns]
        changed = np.concatenate(columns, axis=1)
        changed[..., column] = (surface if force is None else np.concatenate([surface, force], axis=1)) / step
        return self.with_rows(changed)

    def upon(self, base: Prediction, origin: Prediction) -> Prediction:
        """With gaps as if what this model changes over `origin`, both on another mesh, had been done to `base`."""
        felt = self.felt
        if felt is not None and base.felt is not None and origin.felt is not None:
            felt = replace(felt, gap=base.felt.gap + felt.gap - origin.felt.gap)
        return replace(self, gap=base.gap + self.gap - origin.gap, felt=felt)

    def alone(self) -> Prediction:
        """The gaps without what takes most of the memory: for what is only compared."""
        return replace(self, columns=self.columns[..., :0], equilibria=(), samples=())

    def less(self, origin: Prediction) -> tuple[FloatArray, FloatArray | None]:
        """What this model's gaps have over another's, of the surface (g, p) [m] and of the force (g, 3) [N]; zero where unseen."""
        felt = None if self.felt is None or origin.felt is None else np.nan_to_num(self.felt.gap - origin.felt.gap)
        return np.nan_to_num(self.gap - origin.gap), felt


class Columns:
    """Changes of a group's displacement, projected on what is seen of it, and of the force on the tool, if that is `felt`."""

    def __init__(self, block: Replay, wanted: Wanted, felt: bool) -> None:
        self.block, self.wanted, self.felt = block, wanted, felt
        here = block.setup
        self._seen = {at_rest: sight_of(here, reference=at_rest) for at_rest in (False, True)}
        self._others = [{at_rest: sight_of(other, reference=at_rest) for at_rest in (False, True)} for other in wanted.setups]
        self._grown = [other.scale / here.scale - 1.0 for other in wanted.setups]
        self._alike = not any(growth.any() for growth in self._grown)

    @property
    def count(self) -> int:
        """Of all columns."""
        return TOOL_COLUMNS + len(self.wanted.setups) + len(self.wanted.lumps)

    def changes(self, frame: Equilibrium, moves: FloatArray) -> FloatArray:
        """(k, n + 1, 3) for the tool's motion, the setups and the lumps: of the nodes [m], and last of the force [N].

        `moves` (s, 3) are the setups' own tool motions [m].
        """
        setup, wanted = self.block.setup, self.wanted
        steps = [(setup, TOOL_STEP * axis) for axis in np.eye(3)]
        steps += [(other, move) for other, move in zip(wanted.setups, moves, strict=True)]
        changed = self._with_forces(frame, steps, displacement_changes(self.block, frame, steps))
        tool = changed[:3] / TOOL_STEP
        for axis in np.flatnonzero(np.abs(tool[:, :-1]).max(axis=(1, 2)) > _MOST_RESPONSE):
            self._span(frame, int(axis), tool, changed[3:], moves)
        arm = frame.probe.centre - wanted.pivot
        turned = [np.tensordot(np.cross(axis, arm), tool, axes=1) for axis in np.eye(3)]
        scaled = changed[3:] / np.array(wanted.steps)[:, None, None] if wanted.steps else changed[3:]
        factors = np.array([lump_share(lump, rule_of(frame.mesh)) for lump in wanted.lumps])
        still = [(setup, np.zeros(3))] * len(factors)
        lumps = self._with_forces(frame, still, stiffness_changes(self.block, frame, factors)) if still else changed[:0]
        return np.concatenate([tool, np.array(turned), scaled, lumps])

    def _with_forces(self, frame: Equilibrium, steps: Sequence[Change], moved: FloatArray) -> FloatArray:
        """Displacements (k, n, 3) [m], and last the forces that come with them [N]; zero where none is felt."""
        pressed = force_changes(self.block, frame, steps, moved) if self.felt else np.zeros((len(moved), 3))
        return np.concatenate([moved, pressed[:, None]], axis=1)

    def of_force(self, changes: FloatArray, measured: FloatArray, turned: FloatArray) -> FloatArray:
        """(3, k) changes of measured minus simulated force [N], from `changes` (k, n + 1, 3) and the measured force (3,) [N].

        A measured force turns with the robot's registration; `turned` (s, 3, 3) is how far each of the setups turns it. Another
        clock finds another instant, but force and place of the same.
        """
        found = -changes[:, -1].T
        found[:, 3:6] += np.cross(np.eye(3), np.nan_to_num(measured)).T
        for number, other in enumerate(self.wanted.setups):
            found[:, TOOL_COLUMNS + number] += (turned[number] - np.eye(3)) @ np.nan_to_num(measured) / self.wanted.steps[number]
            if other.sensor.time_offset != self.block.setup.sensor.time_offset:
                found[:, TOOL_COLUMNS + number] = 0.0
        return found

    def _span(self, frame: Equilibrium, axis: int, tool: FloatArray, changed: FloatArray, moves: FloatArray) -> None:
        """Put what a finite motion of the tool along an axis does in place of its derivative, in all columns it has a share in.

        Under a deep push a coarse grid may be about to give way sideways. Its derivative then is many times what any motion that
        matters brings about, and would hide an offset of the tool from the screening.
        """
        step = _SPAN * np.eye(3)[axis]
        sides = [self.block.held(replace(frame.probe, centre=frame.probe.centre + sign * step), frame) for sign in (1, -1)]
        if any(side.outcome is not Outcome.CONVERGED for side in sides):
            return
        ahead, behind = (
            np.concatenate([side.mesh.interpolate(side.displacement, frame.mesh.nodes), side.force[None]]) for side in sides
        )
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

    def of_group(self, frame: Equilibrium, moves: FloatArray) -> FloatArray:
        """As `changes`, with how the block itself grows; zero where nothing holds the block against anything."""
        if frame.in_contact or self.block.setup.load.specific_weight_over_stiffness or not self._alike:
            found = self.changes(frame, moves)
        else:
            found = np.zeros((self.count, len(frame.displacement) + 1, 3))
        for number, (growth, step) in enumerate(zip(self._grown, self.wanted.steps, strict=True)):
            found[TOOL_COLUMNS + number, :-1] += frame.mesh.nodes * growth / step
        return found

    def project(
        self, frame: Equilibrium, changes: FloatArray, moves: FloatArray, compared: Compared, reference: bool
    ) -> FloatArray:
        """(p, k) changes of the patch averages; the reference was seen before the camera could move."""
        values = np.zeros((len(compared.means.mean), self.count))
        if changes[:, :-1].any():
            values = -(observe(frame, compared) @ changes[:, :-1].reshape(len(changes), -1).T)
        if len(compared.tool):
            centre, radius = self.of_ball(frame, moves)
            values -= compared.scale * compared.average(compared.away @ centre.T + radius, compared.patch)
        here = self._seen[reference]
        for number, (others, step) in enumerate(zip(self._others, self.wanted.steps, strict=True)):
            if not others[reference].same(here):
                moved = others[reference].place(here.read(compared.points))
                values[:, TOOL_COLUMNS + number] += compared.along_sight(moved, others[reference].scale) / step
        return values


def predict(
    data: Observations,
    setup: Setup,
    grid: Meshing,
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
    surface, block = Surface.of(setup), Replay(setup, grid, tolerance)
    way = led(data, setup, grid, wanted)
    true_from_stated, centres, moves, turned, measured = way.correction, way.centres, way.moves, way.turned, way.measured
    columns = Columns(block, wanted, measured is not None) if wanted and not setup.remembers else None
    gap, count, spread, changes, pressed, frames, chosen = [], [], [], [], [], [], []
    past = Past(data, block, true_from_stated) if setup.remembers else None
    turns = data.turns(setup) if past is None and setup.support.friction_coefficient is not None else [None] * len(centres)
    previous: Equilibrium | None = None
    for number, (group, centre, turn) in enumerate(zip(data.groups, centres, turns, strict=True)):
        if turn is not None:
            block.step(true_from_stated.apply(turn[None])[0], previous)
        if past is not None:
            frame = past.reach(centre, data.instant(group, setup))
        else:
            start = starts[number] if starts is not None and starts[number].in_contact else previous
            frame = block.sought(centre, (start, previous))
        previous = frame if frame.outcome is Outcome.CONVERGED else None
        sample = samples[number] if samples is not None else choose(group, setup, frame, surface)
        compared = compare(group, setup, frame, surface, sample)
        chosen.append(sample)
        gap.append(compared.means.mean)
        count.append(compared.means.count)
        spread.append(compared.means.spread)
        frames.append(replace(frame, way=()))  # what was on the way to it is for this replay alone
        if columns is not None:
            moved = columns.of_group(frame, moves[:, number])
            changes.append(columns.project(frame, moved, moves[:, number], compared, group.reference).astype(np.float32))
            if measured is not None:
                pressed.append(columns.of_force(moved, measured[0][number], turned).astype(np.float32))
    stacked: FloatArray = np.stack(changes) if changes else np.zeros((len(gap), surface.patches, 0))
    if wanted and past is not None:
        # What a little change does to all that a frame hangs on is no first-order change of the frame: it is stated without memory.
        plain = replace(wanted, setups=tuple(forgetful(other) for other in wanted.setups))
        forgotten = predict(data, forgetful(setup), grid, plain, starts, tolerance, chosen)
        stacked, pressed = forgotten.columns, [] if forgotten.felt is None else list(forgotten.felt.columns)
    return Prediction(
        data.name, np.array(gap), np.array(count, dtype=float), np.array(spread), stacked, tuple(frames), tuple(chosen),
        None if measured is None else Felt.of(measured, frames, pressed),
    )  # fmt: skip
