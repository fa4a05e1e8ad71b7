"""How what is seen of a group, and the force that is felt, would change with anything that might be
wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.ray_comparison import PointComparison, averaging_matrix
from palpate.diagnosis.forward.slip_derivatives import Sliding
from palpate.effects.parameter import LOG_PER_CONTRAST
from palpate.fem.constitutive.stiffness_field import lump_share
from palpate.fem.mesh_quadrature import element_quadrature
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.gradients.displacement_changes import displacement_changes
from palpate.gradients.force_changes import force_changes
from palpate.gradients.setup_change import TOOL_STEP, Change
from palpate.gradients.stiffness_derivatives import stiffness_changes
from palpate.measurement.camera_model import camera_model_for
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Inclusion, Setup

__all__ = ["TOOL_COLUMNS", "Columns", "JacobianRequest"]

TOOL_COLUMNS = 6
"""Columns that always come first: the tool moved along x, y, z and turned about the robot
registration's pivot."""


@dataclass(frozen=True, eq=False, kw_only=True)
class JacobianRequest:
    """Which changes a prediction shall state.

    Attributes:
        setups: setups that differ a little.
        steps: by how much, each; the column is the change over the step.
        lumps: inclusions, whose columns are the change per unit of their stiffness ratio's
            contrast, where it is one.
        pivot: (3,) [m] about which the robot registration turns.
    """

    setups: tuple[Setup, ...] = ()
    steps: tuple[float, ...] = ()
    lumps: tuple[Inclusion, ...] = ()
    pivot: FloatArray


