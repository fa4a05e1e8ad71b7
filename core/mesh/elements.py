"""Reference elements: shape functions, quadrature, and pressures that avoid volumetric locking.

The volumetric energy depends on the volume change J only through its projection on a few
polynomials per element: a constant for trilinear hexahedra (mean dilatation: Nagtegaal, Parks and
Rice 1974), and for quadratic elements as many as keep the pair stable (Q2/P1 and P2/P0: Sussman and
Bathe 1987; Boffi, Brezzi and Fortin 2013, ch. 8). Measured for tetrahedra by the test of Chapelle
and Bathe (1993) on a cube clamped all round, 191 to 805 of Gmsh's elements: the inf-sup constant of
P2/P0 stays at 0.04 to 0.08, whereas 40 to 50 % of P2/P1's pressures, four per element, are
spurious. The cost: a pressure that changes within an element is not resisted, so that a beam two
elements high bends 4 to 6 % too far, and one of four elements 1 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import Any

import numpy as np
from numba import njit

from palpate.foundation.arrays import FloatArray

LANES = 4
"""Double-precision numbers in a vector register of the processor."""
_DENSE = 8
"""Quadrature points along each edge of a hexahedron's dense side: no two neighbours are further
apart than a fifth of the edge."""

__all__ = [
    "EDGES",
    "HEX8",
    "HEX27",
    "HEXAHEDRA",
    "LANES",
    "TET10",
    "Element",
    "Face",
    "Quadrature",
    "face_weights",
    "quadratic_gradients",
    "quadrature",
    "shapes_of",
]

EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
"""Corner pairs of a tetrahedron between which its nodes 4 to 9 lie; the first three are those of a
triangle, for its nodes 3 to 5."""


@dataclass(frozen=True, eq=False)
class Face:
    """A side of an element.

    Attributes:
        shapes: (p, b) shape functions at the quadrature points.
        gradients: (p, b, 2) their gradients.
        weights: (p,).
    """

    shapes: FloatArray
    gradients: FloatArray
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class Element:
    """A reference element.

    A hexahedron's local node numbers grow along x, then y, then z; a tetrahedron's corners come
    before the midpoints of its EDGES.

    Attributes:
        shapes: (q, a) shape functions at the quadrature points.
        gradients: (q, a, 3) their gradients.
        weights: (q,).
        pressures: (q, m) polynomials.
        face: its side.
        dense_face: its side with quadrature points so close that no realistic tool fits between
            them.
    """

    shapes: FloatArray
    gradients: FloatArray
    weights: FloatArray
    pressures: FloatArray
    face: Face
    dense_face: Face


@dataclass(frozen=True, eq=False)
class Quadrature:
    """Quadrature of a mesh at rest.

    Attributes:
        slopes: (e, q, 3, w) gradients of the nodes' shape functions [1/m], one row for each axis,
            padded with zeros to whole vectors of LANES numbers; a loop over the nodes is twice as
            fast so.
        weights: (e, q) [m^3].
        pressures: (e, q, m), orthonormal.
        places: (e, q, 3) [m].
        nodes: number of nodes of an element.
    """

    slopes: FloatArray
    weights: FloatArray
    pressures: FloatArray
    places: FloatArray
    nodes: int

    @cached_property
    def gradients(self) -> FloatArray:
        """Gradients of the shape functions (e, q, a, 3) [1/m], without the padding."""
        return np.ascontiguousarray(self.slopes[..., : self.nodes].swapaxes(2, 3))

    @cached_property
    def edges(self) -> FloatArray:
        """Edge length of the volume that each point represents (e, q) [m]."""
        return np.asarray(np.cbrt(self.weights))


def _lagrange(order: int, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values and derivatives (p, order + 1) of the Lagrange polynomials on [-1, 1] at
    points (p,).
    """
    if order == 1:
        return np.stack([(1 - at) / 2, (1 + at) / 2], axis=1), np.tile([-0.5, 0.5], (len(at), 1))
    values = np.stack([at * (at - 1) / 2, 1 - at**2, at * (at + 1) / 2], axis=1)
    return values, np.stack([at - 0.5, -2 * at, at + 0.5], axis=1)


