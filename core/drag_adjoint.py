"""One step of a tool that drags the surface along, linearised where pressure and friction agree, and transposed.

With x where a touched point of the surface is seen from the tool's centre, b where it was seen from at the step's beginning, and w
its way from its anchor then, the step leaves the way W(x, b, w), and the tangential force on the point is W times a stiffness
(`core.fem.drag`). Derivatives of W are central differences at the points: stick and slip, as well as what touches, stay what they
are. They are not symmetric, since the limit of friction goes with the pressure.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from core.equilibrium import Equilibrium
from core.fem.drag import Past, gripped, hold_of, pressed, renewed, seen_from, ways_left
from core.fem.friction import STICK_STIFFNESS, Hold
from core.fem.model import BlockModel, Probe, surface_spots
from core.frames import FloatArray

__all__ = ["Begun", "DragStep"]

_STEP = 1e-9
"""Of places [m] in central differences: small beside any penetration that matters."""


def _slopes(function: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Derivatives (g, p, 3, 3), point by point, of a function of a shift (3,) [m] that all points have; the last index is its."""
    return np.stack([(function(step) - function(-step)) / (2 * _STEP) for step in _STEP * np.eye(3)], axis=-1)


def _pulled(slopes: FloatArray, costate: FloatArray) -> FloatArray:
    """Transposed slopes (g, p, 3, 3) times a costate (g, p, 3)."""
    return np.asarray(np.einsum("gpij,gpi->gpj", slopes, costate))


@dataclass(frozen=True, eq=False)
class Begun:
    """Costates of where a step begins: of the displacement (n, 3) there, of what its `hold` has as ways (m, 3), and of the tool's
    centre (3,)."""

    displacement: FloatArray
    ways: FloatArray
    centre: FloatArray


class DragStep:
    """A step of `drag` that ended at these positions (n, 3) [m], with the model in the step that made them.

    Attributes:
        grip: what holds the surface then. symmetric: whether the tangent is.
    """

    symmetric = False

    def __init__(
        self, model: BlockModel, positions: FloatArray, probe: Probe, past: Past, friction: float, costate: FloatArray
    ) -> None:
        """`costate` is that of the ways left, at all points of the surface (f p, 3)."""
        self._model = model
        self.grip = renewed(model, positions, probe, past, friction)
        faces, radius = self.grip.faces, probe.radius
        seen = seen_from(model, positions, probe)
        depth = pressed(model, positions, probe)[faces]
        self._areas, past, here = model.areas[faces], past.on(faces), seen[faces]

        def left(x: FloatArray, b: FloatArray, w: FloatArray) -> FloatArray:
            now, hold = here + x, replace(past.hold, ways=past.hold.ways + w)
            began = replace(past, seen=past.seen + b, hold=hold)
            deep = np.where(depth > 0, radius - np.linalg.norm(now, axis=2), 0.0)
            return ways_left(now, gripped(faces, now, deep, began, self._areas, radius, friction), self._areas)

        none = np.zeros(3)
        self._by_seen = _slopes(lambda x: left(x, none, none))
        self._by_before = _slopes(lambda b: left(none, b, none))
        self._by_ways = _slopes(lambda w: left(none, none, w))
        self._frozen = _slopes(lambda x: ways_left(here + x, self.grip, self._areas))
        self._costate, self._ways = costate, hold_of(model, positions, probe, self.grip).ways
        self._own = costate.reshape(-1, depth.shape[1], 3)[faces]

    def _at_points(self, field: FloatArray) -> FloatArray:
        """A field of the nodes (n, 3) at the points (g, p, 3)."""
        return np.asarray(np.einsum("qa,fai->fqi", self._model.face.shapes, field[self._model.topology.surface[self.grip.faces]]))

    def _on_nodes(self, costate: FloatArray) -> FloatArray:
        """Its transpose."""
        found = np.zeros_like(self._model.mesh.nodes)
        corners = self._model.topology.surface[self.grip.faces]
        np.add.at(found, corners, np.einsum("qa,fqi->fai", self._model.face.shapes, costate))
        return found

    def _pull(self, adjoint: FloatArray) -> FloatArray:
        """Costate (g, p, 3) of the ways left by an adjoint displacement (n, 3): of the force that goes with them."""
        return STICK_STIFFNESS * self._areas[..., None] * self._at_points(adjoint)

    def tangent(self, adjoint: FloatArray) -> FloatArray:
        """What the transposed tangent has beside the one of the kept grip, times an adjoint displacement (n, 3)."""
        return self._on_nodes(_pulled(self._by_seen - self._frozen, self._pull(adjoint)))

    @property
    def slope(self) -> FloatArray:
        """What the costate is by the displacements (n, 3)."""
        return self._on_nodes(_pulled(self._by_seen, self._own))

    def agreement(self, ways: FloatArray) -> float:
        """The costate times the ways (f p, 3) that another setup leaves beyond those left here."""
        return float(np.vdot(self._costate, ways - self._ways))

    def before(self, start: Equilibrium, adjoint: FloatArray) -> Begun:
        """Costates of the step's beginning, with the adjoint displacement (n, 3) of its end."""
        places = surface_spots(self._model.mesh, self._model.face).places[self.grip.faces].reshape(-1, 3)
        total = self._own - self._pull(adjoint)
        seen, held = (_pulled(slopes, total).reshape(-1, 3) for slopes in (self._by_before, self._by_ways))
        displacement = np.zeros_like(start.displacement)
        nodes, weights = start.mesh.locate(places)
        np.add.at(displacement, nodes, weights[..., None] * seen[:, None])
        return Begun(displacement, (start.hold or Hold.nothing()).at_transposed(places, held), -seen.sum(axis=0))