class Columns:
    """Changes of a group's displacement, projected on what is seen of it, and of the force on the
    tool, if that is `felt`.
    """

    def __init__(self, block: Replay, wanted: JacobianRequest, forces: bool) -> None:
        self.block, self.wanted, self.forces = block, wanted, forces
        here = block.setup
        self._seen = {
            at_rest: camera_model_for(here, reference=at_rest) for at_rest in (False, True)
        }
        self._others = [
            {at_rest: camera_model_for(other, reference=at_rest) for at_rest in (False, True)}
            for other in wanted.setups
        ]
        self._grown = [other.scale / here.scale - 1.0 for other in wanted.setups]
        self._alike = not any(growth.any() for growth in self._grown)
        slides = here.support.friction_coefficient is not None
        self._sliding = (
            Sliding(here, wanted.setups, wanted.steps, TOOL_COLUMNS, self.count) if slides else None
        )

    @property
    def count(self) -> int:
        """Of all columns."""
        return TOOL_COLUMNS + len(self.wanted.setups) + len(self.wanted.lumps)

    def changes(self, frame: Equilibrium, moves: FloatArray) -> FloatArray:
        """(k, n + 1, 3) for the tool's motion, the setups and the lumps: of the nodes [m], and last
        of the force [N].

        `moves` (s, 3) are the setups' own tool motions [m].
        """
        setup, wanted = self.block.setup, self.wanted
        steps = [(setup, TOOL_STEP * axis) for axis in np.eye(3)]
        steps += [(other, move) for other, move in zip(wanted.setups, moves, strict=True)]
        changed = self._with_forces(
            frame, steps, displacement_changes(self.block, frame, steps, exact=False)
        )
        tool = changed[:3] / TOOL_STEP
        for axis in np.flatnonzero(
            np.abs(tool[:, :-1]).max(axis=(1, 2)) > CRITERIA.derivatives.most_response
        ):
            self._span(frame, int(axis), tool, changed[3:], moves)
        arm = frame.tool.centre - wanted.pivot
        turned = [np.tensordot(np.cross(axis, arm), tool, axes=1) for axis in np.eye(3)]
        scaled = (
            changed[3:] / np.array(wanted.steps)[:, None, None] if wanted.steps else changed[3:]
        )
        factors = LOG_PER_CONTRAST * np.array(
            [lump_share(lump, element_quadrature(frame.mesh)) for lump in wanted.lumps]
        )
        still = [(setup, np.zeros(3))] * len(factors)
        lumps = (
            self._with_forces(frame, still, stiffness_changes(self.block, frame, factors))
            if still
            else changed[:0]
        )
        return np.concatenate([tool, np.array(turned), scaled, lumps])

    def _with_forces(
        self, frame: Equilibrium, steps: Sequence[Change], moved: FloatArray
    ) -> FloatArray:
        """Displacements (k, n, 3) [m], and last the forces that come with them [N]; zero where
        nobody asks for them.
        """
        wanted = self.forces or self._sliding is not None
        pressed = (
            force_changes(self.block, frame, steps, moved) if wanted else np.zeros((len(moved), 3))
        )
        return np.concatenate([moved, pressed[:, None]], axis=1)

    def of_force(self, changes: FloatArray, measured: FloatArray, turned: FloatArray) -> FloatArray:
        """(3, k) changes of measured minus simulated force [N], from `changes` (k, n + 1, 3) and
        the measured force (3,) [N].

        A measured force turns with the robot's registration; `turned` (s, 3, 3) is how far each of
        the setups turns it. Another clock finds another instant, but force and place of the same.
        """
        found = -changes[:, -1].T
        found[:, 3:6] += np.cross(np.eye(3), np.nan_to_num(measured)).T
        for number, other in enumerate(self.wanted.setups):
            found[:, TOOL_COLUMNS + number] += (
                (turned[number] - np.eye(3)) @ np.nan_to_num(measured) / self.wanted.steps[number]
            )
            if other.sensor.time_offset != self.block.setup.sensor.time_offset:
                found[:, TOOL_COLUMNS + number] = 0.0
        return found

    def _span(
        self,
        frame: Equilibrium,
        axis: int,
        tool: FloatArray,
        changed: FloatArray,
        moves: FloatArray,
    ) -> None:
        """Put what a finite motion of the tool along an axis does in place of its derivative, in
        all columns it has a share in.

        Under a deep push a coarse grid may be about to give way sideways. Its derivative then is
        many times what any motion that matters brings about, and would hide an offset of the tool
        from the screening.
        """
        step = CRITERIA.derivatives.tool_span * np.eye(3)[axis]
        sides = [
            self.block.solve_with_fixed_base(
                replace(frame.tool, centre=frame.tool.centre + sign * step), frame
            )
            for sign in (1, -1)
        ]
        if any(side.outcome is not Outcome.CONVERGED for side in sides):
            return
        ahead, behind = (
            np.concatenate(
                [side.mesh.interpolate(side.displacement, frame.mesh.nodes), side.force[None]]
            )
            for side in sides
        )
        wrong, tool[axis] = (
            tool[axis].copy(),
            (ahead - behind) / (2 * CRITERIA.derivatives.tool_span),
        )
        stated = np.array(self.block.setup.tool.offset)
        for column, (other, move) in enumerate(zip(self.wanted.setups, moves, strict=True)):
            share = (np.array(other.tool.offset) - stated + move)[axis]
            changed[column] += share * (tool[axis] - wrong)

    def of_ball(self, frame: Equilibrium, moves: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How the ball's centre (k, 3) and radius (k,) change, in the order of `displacement`."""
        stated, steps = self.block.setup.tool, np.array(self.wanted.steps)[:, None]
        arm = frame.tool.centre - self.wanted.pivot
        shifts = [np.subtract(other.tool.offset, stated.offset) for other in self.wanted.setups]
        growth = [other.tool.radius - stated.radius for other in self.wanted.setups]
        own = (moves + np.array(shifts)) / steps if shifts else np.zeros((0, 3))
        lumps = np.zeros((len(self.wanted.lumps), 3))
        centre = np.concatenate([np.eye(3), np.cross(np.eye(3), arm), own, lumps])
        radius = np.concatenate(
            [np.zeros(6), np.array(growth) / steps[:, 0] if growth else [], np.zeros(len(lumps))]
        )
        return centre, radius

    def of_group(self, frame: Equilibrium, moves: FloatArray) -> FloatArray:
        """As `changes`, with how the block itself grows; zero where nothing holds the block against
        anything.
        """
        if (
            frame.in_contact
            or self.block.setup.load.specific_weight_over_stiffness
            or not self._alike
        ):
            found = self.changes(frame, moves)
        else:
            found = np.zeros((self.count, len(frame.displacement) + 1, 3))
        for number, (growth, step) in enumerate(zip(self._grown, self.wanted.steps, strict=True)):
            found[TOOL_COLUMNS + number, :-1] += frame.mesh.nodes * growth / step
        return found if self._sliding is None else self._sliding.after(frame, found)

    def passed(self, frame: Equilibrium, moves: FloatArray) -> None:
        """Take note of an equilibrium between two groups, in which a base may slide; `moves` as for
        `changes`.
        """
        if self._sliding is not None and self._sliding.slid(frame):
            self._sliding.after(frame, self.changes(frame, moves))

    def project(
        self,
        frame: Equilibrium,
        changes: FloatArray,
        moves: FloatArray,
        compared: PointComparison,
        reference: bool,
    ) -> FloatArray:
        """(p, k) changes of the patch averages; the reference was seen before the camera could
        move.
        """
        values = np.zeros((len(compared.means.mean), self.count))
        if changes[:, :-1].any():
            values = -(
                averaging_matrix(frame, compared) @ changes[:, :-1].reshape(len(changes), -1).T
            )
        if len(compared.tool):
            centre, radius = self.of_ball(frame, moves)
            values -= compared.scale * compared.average(
                compared.away @ centre.T + radius, compared.patch
            )
        here = self._seen[reference]
        for number, (others, step) in enumerate(zip(self._others, self.wanted.steps, strict=True)):
            if not others[reference].same(here):
                moved = others[reference].place(here.read(compared.places))
                values[:, TOOL_COLUMNS + number] += (
                    compared.along_sight(moved, others[reference].scale) / step
                )
        return values