def _square(order: int, count: int) -> Face:
    """Make a tensor-product side; node numbers grow along its rows, then across them."""
    places, weights = np.polynomial.legendre.leggauss(count)
    s, t = (part.ravel() for part in np.meshgrid(places, places, indexing="ij"))
    (along, d_along), (across, d_across) = _lagrange(order, s), _lagrange(order, t)
    shapes = np.einsum("pj,pi->pji", across, along).reshape(len(s), -1)
    gradients = np.stack(
        [
            np.einsum("pj,pi->pji", across, d_along).reshape(len(s), -1),
            np.einsum("pj,pi->pji", d_across, along).reshape(len(s), -1),
        ],
        axis=2,
    )
    return Face(
        np.ascontiguousarray(shapes),
        np.ascontiguousarray(gradients),
        np.outer(weights, weights).ravel(),
    )


def _hexahedron(order: int, count: int, linear_pressure: bool, faces: tuple[Face, Face]) -> Element:
    """Make a tensor-product hexahedron with count^3 Gauss points.

    Node and point numbers grow along x, then y, then z.
    """
    places, weights = np.polynomial.legendre.leggauss(count)
    z, y, x = (part.ravel() for part in np.meshgrid(places, places, places, indexing="ij"))
    (fx, dx), (fy, dy), (fz, dz) = _lagrange(order, x), _lagrange(order, y), _lagrange(order, z)
    parts = [(dx, fy, fz), (fx, dy, fz), (fx, fy, dz)]
    gradients = np.stack(
        [np.einsum("pk,pj,pi->pkji", c, b, a).reshape(len(x), -1) for a, b, c in parts], axis=2
    )
    shapes = np.einsum("pk,pj,pi->pkji", fz, fy, fx).reshape(len(x), -1)
    pressures = np.stack(
        [np.ones_like(x), x, y, z] if linear_pressure else [np.ones_like(x)], axis=1
    )
    volumes = np.einsum("k,j,i->kji", weights, weights, weights).ravel()
    return Element(shapes, np.ascontiguousarray(gradients), volumes, pressures, *faces)


HEX8 = _hexahedron(1, 2, False, (_square(1, 3), _square(1, _DENSE)))
HEX27 = _hexahedron(2, 3, True, (_square(2, 4), _square(2, _DENSE)))
HEXAHEDRA = {1: HEX8, 2: HEX27}
"""Hexahedra by the order of the shape functions."""


def shapes_of(shares: FloatArray) -> FloatArray:
    """Shape functions (p, 6) of a triangle or (p, 10) of a tetrahedron.

    Args:
        shares: (p, 3) or (p, 4) barycentric coordinates.
    """
    edges = EDGES[: 3 if shares.shape[1] == 3 else 6]
    return np.concatenate(
        [shares * (2 * shares - 1), *(4 * shares[:, [a]] * shares[:, [b]] for a, b in edges)],
        axis=1,
    )


def quadratic_gradients(shares: FloatArray) -> FloatArray:
    """Gradients (p, a, d) of the same by the barycentric coordinates after the first.

    These coordinates span the reference element.
    """
    count = shares.shape[1]
    slopes = np.concatenate([-np.ones((1, count - 1)), np.eye(count - 1)])
    corners = (4 * shares - 1)[:, :, None] * slopes
    edges = EDGES[: 3 if count == 3 else 6]
    middles = [
        4 * (shares[:, a, None] * slopes[b] + shares[:, b, None] * slopes[a]) for a, b in edges
    ]
    return np.ascontiguousarray(np.concatenate([corners, np.stack(middles, axis=1)], axis=1))


def _triangle(parts: int = 1) -> Face:
    """Make the side of a quadratic tetrahedron.

    It has Dunavant's (1985) twelve points, exact to degree six, in each of parts^2 triangles.
    """
    orbits = {
        (0.501426509658179, 0.249286745170910, 0.249286745170910): 0.116786275726379,
        (0.873821971016996, 0.063089014491502, 0.063089014491502): 0.050844906370207,
        (0.053145049844817, 0.310352451033784, 0.636502499121399): 0.082851075618374,
    }
    points = [
        (point, weight)
        for orbit, weight in orbits.items()
        for point in sorted(set(permutations(orbit)))
    ]
    shares, weights = (
        np.array([point for point, _ in points]),
        np.array([weight for _, weight in points]),
    )
    shares = np.concatenate([shares @ corners for corners in _split(parts)])
    return Face(
        shapes_of(shares), quadratic_gradients(shares), np.tile(weights, parts**2) / (2 * parts**2)
    )


