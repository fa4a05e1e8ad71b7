"""Elastic energy, forces and tangents of many bodies at once: `core.fem.hyperelastic` and `core.fem.fibres` as tensors.

All bodies share their elements' numbering and nothing else: b bodies, e elements of a nodes with q points and m pressures.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from core.batch.stack import Stack

__all__ = ["Bodies", "Strain", "energy", "forces", "matrices", "strain"]


@dataclass(frozen=True, eq=False)
class Bodies(Stack):
    """What the bodies are made of.

    Attributes:
        gradients: (b, e, a, q, 3) of the shape functions [1/m]. weights: (b, e, q) [m^3]. pressures: (b, e, q, m), orthonormal.
        mu, bulk: (b, e, q) over E [1]. stiffening: (b, 1, 1) 1 / J_m of Gent's law, zero without [1].
        fibre: (b, e, q) stiffness over E [1]. direction: (b, 3) along the fibres.
    """

    gradients: Tensor
    weights: Tensor
    pressures: Tensor
    mu: Tensor
    bulk: Tensor
    stiffening: Tensor
    fibre: Tensor
    direction: Tensor


@dataclass(frozen=True, eq=False)
class Strain(Stack):
    """How bodies are deformed: F and its cofactors (b, e, 3, q, 3), det F, |F|^2 and the projected volume change (b, e, q), and
    along the fibres each node's gradient (b, e, a, q) [1/m] and F a (b, e, 3, q)."""

    deformation: Tensor
    cofactors: Tensor
    det: Tensor
    square: Tensor
    theta: Tensor
    along: Tensor
    turned: Tensor

    @property
    def stretch(self) -> Tensor:
        """|F a|^2 - 1 of the fibres (b, e, q)."""
        return self.turned.square().sum(dim=2) - 1.0

    @property
    def isochoric(self) -> Tensor:
        """J^(-2/3) |F|^2 - 3 (b, e, q); nan where the element is inverted."""
        return self.square * self.det.pow(-2 / 3) - 3.0


def _project(bodies: Bodies, values: Tensor) -> Tensor:
    """The part of `values` (b, e, q) that the elements' pressures can follow."""
    shares = bodies.pressures.mT @ (bodies.weights * values).unsqueeze(-1)
    return (bodies.pressures @ shares).squeeze(-1)


def strain(bodies: Bodies, corners: Tensor) -> Strain:
    """Of elements whose nodes are at `corners` (b, e, a, 3) [m]."""
    points = bodies.weights.shape[2]
    deformation = (corners.mT @ bodies.gradients.flatten(3)).unflatten(3, (points, 3))
    rows = deformation.unbind(dim=2)
    cofactors = torch.stack([torch.linalg.cross(rows[i - 2], rows[i - 1]) for i in range(3)], dim=2)
    det = (rows[0] * cofactors[:, :, 0]).sum(dim=-1)
    along = (bodies.gradients @ bodies.direction[:, None, None, :, None]).squeeze(-1)
    return Strain(
        deformation, cofactors, det, deformation.square().sum(dim=(2, 4)), _project(bodies, det), along, corners.mT @ along
    )  # fmt: skip


def energy(bodies: Bodies, state: Strain) -> Tensor:
    """Over E (b,) [m^3]; infinite where an element is inverted or stretched to its limit at a quadrature point."""
    stiffening, isochoric, theta = bodies.stiffening, state.isochoric, state.theta
    hard = stiffening > 0
    left = 1.0 - stiffening * isochoric
    shear = torch.where(hard, -left.log() / torch.where(hard, stiffening, 1.0), isochoric)
    volume = theta.square() - 1.0 - 2.0 * theta.log()
    density = 0.5 * bodies.mu * shear + 0.25 * bodies.bulk * volume + 0.5 * bodies.fibre * state.stretch.square()
    possible = ((state.det > 0) & (theta > 0) & (left > 0)).flatten(1).all(dim=1)
    return torch.where(possible, (bodies.weights * density).sum(dim=(1, 2)), torch.inf)


