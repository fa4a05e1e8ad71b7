"""Elastic energy density at each point of a body, for pictures of its inside."""

from __future__ import annotations

import numpy as np

from palpate.fem.model import BlockModel
from palpate.foundation.arrays import FloatArray

__all__ = ["energy_density", "nodal_density"]


def energy_density(model: BlockModel, positions: FloatArray) -> FloatArray:
    """Energy per rest volume over E (e, q) [1] at the quadrature points.

    Its sum with the quadrature weights is `elastic_energy`.

    Args:
        model: the body with its law, see `palpate.fem.constitutive.elastic`.
        positions: (n, 3) current node positions [m], with no element inverted.
    """
    law, rule, nodes = model.law, model.rule, model.topology.elements
    deformed = positions[nodes].swapaxes(1, 2)[:, None] @ rule.gradients
    if law.corotational:
        left, stretches, right = np.linalg.svd(deformed)
        turned = np.linalg.det(left @ right)  # a reflection has a negative smallest stretch
        stretches[..., -1] *= turned
        density = model.mu * np.sum((stretches - 1) ** 2, axis=-1)
        theta = _projected(model, stretches.sum(axis=-1) - 3)
        density = density + model.bulk / 2 * theta**2
    else:
        volume = np.linalg.det(deformed)
        strain = np.sum(deformed**2, axis=(-2, -1)) / np.cbrt(volume**2) - 3
        if law.stiffening:
            strain = -np.log(1 - law.stiffening * strain) / law.stiffening
        theta = _projected(model, volume)
        density = model.mu / 2 * strain + model.bulk / 4 * (theta**2 - 1 - 2 * np.log(theta))
    if law.gamma:
        square = np.sum((deformed @ law.direction) ** 2, axis=-1)
        density = density + law.gamma * model.mu / 2 * (square - 1) ** 2
    return np.asarray(density)


def _projected(model: BlockModel, values: FloatArray) -> FloatArray:
    """Projection of values (e, q) on the elements' pressures."""
    rule = model.rule
    share = np.einsum("eq,eqm,eq->em", rule.weights, rule.pressures, values)
    return np.asarray(np.einsum("eqm,em->eq", rule.pressures, share))


def nodal_density(model: BlockModel, positions: FloatArray) -> FloatArray:
    """Energy density at the nodes (n,) [1].

    It is the mean of the points around each, weighted by the square of its shape function.
    """
    top, rule = model.topology, model.rule
    total, weight, shares = (
        np.zeros(len(positions)),
        np.zeros(len(positions)),
        top.element.shapes**2,
    )
    np.add.at(total, top.elements, (rule.weights * energy_density(model, positions)) @ shares)
    np.add.at(weight, top.elements, rule.weights @ shares)
    return total / weight
