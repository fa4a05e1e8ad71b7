"""Elastic extension of a correction from some points of a body to all others, linearised at rest.

A network over the top does not correct the points below. Its correction is prescribed as a
displacement d_t, and all other points move to where no force acts on them:

    K_ff d_f + K_ft d_t = 0

with K the tangent stiffness of the body at rest on an even mesh. It is solved once; each
correction then costs one matrix product.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from palpate.fem.model import BlockModel
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import CorrectionError
from palpate.foundation.threads import on_one_thread
from palpate.mesh.protocol import Mesh
from palpate.setup.setup import Setup

__all__ = ["ElasticExtension"]


class ElasticExtension:
    """Computes the displacements of all nodes of a mesh from those of some.

    Args:
        setup: gives material and support.
        mesh: fills the body.
        driven: (k,) numbers of the nodes with a prescribed displacement; base nodes stay fixed.
    """

    def __init__(self, setup: Setup, mesh: Mesh, driven: IntArray) -> None:
        model = BlockModel(setup, mesh)
        free, unknown = model.topology.free, model.topology.unknown
        moved = np.intersect1d(driven, np.flatnonzero(free.all(axis=1)))
        rest = np.setdiff1d(np.flatnonzero(free.all(axis=1)), moved)
        if not len(moved):
            raise CorrectionError(
                "no corrected point can move: all are fixed at the base", key="driven"
            )
        self.mesh, self.driven, self._rest = mesh, moved, rest
        self._response = _response(_tangent(model), unknown[rest].ravel(), unknown[moved].ravel())

    def __call__(self, displacement: FloatArray) -> FloatArray:
        """Return displacements (n, 3) [m] of all nodes; only those of driven nodes are read."""
        extended = np.zeros_like(displacement, dtype=float)
        extended[self.driven] = displacement[self.driven]
        extended[self._rest] = (self._response @ extended[self.driven].ravel()).reshape(-1, 3)
        return extended


def _tangent(model: BlockModel) -> sp.csc_matrix:
    """Return the tangent stiffness at rest over Young's modulus (u, u) [m]."""
    pattern = model.topology.pattern
    upper = sp.csr_matrix(
        (model.assemble(model.mesh.nodes, None).data, pattern.indices, pattern.indptr),
        shape=pattern.shape,
    )
    return sp.csc_matrix(upper + sp.triu(upper, 1).T)


@on_one_thread
def _response(tangent: sp.csc_matrix, follows: IntArray, moved: IntArray) -> FloatArray:
    if not len(follows):
        return np.zeros((0, len(moved)))
    columns = tangent[:, moved]
    return np.asarray(
        -splu(sp.csc_matrix(tangent[:, follows][follows])).solve(columns[follows].toarray())
    )
