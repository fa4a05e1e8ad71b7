"""One step of a tool that drags the surface along: equilibria and renewed grips in turn, until they agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from core.equilibrium import Equilibrium
from core.fem.follow import Follower
from core.fem.friction import STICK_STIFFNESS, Grip, Hold
from core.fem.model import CONTACT_STIFFNESS, BlockModel, Probe, surface_spots
from core.fem.newton import Outcome, Solution, misfit
from core.fem.path import lead
from core.frames import FloatArray
from core.meshing import IntArray

__all__ = ["Past", "drag", "gripped", "hold_of", "pressed", "renewed", "seen_from", "ways_left"]

_AGREED = 1e-4
"""Residual with the renewed grip, over the push, at which pressure and friction agree."""
_MOST_TURNS = 30


@dataclass(frozen=True, eq=False)
class Past:
    """The step's beginning, at the quadrature points (f, p) of the model's surface: where they were seen from the tool's centre
    (f, p, 3) [m], their tangential ways from the anchors (f, p, 3) [m], and which were touched (f, p)."""

    seen: FloatArray
    ways: FloatArray
    touched: np.ndarray[Any, np.dtype[np.bool_]]

    @classmethod
    def of(cls, model: BlockModel, start: Equilibrium, before: Probe) -> Self:
        """As the frame before left it, in which the tool was at `before`."""
        places = surface_spots(model.mesh).places
        flat = places.reshape(-1, 3)
        seen = (flat + start.mesh.interpolate(start.displacement, flat)).reshape(places.shape) - before.centre
        ways, touched = (start.hold or Hold.nothing()).at(places)
        return cls(seen, ways, touched)

    def on(self, faces: IntArray) -> Self:
        """The part of it on these faces (g,)."""
        return type(self)(self.seen[faces], self.ways[faces], self.touched[faces])


def seen_from(model: BlockModel, positions: FloatArray, probe: Probe) -> FloatArray:
    """The surface's quadrature points (f, p, 3) from the tool's centre [m]."""
    return np.asarray(np.einsum("qa,fai->fqi", model.face.shapes, positions[model.topology.surface]) - probe.centre)


def pressed(model: BlockModel, positions: FloatArray, probe: Probe, seen: FloatArray) -> FloatArray:
    """How deep each point is pressed (f, p) [m]; zero where it is not touched or faces away."""
    tangents = np.einsum("qac,fai->fqci", model.face.gradients, positions[model.topology.surface])
    facing = np.einsum("fqi,fqi->fq", np.cross(tangents[:, :, 0], tangents[:, :, 1]), seen)
    return np.where(facing < 0, np.maximum(probe.radius - np.linalg.norm(seen, axis=2), 0.0), 0.0)


def renewed(model: BlockModel, positions: FloatArray, probe: Probe, past: Past, friction: float) -> Grip:
    """The grip that goes with the pressure at these positions."""
    seen = seen_from(model, positions, probe)
    depth = pressed(model, positions, probe, seen)
    faces = np.flatnonzero((depth > 0).any(axis=1))
    return gripped(faces, seen[faces], depth[faces], past.on(faces), model.areas[faces], probe.radius, friction)


def gripped(
    faces: IntArray, seen: FloatArray, depth: FloatArray, past: Past, areas: FloatArray, radius: float, friction: float
) -> Grip:
    """The grip of faces (g,) whose points are seen from the tool here (g, p, 3) [m], pressed in by `depth` (g, p) [m].

    A point that was not touched before sticks from where the tool met it: for the share of its way that came after. As that place
    moves while the equilibrium is sought, its stick is given that share of the stiffness instead, and the whole way.
    """
    gap = np.maximum(np.linalg.norm(past.seen, axis=2) - radius, 0.0)
    late = np.where(past.touched, 1.0, depth / np.maximum(depth + gap, 1e-12))
    anchors = np.where(past.touched[..., None], past.seen - past.ways, past.seen)
    normals = seen / np.linalg.norm(seen, axis=2, keepdims=True)
    return Grip(faces, anchors, normals, friction * CONTACT_STIFFNESS * areas * depth, late * STICK_STIFFNESS * areas)


def ways_left(seen: FloatArray, grip: Grip, areas: FloatArray) -> FloatArray:
    """Ways from the anchors (g, p, 3) [m] of the grip's points, seen from the tool here (g, p, 3), once the anchors were dragged
    along as far as their points slip; their tangential force is that times the area and the stick's stiffness."""
    ways = seen - grip.anchors
    ways -= grip.normals * np.einsum("gpi,gpi->gp", ways, grip.normals)[..., None]
    drag = grip.stiffness * np.linalg.norm(ways, axis=2)
    share = np.minimum(1.0, grip.limits / np.maximum(drag, 1e-300)) * grip.stiffness / (STICK_STIFFNESS * areas)
    return np.asarray(ways * share[..., None])