def _scales(bodies: Bodies, state: Strain) -> tuple[Tensor, Tensor, Tensor]:
    """Factors (b, e, q) of F and of cof(F) in the stress times the weight [m^3], and how fast the former hardens."""
    root = state.det.pow(2 / 3)
    harder = 1.0 / (1.0 - bodies.stiffening * state.isochoric)
    scale = bodies.weights * bodies.mu / root * harder
    pressure = _project(bodies, 0.5 * bodies.bulk * (state.theta - 1.0 / state.theta))
    press = bodies.weights * pressure - scale * state.square / (3.0 * state.det)
    return scale, press, 2.0 * scale * bodies.stiffening * harder / root


def forces(bodies: Bodies, state: Strain) -> Tensor:
    """The energy's gradient over E at the elements' nodes (b, e, a, 3) [m^2]. Elements must not be inverted."""
    scale, press, _ = _scales(bodies, state)
    stress = scale[:, :, None, :, None] * state.deformation + press[:, :, None, :, None] * state.cofactors
    pull = (2.0 * bodies.weights * bodies.fibre * state.stretch).unsqueeze(2) * state.turned
    return bodies.gradients.flatten(3) @ stress.flatten(3).mT + state.along @ pull.mT


def matrices(bodies: Bodies, state: Strain) -> Tensor:
    """The energy's tangent over E (b, e, 3 a, 3 a) [m]; formulas in `core.fem.hyperelastic`, point by point.

    With f = F g and c = cof(F) g of each node, a point's part in f and c is [f c] [[hard, mixed], [mixed, squared]] [f c]'.
    """
    scale, press, hard = _scales(bodies, state)
    det, square = state.det, state.square
    deviation, crossed = square / (3.0 * det), press / det
    mixed = -2.0 / 3.0 * scale / det - hard * deviation
    squared = 5.0 / 9.0 * scale * square / det.square() + crossed + hard * deviation.square()
    turned, closed = (_images(bodies.gradients, tensor) for tensor in (state.deformation, state.cofactors))
    fibre = bodies.weights * bodies.fibre
    pulled = (state.along.unsqueeze(3) * state.turned.unsqueeze(2)).flatten(2, 3)

    def times(factor: Tensor, image: Tensor) -> Tensor:
        return factor.unsqueeze(2) * image

    left = [times(hard, turned) + times(mixed, closed), times(mixed, turned) + times(squared, closed), times(4.0 * fibre, pulled)]
    found = torch.cat(left, dim=3) @ torch.cat([turned, closed, pulled], dim=3).mT
    nodes = bodies.gradients.shape[2]
    blocks = found.unflatten(3, (nodes, 3)).unflatten(2, (nodes, 3))
    blocks -= (times(crossed, closed) @ closed.mT).unflatten(3, (nodes, 3)).unflatten(2, (nodes, 3)).transpose(3, 5)
    scaled = (scale[:, :, None, :, None] * bodies.gradients).flatten(3)
    straight = scaled @ bodies.gradients.flatten(3).mT + times(2.0 * fibre * state.stretch, state.along) @ state.along.mT
    blocks.diagonal(dim1=3, dim2=5).add_(straight.unsqueeze(-1))
    return found + _by_volume(bodies, state, closed)


def _images(gradients: Tensor, tensor: Tensor) -> Tensor:
    """A g of each node's gradient g for A (b, e, 3, q, 3): (b, e, 3 a, q)."""
    return torch.einsum("beaqj,beiqj->beaiq", gradients, tensor).flatten(2, 3)


def _by_volume(bodies: Bodies, state: Strain, closed: Tensor) -> Tensor:
    """What the pressures' own change brings (b, e, 3 a, 3 a)."""
    curvature = 0.5 * bodies.bulk * (1.0 + 1.0 / state.theta.square())
    change = closed @ (bodies.weights.unsqueeze(-1) * bodies.pressures)
    stiffness = bodies.pressures.mT @ ((bodies.weights * curvature).unsqueeze(-1) * bodies.pressures)
    return change @ stiffness @ change.mT
