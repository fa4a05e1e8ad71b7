"""Coulomb friction between tool and surface, by a return mapping at the contact's quadrature
points.

A touched point sticks to an anchor that travels with the tool. Its tangential traction is k_t d,
with d the tangential distance from the anchor, as long as that is below mu p, with p the contact
pressure; beyond, the anchor is dragged along (Simo and Laursen 1992; Wriggers 2006, ch. 5).
Pressure and normals are constant during each solve and updated after it, until nothing changes: so
each solve minimises an energy, as it does without friction (Tresca friction as a fixed point:
Haslinger 1983).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.elements import Face

__all__ = ["STICK_STIFFNESS", "FrictionHistory", "FrictionPotential"]

STICK_STIFFNESS = 5e4
"""Tangential traction over E per distance from the anchor [1/m], times the surface's stiffness over
E."""
_NEIGHBOURS = 4


@dataclass(frozen=True, eq=False)
class FrictionPotential:
    """Friction potential during one solve, at the quadrature points (g, p) of the touching faces.

    Attributes:
        faces: (g,) numbers of the faces.
        anchors: (g, p, 3) relative to the tool's centre [m].
        normals: (g, p, 3) outward from the tool.
        limits: (g, p) largest tangential force over E [m^2].
        stiffness: (g, p) of the stick over E [m].
    """

    faces: IntArray
    anchors: FloatArray
    normals: FloatArray
    limits: FloatArray
    stiffness: FloatArray

    def of(self, faces: IntArray) -> Self:
        """The part of it on these faces (h,), numbered by their places among them."""
        number = np.full(int(max(faces.max(initial=0), self.faces.max(initial=0))) + 1, -1)
        number[faces] = np.arange(len(faces))
        own = number[self.faces] >= 0
        points = (self.anchors[own], self.normals[own], self.limits[own], self.stiffness[own])
        return type(self)(number[self.faces[own]], *points)

    def energy(
        self, surface: IntArray, face: Face, positions: FloatArray, centre: FloatArray
    ) -> float:
        """Energy over E [m^3].

        Args:
            surface: (f, b) nodes of all faces.
            face: quadrature of a face.
            positions: (n, 3) [m].
            centre: of the tool (3,) [m].
        """
        points = (self.anchors, self.normals, self.limits, self.stiffness)
        return float(_energy(surface[self.faces], face.shapes, *points, positions, centre))

    def assemble(
        self,
        surface: IntArray,
        face: Face,
        positions: FloatArray,
        centre: FloatArray,
        slots: IntArray,
        force: FloatArray,
        data: FloatArray,
        push: FloatArray,
    ) -> None:
        """Add the energy's gradient, tangent and resultant.

        Args:
            surface: (f, b) nodes of all faces.
            face: quadrature of a face.
            positions: (n, 3) [m].
            centre: of the tool (3,) [m].
            slots: (f, 3 b, 3 b) of all faces as in `assemble_elastic`.
            force: (n, 3) the gradient over E is added here [m^2].
            data: the tangent is added here [m]; empty leaves it out.
            push: (3,) the drag on the body is added here [m^2].
        """
        points = (self.anchors, self.normals, self.limits, self.stiffness)
        _assemble(
            surface[self.faces],
            face.shapes,
            *points,
            positions,
            centre,
            slots[self.faces],
            force,
            data,
            push,
        )


@dataclass(frozen=True, eq=False)
class FrictionHistory:
    """State of friction that one frame passes to the next; no touched points for a fresh start.

    Attributes:
        places: (m, 3) points of the surface at rest [m].
        ways: (m, 3) tangential distances from their anchors [m].
        touched: (m,) True for points in contact.
        limits: (m,) largest tangential traction over E [1].
    """

    places: FloatArray
    ways: FloatArray
    touched: np.ndarray[Any, np.dtype[np.bool_]]
    limits: FloatArray

    @classmethod
    def nothing(cls) -> Self:
        """The state before the first contact."""
        return cls(np.empty((0, 3)), np.empty((0, 3)), np.empty(0, dtype=bool), np.empty(0))

    def at(self, places: FloatArray) -> Self:
        """Interpolate the state at other points of the surface (..., 3) [m], as on a grid that
        moved.
        """
        shape = places.shape[:-1]
        if not self.touched.any():
            return type(self)(
                places, np.zeros_like(places), np.zeros(shape, dtype=bool), np.zeros(shape)
            )
        near, weights, touched = self._near(places.reshape(-1, 3))
        ways = np.einsum("mk,mki->mi", weights, self.ways[near])
        limits = np.einsum("mk,mk->m", weights, self.limits[near])
        return type(self)(
            places, ways.reshape(places.shape), touched.reshape(shape), limits.reshape(shape)
        )

    def on(self, faces: IntArray) -> Self:
        """The part of it on these faces (g,); the points must be stored face by face."""
        return type(self)(
            self.places[faces], self.ways[faces], self.touched[faces], self.limits[faces]
        )

    def _near(
        self, places: FloatArray
    ) -> tuple[IntArray, FloatArray, np.ndarray[Any, np.dtype[np.bool_]]]:
        """Find the stored points next to each place (m, 3) [m].

        Returns:
            numbers (m, k), weights (m, k), zero if the nearest was not touched, and whether it was
                (m,).
        """
        distance, near = (
            np.asarray(part) for part in cKDTree(self.places).query(places, k=_NEIGHBOURS)
        )
        weights = 1 / (distance + 1e-9) ** 2
        touched = self.touched[near[:, 0]]
        return near, weights / weights.sum(axis=1, keepdims=True) * touched[:, None], touched


@njit(cache=True)
def _way(
    positions: Any, face: Any, shapes: Any, centre: Any, anchor: Any, normal: Any, way: Any
) -> float:
    """Fill the tangential distance from the anchor (3,) [m] and return its length."""
    along = 0.0
    for i in range(3):
        way[i] = -centre[i] - anchor[i]
        for a in range(face.shape[0]):
            way[i] += shapes[a] * positions[face[a], i]
        along += way[i] * normal[i]
    length = 0.0
    for i in range(3):
        way[i] -= along * normal[i]
        length += way[i] ** 2
    return np.sqrt(length)  # type: ignore[no-any-return]


@njit(cache=True)
def _energy(
    faces: Any,
    shapes: Any,
    anchors: Any,
    normals: Any,
    limits: Any,
    stiffness: Any,
    positions: Any,
    centre: Any,
) -> float:
    """Energy over E [m^3]: k/2 d^2 of sticking points, limit (d - limit / 2 k) of slipping ones."""
    way, total = np.empty(3), 0.0
    for f in range(faces.shape[0]):
        for q in range(shapes.shape[0]):
            limit, stick = limits[f, q], stiffness[f, q]
            if limit <= 0.0:
                continue
            length = _way(positions, faces[f], shapes[q], centre, anchors[f, q], normals[f, q], way)
            total += (
                0.5 * stick * length * length
                if stick * length <= limit
                else limit * (length - 0.5 * limit / stick)
            )
    return total


@njit(cache=True)
def _assemble(
    faces: Any,
    shapes: Any,
    anchors: Any,
    normals: Any,
    limits: Any,
    stiffness: Any,
    positions: Any,
    centre: Any,
    slots: Any,
    force: Any,
    data: Any,
    resultant: Any,
) -> None:
    """Kernel of `FrictionPotential.assemble`; the tangent is positive semidefinite."""
    way = np.empty(3)
    for f in range(faces.shape[0]):
        for q in range(shapes.shape[0]):
            limit, stick = limits[f, q], stiffness[f, q]
            if limit <= 0.0:
                continue
            length = _way(positions, faces[f], shapes[q], centre, anchors[f, q], normals[f, q], way)
            slips = stick * length > limit
            straight = limit / length if slips else stick
            for i in range(3):
                resultant[i] -= straight * way[i]
                for a in range(faces.shape[1]):
                    force[faces[f, a], i] += straight * way[i] * shapes[q, a]
            if data.shape[0] == 0:
                continue
            along = straight / length**2 if slips else 0.0
            for i in range(3):
                for j in range(3):
                    value = (
                        -straight * normals[f, q, i] * normals[f, q, j] - along * way[i] * way[j]
                    )
                    if i == j:
                        value += straight
                    for a in range(faces.shape[1]):
                        for b in range(faces.shape[1]):
                            slot = slots[f, 3 * a + i, 3 * b + j]
                            if slot >= 0:
                                data[slot] += value * shapes[q, a] * shapes[q, b]
