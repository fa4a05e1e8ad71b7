"""Rigid, frictionless spheres against the surfaces of many bodies at once: `core.fem.contact` as tensors.

b bodies, each with its own sphere; f sides of k nodes with p points. Every point is asked: a few thousand cost less than choosing.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from core.batch.stack import Stack
from core.fem.model import CONTACT_STIFFNESS

__all__ = ["Balls", "Skin", "Touch", "energy", "forces", "matrices", "touch"]


@dataclass(frozen=True, eq=False)
class Balls(Stack):
    """The tools: centres (b, 3) and radii (b, 1, 1) [m], each in its body's frame."""

    centres: Tensor
    radii: Tensor


@dataclass(frozen=True, eq=False)
class Skin:
    """What all bodies' surfaces share: nodes (f, k) of the sides, shape functions (p, k) and their gradients (p, k, 2)."""

    faces: Tensor
    shapes: Tensor
    gradients: Tensor


@dataclass(frozen=True, eq=False)
class Touch(Stack):
    """Where surfaces lie inside the balls: gap (b, f, p) [m], zero where none does, and the direction (b, f, p, 3) opening it."""

    gap: Tensor
    direction: Tensor

    @property
    def penetration(self) -> Tensor:
        """The deepest (b,) [m]."""
        return -self.gap.flatten(1).amin(dim=1)


def touch(skin: Skin, balls: Balls, positions: Tensor) -> Touch:
    """At these positions (b, n, 3) [m]. A point only counts when its outward normal faces the ball's centre."""
    sides = positions[:, skin.faces]
    arm = skin.shapes @ sides - balls.centres[:, None, None]
    normal = torch.linalg.cross(skin.gradients[:, :, 0] @ sides, skin.gradients[:, :, 1] @ sides)
    distance = torch.linalg.vector_norm(arm, dim=-1)
    met = (distance < balls.radii) & ((normal * arm).sum(dim=-1) < 0) & (distance >= 1e-9)
    gap = torch.where(met, distance - balls.radii, 0.0)
    return Touch(gap, arm / distance.clamp(min=1e-9).unsqueeze(-1))


def energy(areas: Tensor, state: Touch) -> Tensor:
    """Penalty over E (b,) [m^3]; `areas` (b, f, p) as in `BlockModel`."""
    return 0.5 * CONTACT_STIFFNESS * (areas * state.gap.square()).sum(dim=(1, 2))


def forces(skin: Skin, areas: Tensor, state: Touch) -> tuple[Tensor, Tensor]:
    """The penalty's gradient over E at the sides' nodes (b, f, k, 3), and the push on the bodies (b, 3) [m^2]."""
    points = (CONTACT_STIFFNESS * areas * state.gap).unsqueeze(-1) * state.direction
    return skin.shapes.mT @ points, -points.sum(dim=(1, 2))


def matrices(skin: Skin, areas: Tensor, balls: Balls, state: Touch, bending: Tensor) -> Tensor:
    """The penalty's tangent over E (b, f, 3 k, 3 k) [m]; `bending` (b, 1, 1) in {0, 1} keeps the part from the balls' curvature."""
    weight = torch.where(state.gap < 0, CONTACT_STIFFNESS * areas, 0.0)
    bend = bending * state.gap / (state.gap + balls.radii)
    nodes = skin.shapes.shape[1]
    opened = (skin.shapes.unsqueeze(-1) * state.direction.unsqueeze(-2)).flatten(-2)
    found = ((weight * (1.0 - bend)).unsqueeze(-1) * opened).mT @ opened
    straight = skin.shapes.mT @ ((weight * bend).unsqueeze(-1) * skin.shapes)
    blocks = found.unflatten(3, (nodes, 3)).unflatten(2, (nodes, 3))
    blocks.diagonal(dim1=3, dim2=5).add_(straight.unsqueeze(-1))
    return found
