"""How a body follows where some of its points are moved: the elastic answer, linearised at rest.

A network that corrects the top says nothing of what lies below. Fed back, its correction is a
displacement prescribed to the simulation, and all other points take the places in which no force is
left on them:

    K_ff d_f + K_ft d_t = 0

with K the tangent of the block at rest on the corrected grid. Solved once, it is one product of a
matrix with each correction.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from palpate.fem.model import BlockModel
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import CorrectionError
from palpate.foundation.threads import on_one_thread
from palpate.mesh.box_mesh import BoxMesh
from palpate.setup.setup import Setup

__all__ = ["ElasticExtension"]


class ElasticExtension:
    """Displacements of all nodes of a grid from those of some.

    Args:
        setup: material and support.
        mesh: the grid of order 1.
        driven: (k,) nodes that are moved; base nodes stay held.
    """

    def __init__(self, setup: Setup, mesh: BoxMesh, driven: IntArray) -> None:
        model = BlockModel(setup, mesh)
        free, unknown = model.topology.free, model.topology.unknown
        moved = np.intersect1d(driven, np.flatnonzero(free.all(axis=1)))
        rest = np.setdiff1d(np.flatnonzero(free.all(axis=1)), moved)
        if not len(moved):
            raise CorrectionError(
                "no point that is corrected can move: all are held by the base", key="driven"
            )
        self.driven, self._rest = moved, rest
        self._answer = _answer(_tangent(model), unknown[rest].ravel(), unknown[moved].ravel())

    def __call__(self, displacement: FloatArray) -> FloatArray:
        """(n, 3) [m] of all nodes from (n, 3) [m], of which only the driven count."""
        found = np.zeros_like(displacement, dtype=float)
        found[self.driven] = displacement[self.driven]
        found[self._rest] = (self._answer @ found[self.driven].ravel()).reshape(-1, 3)
        return found


def _tangent(model: BlockModel) -> sp.csc_matrix:
    """At rest, over E (u, u) [m]."""
    pattern = model.topology.pattern
    upper = sp.csr_matrix(
        (model.assemble(model.mesh.nodes, None).data, pattern.indices, pattern.indptr),
        shape=pattern.shape,
    )
    return sp.csc_matrix(upper + sp.triu(upper, 1).T)


@on_one_thread
def _answer(tangent: sp.csc_matrix, follows: IntArray, moved: IntArray) -> FloatArray:
    if not len(follows):
        return np.zeros((0, len(moved)))
    columns = tangent[:, moved]
    return np.asarray(
        -splu(sp.csc_matrix(tangent[:, follows][follows])).solve(columns[follows].toarray())
    )
