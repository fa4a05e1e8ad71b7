"""One step of a tool that drags the surface along: equilibria and renewed grips in turn, until they
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
"""Residual with the renewed grip, over the push, at which pressure and friction agree."""
_MOST_TURNS = 30
_FIRST_SHARE = 0.34
"""Half as much again is how far the first turn goes to the renewed grip; all the way, the body
would often be led astray [1]."""
_ROUGH, _CLOSER = 1e-2, 0.2
"""Residual of the first equilibrium, and of each further one over the one with the grip renewed,
where `_AGREED` is enough."""


@dataclass(frozen=True, eq=False)
class FrictionState:
    """The step's beginning, at the quadrature points (f, p) of the model's surface: where they were
    seen from the tool's centre (f, p, 3) [m], and what held them, seen there, too.
    """

    seen: FloatArray
    friction_history: FrictionHistory

    @classmethod
    def of(cls, model: BlockModel, start: Equilibrium, before: ToolSphere) -> Self:
        """As the frame before left it, in which the tool was at `before`."""
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
    """The surface's quadrature points (f, p, 3) from the tool's centre [m]."""
    return np.asarray(
        np.einsum("qa,fai->fqi", model.face.shapes, positions[model.topology.surface]) - tool.centre
    )


def contact_depth(model: BlockModel, positions: FloatArray, tool: ToolSphere) -> FloatArray:
    """How deep each point is pressed (f, p) [m]; zero where it is not touched or not felt."""
    facing, depth = model.facing(positions, tool)
    return np.where(model.areas > 0 if model.dense else facing, np.maximum(depth, 0.0), 0.0)


def updated_friction(
    model: BlockModel, positions: FloatArray, tool: ToolSphere, past: FrictionState, friction: float
) -> FrictionPotential:
    """The grip that goes with the pressure at these positions."""
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
    """The grip of faces (g,) whose points are seen from the tool here (g, p, 3) [m], pressed in by
    `depth` (g, p) [m].

    A point that was not touched before sticks from where the tool met it: for the share of its way
    that came after. As that place moves while the equilibrium is sought, its stick is given that
    share of the stiffness instead, and the whole way.
    """
    gap, held = (
        np.maximum(np.linalg.norm(past.seen, axis=2) - radius, 0.0),
        past.friction_history.touched,
    )
    late = np.where(held, 1.0, depth / np.maximum(depth + gap, 1e-12))
    anchors = np.where(held[..., None], past.seen - past.friction_history.ways, past.seen)
    normals = seen / np.linalg.norm(seen, axis=2, keepdims=True)
    return FrictionPotential(
        faces,
        anchors,
        normals,
        friction * CONTACT_STIFFNESS * areas * depth,
        late * STICK_STIFFNESS * areas,
    )


def _initial_friction(model: BlockModel, past: FrictionState) -> FrictionPotential | None:
    """The grip that the step begins with: of those points that were held, as they were; None of
    none.
    """
    held = past.friction_history
    faces = np.flatnonzero(held.touched.any(axis=1))
    if not len(faces):
        return None
    here, areas = past.seen[faces], surface_quadrature(model.mesh, model.face).edges[faces] ** 2
    normals = here / np.linalg.norm(here, axis=2, keepdims=True)
    return FrictionPotential(
        faces,
        here - held.ways[faces],
        normals,
        held.limits[faces] * areas,
        STICK_STIFFNESS * model.areas[faces],
    )


def remaining_slip(seen: FloatArray, grip: FrictionPotential, areas: FloatArray) -> FloatArray:
    """Ways from the anchors (g, p, 3) [m] of the grip's points, seen from the tool here (g, p, 3),
    once the anchors were dragged along as far as their points slip; their tangential force is that
    times the area and the stick's stiffness.
    """
    ways = seen - grip.anchors
    ways -= grip.normals * np.einsum("gpi,gpi->gp", ways, grip.normals)[..., None]
    drag = grip.stiffness * np.linalg.norm(ways, axis=2)
    share = np.minimum(1.0, grip.limits / np.maximum(drag, 1e-300)) * grip.stiffness
    share /= np.maximum(
        STICK_STIFFNESS * areas, 1e-300
    )  # what is not felt has no area, and does not stick
    return np.asarray(ways * share[..., None])


def friction_history_of(
    model: BlockModel, positions: FloatArray, tool: ToolSphere, grip: FrictionPotential
) -> FrictionHistory:
    """What is left to the next step."""
    seen, spots = (
        points_from_tool(model, positions, tool),
        surface_quadrature(model.mesh, model.face),
    )
    whole, limits = np.zeros_like(seen), np.zeros(seen.shape[:2])
    whole[grip.faces] = remaining_slip(seen[grip.faces], grip, model.areas[grip.faces])
    limits[grip.faces] = grip.limits / spots.edges[grip.faces] ** 2
    return FrictionHistory(
        spots.places.reshape(-1, 3), whole.reshape(-1, 3), limits.ravel() > 0, limits.ravel()
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
    """Equilibrium with friction.

    Args:
        positions: (n, 3) to begin from [m].
        tools: the tool before and now.
        past: the step's beginning.
        friction: coefficient [1].
        tolerance: residual of each equilibrium; the last one's, with pressure and friction in
            agreement, is at most the larger of it and 1e-4.
        recall: puts what a material keeps of positions (n, 3) into the model.

    Returns:
        the solution, whose push has the drag in it, and what the step leaves to the next.
    """
    before, tool = tools
    iterations, share, last = 0, _FIRST_SHARE, np.inf
    model.friction_potential = _initial_friction(model, past)
    wanted = _ROUGH if tolerance >= _AGREED else tolerance
    try:
        solution = move_tool(
            model,
            positions,
            before,
            tool,
            max(wanted, tolerance),
            quick_solver,
            haste=not model.dense,
        )
        for _ in range(_MOST_TURNS):
            iterations += solution.iterations
            if not solution.converged:
                return replace(solution, iterations=iterations), FrictionHistory.nothing()
            grip = updated_friction(model, solution.positions, tool, past, friction)
            if recall is not None:
                recall(model, solution.positions)
            old: FrictionPotential | None = model.friction_potential
            model.friction_potential = grip
            residual = relative_residual(
                model, model.assemble(solution.positions, tool, tangent=False)
            )
            if residual <= max(tolerance, _AGREED):
                return replace(
                    solution, iterations=iterations, residual=residual
                ), friction_history_of(model, solution.positions, tool, grip)
            share = (
                max(share / 2, 0.1) if residual > last else min(1.5 * share, 1.0)
            )  # halves, where they go to and fro
            last = residual
            model.friction_potential = _blended(old, grip, share)
            solution = move_tool(
                model,
                solution.positions,
                tool,
                tool,
                max(min(wanted, _CLOSER * residual), tolerance),
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
    """The new grip with limits only part of the way from the old ones'."""
    if old is None or share == 1.0:
        return new
    before = np.zeros(
        (max(int(old.faces.max(initial=0)), int(new.faces.max(initial=0))) + 1, new.limits.shape[1])
    )
    before[old.faces] = old.limits
    return replace(new, limits=share * new.limits + (1 - share) * before[new.faces])
