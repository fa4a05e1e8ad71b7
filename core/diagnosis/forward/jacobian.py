"""Changes of the visible surface and of the force of a group with each parameter of a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.ray_comparison import PointComparison, averaging_matrix
from palpate.diagnosis.forward.slip_derivatives import SlipTangent
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
from palpate.setup.setup import AnyInclusion, Setup

__all__ = ["TOOL_COLUMNS", "JacobianColumns", "JacobianRequest"]

TOOL_COLUMNS = 6
"""Number of columns that always come first: the tool moved along x, y, z and turned about the robot
registration's pivot."""


@dataclass(frozen=True, eq=False, kw_only=True)
class JacobianRequest:
    """The columns that a prediction states.

    Attributes:
        setups: setups that differ a little.
        steps: size of each difference; the column is the change over the step.
        lumps: inclusions, whose columns are the change by their stiffness contrast, where it is
            zero.
        pivot: (3,) about which the robot registration turns [m].
    """

    setups: tuple[Setup, ...] = ()
    steps: tuple[float, ...] = ()
    lumps: tuple[AnyInclusion, ...] = ()
    pivot: FloatArray


class JacobianColumns:
    """Changes of a group's displacement, projected on the visible points, and of the tool's force.

    Args:
        block: replay of the setup.
        request: columns.
        forces: whether changes of the force are needed.
    """

    def __init__(self, block: Replay, request: JacobianRequest, forces: bool) -> None:
        self.block, self.request, self.forces = block, request, forces
        here = block.setup
        self._seen = {
            at_rest: camera_model_for(here, reference=at_rest) for at_rest in (False, True)
        }
        self._others = [
            {at_rest: camera_model_for(other, reference=at_rest) for at_rest in (False, True)}
            for other in request.setups
        ]
        self._grown = [other.scale / here.scale - 1.0 for other in request.setups]
        self._alike = not any(growth.any() for growth in self._grown)
        casts = [other.cast != here.cast for other in request.setups]
        self._cast = [number for number, other in enumerate(casts) if other]
        self._solved = [number for number, other in enumerate(casts) if not other]
        slides = here.support.friction_coefficient is not None
        self._sliding = (
            SlipTangent(here, request.setups, request.steps, TOOL_COLUMNS, self.count)
            if slides
            else None
        )

    @property
    def count(self) -> int:
        """Number of columns."""
        return TOOL_COLUMNS + len(self.request.setups) + len(self.request.lumps)

    def changes(self, frame: Equilibrium, moves: FloatArray) -> FloatArray:
        """Return the changes of the nodes [m], and last of the force [N] (k, n + 1, 3).

        They are those by the tool's motion, by the setups, and by the inclusions.

        Args:
            frame: equilibrium of the group.
            moves: motion of the tool under each setup (s, 3) [m].
        """
        setup, request = self.block.setup, self.request
        steps = [(setup, TOOL_STEP * axis) for axis in np.eye(3)]
        steps += [(request.setups[number], moves[number]) for number in self._solved]
        found = self._with_forces(
            frame, steps, displacement_changes(self.block, frame, steps, exact=False)
        )
        tool = found[:3] / TOOL_STEP
        changed = np.zeros((3 + len(request.setups), *found.shape[1:]))
        changed[[0, 1, 2, *(3 + number for number in self._solved)]] = found
        for axis in np.flatnonzero(
            np.abs(tool[:, :-1]).max(axis=(1, 2)) > CRITERIA.derivatives.most_response
        ):
            self._span(frame, int(axis), tool, changed[3:], moves)
        raised = self._raised(frame) if self._cast else np.zeros((0, 3))
        for number, raise_ in zip(self._cast, raised, strict=True):
            changed[3 + number] = np.tensordot(moves[number] - raise_, tool, axes=1)
        arm = frame.tool.centre - request.pivot
        turned = [np.tensordot(np.cross(axis, arm), tool, axes=1) for axis in np.eye(3)]
        scaled = (
            changed[3:] / np.array(request.steps)[:, None, None] if request.steps else changed[3:]
        )
        factors = LOG_PER_CONTRAST * np.array(
            [lump_share(lump, element_quadrature(frame.mesh)) for lump in request.lumps]
        )
        still = [(setup, np.zeros(3))] * len(factors)
        lumps = (
            self._with_forces(frame, still, stiffness_changes(self.block, frame, factors))
            if still
            else changed[:0]
        )
        return np.concatenate([tool, np.array(turned), scaled, lumps])

    def _raised(self, frame: Equilibrium) -> FloatArray:
        """Return by how much the surface under the tool is raised (c, 3) [m] in the setups with
        another cast.

        That acts on the body nearly as a tool that comes as much nearer: to a third of the change,
        for a hundredth of the time that a mesh for each setup takes. By the rest of the offset the
        surface is elsewhere by the same amount in all groups, which each patch's constant takes
        out.
        """
        here = self.block.setup
        centre = (frame.tool.centre - np.append(frame.slip, 0.0))[None]
        distance, normal = here.geometry.facing_free(centre)
        foot = (centre - distance[:, None] * normal) / here.scale
        casts = [self.request.setups[number] for number in self._cast]
        moved = [other.cast_motion(foot)[0] for other in casts]
        return np.asarray((np.array(moved) - here.cast_motion(foot)) * here.scale)

    def _with_forces(
        self, frame: Equilibrium, steps: Sequence[Change], moved: FloatArray
    ) -> FloatArray:
        """Return displacements (k, n, 3) [m] with the force [N] as one more row.

        It is zero where no force is needed.
        """
        needed = self.forces or self._sliding is not None
        pressed = (
            force_changes(self.block, frame, steps, moved) if needed else np.zeros((len(moved), 3))
        )
        return np.concatenate([moved, pressed[:, None]], axis=1)

    def of_force(self, changes: FloatArray, measured: FloatArray, turned: FloatArray) -> FloatArray:
        """Return the changes of measured minus simulated force (3, k) [N].

        A measured force turns with the robot's registration. Another clock finds another instant,
        but force and position of the same one.

        Args:
            changes: of the group, as `changes` returns them.
            measured: force (3,) [N].
            turned: rotation of a measured force by each setup (s, 3, 3).
        """
        found = -changes[:, -1].T
        found[:, 3:6] += np.cross(np.eye(3), np.nan_to_num(measured)).T
        for number, other in enumerate(self.request.setups):
            found[:, TOOL_COLUMNS + number] += (
                (turned[number] - np.eye(3)) @ np.nan_to_num(measured) / self.request.steps[number]
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
        """Replace the derivative by the tool's motion along an axis with a finite difference.

        Under a deep push a coarse grid may be close to an instability sideways. The derivative is
        then many times the change by any motion that matters, and would hide an offset of the tool
        from the screening. All columns that contain the motion are corrected.

        Args:
            frame: equilibrium of the group.
            axis: of the motion.
            tool: changes by the tool's motion along each axis, to be corrected.
            changed: changes by the setups, to be corrected.
            moves: motion of the tool under each setup (s, 3) [m].
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
        for column, (other, move) in enumerate(zip(self.request.setups, moves, strict=True)):
            share = (np.array(other.tool.offset) - stated + move)[axis]
            changed[column] += share * (tool[axis] - wrong)

    def of_ball(self, frame: Equilibrium, moves: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the changes of the ball's centre (k, 3) and radius (k,), in the order of
        `changes`.
        """
        stated, steps = self.block.setup.tool, np.array(self.request.steps)[:, None]
        arm = frame.tool.centre - self.request.pivot
        shifts = [np.subtract(other.tool.offset, stated.offset) for other in self.request.setups]
        growth = [other.tool.radius - stated.radius for other in self.request.setups]
        own = (moves + np.array(shifts)) / steps if shifts else np.zeros((0, 3))
        lumps = np.zeros((len(self.request.lumps), 3))
        centre = np.concatenate([np.eye(3), np.cross(np.eye(3), arm), own, lumps])
        radius = np.concatenate(
            [np.zeros(6), np.array(growth) / steps[:, 0] if growth else [], np.zeros(len(lumps))]
        )
        return centre, radius

    def of_group(self, frame: Equilibrium, moves: FloatArray) -> FloatArray:
        """Return the changes of a group, as `changes` does, with the growth of the block in them.

        They are zero where the block is in contact with nothing.
        """
        if (
            frame.in_contact
            or self.block.setup.load.specific_weight_over_stiffness
            or not self._alike
        ):
            found = self.changes(frame, moves)
        else:
            found = np.zeros((self.count, len(frame.displacement) + 1, 3))
        for number, (growth, step) in enumerate(zip(self._grown, self.request.steps, strict=True)):
            found[TOOL_COLUMNS + number, :-1] += frame.mesh.nodes * growth / step
        return found if self._sliding is None else self._sliding.after(frame, found)

    def passed(self, frame: Equilibrium, moves: FloatArray) -> None:
        """Include an equilibrium between two groups, in which a base may slide.

        Args:
            frame: the equilibrium.
            moves: as for `changes`.
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
        """Return the changes of the patch averages (p, k).

        Args:
            frame: equilibrium of the group.
            changes: of the group.
            moves: motion of the tool under each setup (s, 3) [m].
            compared: the visible points.
            reference: whether the group was seen before the camera could move.
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
        for number, (others, step) in enumerate(zip(self._others, self.request.steps, strict=True)):
            if not others[reference].same(here):
                moved = others[reference].place(here.read(compared.places))
                values[:, TOOL_COLUMNS + number] += (
                    compared.along_sight(moved, others[reference].scale) / step
                )
        return values