def hold_of(model: BlockModel, positions: FloatArray, probe: Probe, grip: Grip) -> Hold:
    """What is left to the next step."""
    seen = seen_from(model, positions, probe)
    whole, touched = np.zeros_like(seen), np.zeros(seen.shape[:2], dtype=bool)
    whole[grip.faces] = ways_left(seen[grip.faces], grip, model.areas[grip.faces])
    touched[grip.faces] = grip.limits > 0
    return Hold(surface_spots(model.mesh).places.reshape(-1, 3), whole.reshape(-1, 3), touched.ravel())


def drag(
    model: BlockModel,
    positions: FloatArray,
    probes: tuple[Probe, Probe],
    past: Past,
    friction: float,
    tolerance: float,
    follower: Follower,
    recall: Callable[[BlockModel, FloatArray], None] | None = None,
) -> tuple[Solution, Hold]:
    """Equilibrium with friction.

    Args:
        positions: (n, 3) to begin from [m]. probes: the tool before and now. past: the step's beginning.
        friction: coefficient [1]. tolerance: residual of each equilibrium; the last one's, with pressure and friction in
            agreement, is at most the larger of it and 1e-4.
        recall: puts what a material keeps of positions (n, 3) into the model.

    Returns:
        the solution, whose push has the drag in it, and what the step leaves to the next.
    """
    before, probe = probes
    iterations, share, last = 0, 1.0, np.inf
    model.grip = None
    try:
        solution = lead(model, positions, before, probe, tolerance, follower)
        for _ in range(_MOST_TURNS):
            iterations += solution.iterations
            if not solution.converged:
                return replace(solution, iterations=iterations), Hold.nothing()
            grip = renewed(model, solution.positions, probe, past, friction)
            if recall is not None:
                recall(model, solution.positions)
            old: Grip | None = model.grip
            model.grip = grip
            residual = misfit(model, model.assemble(solution.positions, probe, tangent=False))
            if residual <= max(tolerance, _AGREED):
                return replace(solution, iterations=iterations, residual=residual), hold_of(model, solution.positions, probe, grip)
            share = max(share / 2, 0.1) if residual > last else min(1.5 * share, 1.0)  # halves, where they go to and fro
            last = residual
            model.grip = _mixed(old, grip, share)
            solution = lead(model, solution.positions, probe, probe, tolerance, follower)
        return replace(solution, outcome=Outcome.GRIP_SWINGS, iterations=iterations, residual=residual), Hold.nothing()
    finally:
        model.grip = None


def _mixed(old: Grip | None, new: Grip, share: float) -> Grip:
    """The new grip with limits only part of the way from the old ones'."""
    if old is None or share == 1.0:
        return new
    before = np.zeros((max(int(old.faces.max(initial=0)), int(new.faces.max(initial=0))) + 1, new.limits.shape[1]))
    before[old.faces] = old.limits
    return replace(new, limits=share * new.limits + (1 - share) * before[new.faces])
