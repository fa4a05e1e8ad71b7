"""Quadrature of the elements of a mesh and of its free surface, cached by mesh."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from palpate.fem.constitutive.stiffness_field import SurfaceQuadrature
from palpate.mesh.elements import Face, Quadrature, face_weights, quadrature
from palpate.mesh.protocol import Mesh

__all__ = ["element_quadrature", "surface_quadrature"]


@lru_cache(maxsize=12)
def element_quadrature(mesh: Mesh) -> Quadrature:
    """Quadrature of the mesh's elements."""
    shared = mesh.connectivity
    return quadrature(shared.element, mesh.nodes[shared.elements])


@lru_cache(maxsize=12)
def surface_quadrature(mesh: Mesh, face: Face) -> SurfaceQuadrature:
    """Quadrature points of the free surface, by this rule for the elements' sides."""
    corners = mesh.nodes[mesh.connectivity.surface]
    return SurfaceQuadrature(
        np.einsum("qa,fai->fqi", face.shapes, corners), np.sqrt(face_weights(face, corners))
    )
