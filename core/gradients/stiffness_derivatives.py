"""First-order changes of a frame with the stiffness of any part of the body.

Many parts cost one assembly.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from palpate.fem.constitutive.elastic import assemble_elastic
from palpate.fem.model import BlockModel
from palpate.foundation.arrays import FloatArray
from palpate.gradients.compliant_tool import CompliantTool
from palpate.gradients.frame_tangent import factorise_at
from palpate.gradients.setup_change import is_compliant, require_history_free
from palpate.replay.replay import Equilibrium, Replay

__all__ = ["point_forces", "stiffness_changes"]


def stiffness_changes(block: Replay, frame: Equilibrium, log_factors: FloatArray) -> FloatArray:
    """Displacements that small changes of the stiffness within the body bring about, to first
    order.

    The cost grows slowly with m: a point's share of the residual is the force that its stiffness
    alone resists with.

    Args:
        block: the replay that made the frame.
        frame: an equilibrium.
        log_factors: (m, e, q) logarithm of new over old stiffness, at the quadrature points of the
            frame's mesh.

    Returns:
        (m, n, 3) [m], to five digits.
    """
    require_history_free(block.setup)
    result = np.zeros((len(log_factors), *frame.displacement.shape))
    model = factorise_at(block, frame) if frame.in_contact else None
    if model is None:
        return result
    forces = point_forces(model, frame.mesh.nodes + frame.displacement)
    elements, points = model.mu.shape
    unknown = np.repeat(
        model.topology.unknown[model.topology.elements].reshape(elements, 1, -1), points, axis=1
    )
    used = unknown >= 0
    column = np.broadcast_to(
        np.arange(elements * points).reshape(elements, points, 1), unknown.shape
    )
    shape = (int(model.topology.unknown.max()) + 1, elements * points)
    gather = sp.csr_matrix(
        (forces.reshape(unknown.shape)[used], (unknown[used], column[used])), shape=shape
    )
    right = gather @ sp.csc_matrix(log_factors.reshape(len(log_factors), -1).T)
    free = -model.topology.factor.approximate(right.toarray())
    if is_compliant(block.setup):
        free = CompliantTool(block, frame, model).moved(
            [(block.setup, np.zeros(3))] * len(log_factors), free
        )
    result[:, model.topology.free] = free.T
    return result


def point_forces(model: BlockModel, positions: FloatArray) -> FloatArray:
    """Internal forces over E that the stiffness at each quadrature point puts on its element's
    nodes.

    Forces are linear in the stiffness, so each point's are those of a body without stiffness
    elsewhere.

    Args:
        model: the body.
        positions: (n, 3) [m].

    Returns:
        (e, q, a, 3) [m^2].
    """
    elements, points = model.mu.shape
    corners = model.topology.elements.shape[1]
    apart = np.arange(corners * elements).reshape(elements, corners)
    where = positions[model.topology.elements].reshape(-1, 3)
    forces = np.empty((elements, points, corners, 3))
    for point in range(points):
        mu, bulk, force = (
            np.zeros_like(model.mu),
            np.zeros_like(model.bulk),
            np.zeros((corners * elements, 3)),
        )
        mu[:, point], bulk[:, point] = model.mu[:, point], model.bulk[:, point]
        assemble_elastic(
            model.law,
            model.rule,
            apart,
            mu,
            bulk,
            where,
            np.empty((0, 0, 0), np.int32),
            force,
            np.empty(0),
        )
        forces[:, point] = force.reshape(elements, corners, 3)
    return forces
