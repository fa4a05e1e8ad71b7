"""One step of a tool with friction: equilibria and updated friction potentials in turn, until they
agree.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from palpate.fem.continuation import move_tool
from palpate.fem.friction import STICK_STIFFNESS, FrictionHistory, FrictionPotential
from palpate.fem.mesh_quadrature import surface_quadrature
from palpate.fem.model import CONTACT_STIFFNESS, BlockModel, ToolSphere
from palpate.fem.modified_newton import ModifiedNewton
from palpate.fem.newton import Outcome, Solution, relative_residual
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.replay.equilibrium import Equilibrium

__all__ = [
    "FrictionState",
    "contact_depth",
    "friction_history_of",
    "friction_potential_of",
    "points_from_tool",
    "remaining_slip",
    "solve_with_friction",
    "updated_friction",
]

_AGREED = 1e-4
"""Relative residual with the updated friction at which pressure and friction agree."""
_MOST_TURNS = 30
_FIRST_SHARE = 0.34
"""The first update goes 1.5 times this share of the way to the updated friction [1]; the ways way
would often lead the body astray."""
_ROUGH, _CLOSER = 1e-2, 0.2
"""Relative residual of the first equilibrium; and residual of each further one over the one with
updated friction, if `_AGREED` is sufficient."""


@dataclass(frozen=True, eq=False)
class FrictionState:
    """State before the step, at the quadrature points (f, p) of the model's surface.

    Attributes:
        seen: (f, p, 3) positions relative to the tool's centre [m].
        friction_history: state of friction, at the same points.
    """

    seen: FloatArray
    friction_history: FrictionHistory

    @classmethod
    def of(cls, model: BlockModel, start: Equilibrium, before: ToolSphere) -> Self:
        """The state left by the frame before, in which the tool was at `before`."""
        places = surface_quadrature(model.mesh, model.face).places
        flat = places.reshape(-1, 3)
        seen = (flat + start.mesh.interpolate(start.displacement, flat)).reshape(
            places.shape
        ) - before.centre
        return cls(seen, (start.friction_history or FrictionHistory.nothing()).at(places))

    def on(self, faces: IntArray) -> Self:
        """The part of it on these faces (g,)."""
        return type(self)(self.seen[faces], self.friction_history.on(faces))


def points_from_tool(model: BlockModel, positions: FloatArray, tool: ToolSphere) -> FloatArray:
    """The surface's quadrature points (f, p, 3) relative to the tool's centre [m]."""
    return np.asarray(
        np.einsum("qa,fai->fqi", model.face.shapes, positions[model.topology.surface]) - tool.centre
    )


def contact_depth(model: BlockModel, positions: FloatArray, tool: ToolSphere) -> FloatArray:
    """Depth of each point inside the tool (f, p) [m]; zero without contact."""
    facing, depth = model.facing(positions, tool)
    return np.where(model.areas > 0 if model.dense else facing, np.maximum(depth, 0.0), 0.0)


def updated_friction(
    model: BlockModel, positions: FloatArray, tool: ToolSphere, past: FrictionState, friction: float
) -> FrictionPotential:
    """The friction potential that belongs to the pressure at these positions."""
    seen = points_from_tool(model, positions, tool)
    depth = contact_depth(model, positions, tool)
    faces = np.flatnonzero((depth > 0).any(axis=1))
    return friction_potential_of(
        faces, seen[faces], depth[faces], past.on(faces), model.areas[faces], tool.radius, friction
    )


def friction_potential_of(
    faces: IntArray,
    seen: FloatArray,
    depth: FloatArray,
    past: FrictionState,
    areas: FloatArray,
    radius: float,
    friction: float,
) -> FrictionPotential:
    """The friction potential of some faces.

    A point that was not touched before sticks from where the tool met it: for the share of its path
    after that. Because that place moves during the solve, its stick has that share of the stiffness
    instead, and the ways path.

    Args:
        faces: (g,) numbers.
        seen: (g, p, 3) their points relative to the tool [m].
        depth: (g, p) inside the tool [m].
        past: state before the step on these faces.
        areas: (g, p) weights of the contact [m^2].
        radius: of the tool [m].
        friction: coefficient [1].
    """
    gap, touched = (
        np.maximum(np.linalg.norm(past.seen, axis=2) - radius, 0.0),
        past.friction_history.touched,
    )
    late = np.where(touched, 1.0, depth / np.maximum(depth + gap, 1e-12))
    anchors = np.where(touched[..., None], past.seen - past.friction_history.ways, past.seen)
    normals = seen / np.linalg.norm(seen, axis=2, keepdims=True)
    return FrictionPotential(
        faces,
        anchors,
        normals,
        friction * CONTACT_STIFFNESS * areas * depth,
        late * STICK_STIFFNESS * areas,
    )


def _initial_friction(model: BlockModel, past: FrictionState) -> FrictionPotential | None:
    """The friction potential at the start of the step, of the points in contact; None if there are
    none.
    """
    history = past.friction_history
    faces = np.flatnonzero(history.touched.any(axis=1))
    if not len(faces):
        return None
    here, areas = past.seen[faces], surface_quadrature(model.mesh, model.face).edges[faces] ** 2
    normals = here / np.linalg.norm(here, axis=2, keepdims=True)
    return FrictionPotential(
        faces,
        here - history.ways[faces],
        normals,
        history.limits[faces] * areas,
        STICK_STIFFNESS * model.areas[faces],
    )


def remaining_slip(seen: FloatArray, potential: FrictionPotential, areas: FloatArray) -> FloatArray:
    """Tangential distances from the anchors (g, p, 3) [m] after the anchors were dragged along.

    The tangential force is this distance times the area and the stick's stiffness.

    Args:
        seen: (g, p, 3) points relative to the tool [m].
        potential: the friction potential.
        areas: (g, p) weights of the contact [m^2].
    """
    ways = seen - potential.anchors
    ways -= potential.normals * np.einsum("gpi,gpi->gp", ways, potential.normals)[..., None]
    drag = potential.stiffness * np.linalg.norm(ways, axis=2)
    share = np.minimum(1.0, potential.limits / np.maximum(drag, 1e-300)) * potential.stiffness
    share /= np.maximum(
        STICK_STIFFNESS * areas, 1e-300
    )  # points without contact have no area, and do not stick
    return np.asarray(ways * share[..., None])


def friction_history_of(
    model: BlockModel, positions: FloatArray, tool: ToolSphere, potential: FrictionPotential
) -> FrictionHistory:
    """The state of friction for the next step."""
    seen, surface = (
        points_from_tool(model, positions, tool),
        surface_quadrature(model.mesh, model.face),
    )
    ways, limits = np.zeros_like(seen), np.zeros(seen.shape[:2])
    ways[potential.faces] = remaining_slip(
        seen[potential.faces], potential, model.areas[potential.faces]
    )
    limits[potential.faces] = potential.limits / surface.edges[potential.faces] ** 2
    return FrictionHistory(
        surface.places.reshape(-1, 3), ways.reshape(-1, 3), limits.ravel() > 0, limits.ravel()
    )


def solve_with_friction(
    model: BlockModel,
    positions: FloatArray,
    tools: tuple[ToolSphere, ToolSphere],
    past: FrictionState,
    friction: float,
    tolerance: float,
    quick_solver: ModifiedNewton,
    recall: Callable[[BlockModel, FloatArray], None] | None = None,
) -> tuple[Solution, FrictionHistory]:
    """Solve for the equilibrium with friction.

    Args:
        model: of the block.
        positions: (n, 3) to begin from [m].
        tools: before and now.
        past: state before the step.
        friction: coefficient [1].
        tolerance: relative residual of each equilibrium; the last one's, with pressure and friction
            in agreement, is at most the larger of it and 1e-4.
        quick_solver: modified Newton method.
        recall: applies the material's history at positions (n, 3) to the model.

    Returns:
        the solution, whose push includes the drag, and the state of friction for the next step.
    """
    before, tool = tools
    iterations, share, last = 0, _FIRST_SHARE, np.inf
    model.friction_potential = _initial_friction(model, past)
    required = _ROUGH if tolerance >= _AGREED else tolerance
    try:
        solution = move_tool(
            model,
            positions,
            before,
            tool,
            max(required, tolerance),
            quick_solver,
            haste=not model.dense,
        )
        for _ in range(_MOST_TURNS):
            iterations += solution.iterations
            if not solution.converged:
                return replace(solution, iterations=iterations), FrictionHistory.nothing()
            potential = updated_friction(model, solution.positions, tool, past, friction)
            if recall is not None:
                recall(model, solution.positions)
            old: FrictionPotential | None = model.friction_potential
            model.friction_potential = potential
            residual = relative_residual(
                model, model.assemble(solution.positions, tool, tangent=False)
            )
            if residual <= max(tolerance, _AGREED):
                return replace(
                    solution, iterations=iterations, residual=residual
                ), friction_history_of(model, solution.positions, tool, potential)
            share = (
                max(share / 2, 0.1) if residual > last else min(1.5 * share, 1.0)
            )  # halved if the iteration oscillates
            last = residual
            model.friction_potential = _blended(old, potential, share)
            solution = move_tool(
                model,
                solution.positions,
                tool,
                tool,
                max(min(required, _CLOSER * residual), tolerance),
                quick_solver,
            )
        return replace(
            solution, outcome=Outcome.GRIP_SWINGS, iterations=iterations, residual=residual
        ), FrictionHistory.nothing()
    finally:
        model.friction_potential = None


def _blended(
    old: FrictionPotential | None, new: FrictionPotential, share: float
) -> FrictionPotential:
    """The new friction potential with limits only part of the way from the old one's."""
    if old is None or share == 1.0:
        return new
    before = np.zeros(
        (max(int(old.faces.max(initial=0)), int(new.faces.max(initial=0))) + 1, new.limits.shape[1])
    )
    before[old.faces] = old.limits
    return replace(new, limits=share * new.limits + (1 - share) * before[new.faces])