def _split(parts: int) -> list[FloatArray]:
    """Barycentric coordinates (3, 3) of the corners of each of parts^2 equal triangles that fill
    one.
    """
    result = []
    for i in range(parts):
        for j in range(parts - i):
            result.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j < parts - 1:
                result.append([(i + 1, j + 1), (i, j + 1), (i + 1, j)])
    return [np.array([(parts - i - j, i, j) for i, j in corners]) / parts for corners in result]


def _tetrahedron(face: Face, dense_face: Face) -> Element:
    """Make a quadratic tetrahedron with four points, exact to degree two.

    That is enough for elements with straight edges at small strain.
    """
    far = (5 + 3 * np.sqrt(5)) / 20
    shares = np.full((4, 4), (1 - far) / 3) + (far - (1 - far) / 3) * np.eye(4)
    return Element(
        shapes_of(shares),
        quadratic_gradients(shares),
        np.full(4, 1 / 24),
        np.ones((4, 1)),
        face,
        dense_face,
    )


TET10 = _tetrahedron(_triangle(), _triangle(3))


def quadrature(element: Element, corners: FloatArray) -> Quadrature:
    """Compute the quadrature of elements with these nodes.

    Args:
        element: reference element.
        corners: (e, a, 3) nodes [m].
    """
    points, nodes = element.shapes.shape
    # Matrix products are 3.5 times as fast as einsum; this runs in every frame with a new mesh.
    flat = element.gradients.transpose(0, 2, 1).reshape(-1, nodes) @ corners.transpose(
        1, 0, 2
    ).reshape(nodes, -1)
    jacobian = np.ascontiguousarray(flat.reshape(points, 3, len(corners), 3).transpose(2, 0, 1, 3))
    slopes, volumes = _mapped_gradients(
        element.gradients, jacobian, (nodes + LANES - 1) // LANES * LANES
    )
    weights = volumes * element.weights
    roots = np.sqrt(weights)[:, :, None]
    pressures = np.linalg.qr(roots * element.pressures)[0] / roots
    places = element.shapes @ corners
    return Quadrature(
        slopes, np.ascontiguousarray(weights), np.ascontiguousarray(pressures), places, nodes
    )


@njit(cache=True)
def _mapped_gradients(gradients: Any, jacobians: Any, wide: int) -> tuple[Any, Any]:
    """Gradients of the shape functions of elements, and the determinants of their Jacobians.

    LAPACK's inverses and determinants of 3 x 3 matrices, one by one, take five times as long.

    Args:
        gradients: (q, a, 3) of the reference element.
        jacobians: (e, q, 3, 3) with the reference's axes as rows.
        wide: number of columns, the nodes and zeros after them.

    Returns:
        (e, q, 3, wide) [1/m], and (e, q) determinants.
    """
    elements, points, nodes = jacobians.shape[0], gradients.shape[0], gradients.shape[1]
    result, volumes = np.zeros((elements, points, 3, wide)), np.empty((elements, points))
    crossed = np.empty((3, 3))
    for e in range(elements):
        for q in range(points):
            j = jacobians[e, q]
            for r in range(3):
                s, t = (r + 1) % 3, (r + 2) % 3
                crossed[r, 0] = j[s, 1] * j[t, 2] - j[s, 2] * j[t, 1]
                crossed[r, 1] = j[s, 2] * j[t, 0] - j[s, 0] * j[t, 2]
                crossed[r, 2] = j[s, 0] * j[t, 1] - j[s, 1] * j[t, 0]
            volume = j[0, 0] * crossed[0, 0] + j[0, 1] * crossed[0, 1] + j[0, 2] * crossed[0, 2]
            volumes[e, q] = volume
            for a in range(nodes):
                along, across, up = (
                    gradients[q, a, 0] / volume,
                    gradients[q, a, 1] / volume,
                    gradients[q, a, 2] / volume,
                )
                for i in range(3):
                    result[e, q, i, a] = (
                        along * crossed[0, i] + across * crossed[1, i] + up * crossed[2, i]
                    )
    return result, volumes


def face_weights(face: Face, corners: FloatArray) -> FloatArray:
    """Rest area [m^2] at the quadrature points (f, p) of sides with these nodes (f, b, 3) [m]."""
    tangents = np.einsum("qac,fai->fqci", face.gradients, corners)
    area = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=2)
    return np.asarray(area * face.weights)
