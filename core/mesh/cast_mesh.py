"""Meshes of stated bodies, moved to what was really cast."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.linalg import cg

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import MeshError
from palpate.mesh.tet_mesh import TetMesh, sides_of, stretched
from palpate.setup.free_form.cast_modes import Coefficients, cast_modes
from palpate.setup.free_form.shape import Shape

if TYPE_CHECKING:
    from palpate.setup.setup import Setup

__all__ = ["as_built", "recast"]

_SETTLED = 1e-4
"""Relative residual at which the motion inside counts as harmonic [1]."""


def as_built(made: TetMesh, setup: Setup) -> TetMesh:
    """Return the mesh of the setup's body from that of the stated one."""
    built = _cast(made, setup.stated_shape, setup.cast) if setup.cast else made
    return built if setup.registered is None else stretched(built, setup.factors)


def recast(mesh: TetMesh, here: Setup, there: Setup) -> TetMesh:
    """Return a mesh of one setup's body with the cast of another, of the same size.

    Args:
        mesh: of `here`.
        here: its setup.
        there: the other one.
    """
    change = np.zeros(max(len(here.cast), len(there.cast)))
    change[: len(there.cast)] += there.cast
    change[: len(here.cast)] -= here.cast
    factors = tuple(float(factor) for factor in change)
    return _moved(mesh, here.stated_shape, factors, here.scale)


@lru_cache(maxsize=256)
def _cast(mesh: TetMesh, shape: Shape, coefficients: Coefficients) -> TetMesh:
    """Offset a mesh of a stated body; the same object for the same offset."""
    return _moved(mesh, shape, coefficients, np.ones(3))


def _moved(mesh: TetMesh, shape: Shape, coefficients: Coefficients, scale: FloatArray) -> TetMesh:
    """Move the free surface by an offset, and the inside harmonically, which keeps elements in
    shape; what is held stays.
    """
    sides = sides_of(mesh.tetrahedra)
    border, held = np.unique(sides), np.unique(sides[mesh.held])
    free = np.setdiff1d(border, held)
    motion = np.zeros_like(mesh.corners)
    motion[free] = scale * cast_modes(shape).motion(coefficients, mesh.corners[free] / scale)
    inside = np.setdiff1d(np.arange(len(motion)), border)
    if len(inside):
        stiffness = _laplacian(mesh)[inside]
        matrix, right = stiffness[:, inside], -(stiffness[:, border] @ motion[border])
        for axis in range(3):
            motion[inside, axis], unsettled = cg(matrix, right[:, axis], rtol=_SETTLED)
            if unsettled:
                raise MeshError(
                    f"{shape.name}: the inside did not follow the cast's surface within "
                    f"{unsettled} steps; its tetrahedra are too flat",
                    file=shape.name,
                )
    return mesh.with_corners(mesh.corners + motion)


@lru_cache(maxsize=32)
def _laplacian(mesh: TetMesh) -> csr_array:
    """Stiffness matrix (c, c) [m] of Laplace's equation with linear elements."""
    corners, count = mesh.corners[mesh.tetrahedra], len(mesh.corners)
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    slopes = np.linalg.inv(edges)
    slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
    entries = np.einsum("e,eai,ebi->eab", np.linalg.det(edges) / 6, slopes, slopes)
    rows = np.repeat(mesh.tetrahedra, 4, axis=1).ravel()
    columns = np.tile(mesh.tetrahedra, 4).ravel()
    return csr_array(coo_array((entries.ravel(), (rows, columns)), shape=(count, count)))
