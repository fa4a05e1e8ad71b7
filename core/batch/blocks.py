"""The potentials of many blocks at once: `core.fem.model.BlockModel` as tensors, for blocks whose base is held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from core.batch import contact, elastic
from core.batch.contact import Balls, Skin
from core.batch.elastic import Bodies
from core.batch.slabs import Layout
from core.batch.stack import Stack
from core.fem.model import BlockModel, Probe
from core.frames import FloatArray

__all__ = ["Blocks", "Frame", "State", "balls_of", "blocks_of", "frame_of"]


@dataclass(frozen=True, eq=False)
class Frame:
    """What all blocks share: elements' nodes (e, a), which nodes are free (n, 1) (0 or 1), surface, and the matrices' layout."""

    elements: Tensor
    free: Tensor
    skin: Skin
    layout: Layout


@dataclass(frozen=True, eq=False)
class Loads(Stack):
    """Areas (b, f, p) as in `BlockModel`, rest positions (b, n, 3) [m], weight at the nodes over E (b, n) [m^2], rounding of the
    energy over E (b,) [m^3], and the force over E below which nothing matters (b,) [m^2]."""

    areas: Tensor
    rest: Tensor
    weight: Tensor
    rounding: Tensor
    least: Tensor


@dataclass(frozen=True, eq=False)
class State(Stack):
    """Residual (b, n, 3) and push of the tools on the blocks (b, 3), over E [m^2]; penetration (b,) [m]; relative misfit (b,)."""

    residual: Tensor
    push: Tensor
    penetration: Tensor
    misfit: Tensor


@dataclass(frozen=True, eq=False)
class Blocks:
    """b blocks on grids of one shape; node positions are (b, n, 3) [m]."""

    frame: Frame
    bodies: Bodies
    loads: Loads

    def pick(self, blocks: Tensor) -> Blocks:
        """Some of the blocks, by their numbers (c,)."""
        return Blocks(self.frame, self.bodies.pick(blocks), self.loads.pick(blocks))

    def energy(self, positions: Tensor, balls: Balls) -> Tensor:
        """Total potentials over E (b,) [m^3]; infinite where an element is inverted."""
        deformed = elastic.energy(self.bodies, elastic.strain(self.bodies, positions[:, self.frame.elements]))
        lifted = (self.loads.weight * (positions - self.loads.rest)[:, :, 2]).sum(dim=1)
        return deformed + lifted + contact.energy(self.loads.areas, contact.touch(self.frame.skin, balls, positions))

    def state(self, positions: Tensor, balls: Balls) -> State:
        """Forces that do not balance, and how much that is (`core.fem.newton.misfit`). No element may be inverted."""
        frame, skin = self.frame, self.frame.skin
        touched = contact.touch(skin, balls, positions)
        pressed, push = contact.forces(skin, self.loads.areas, touched)
        force = torch.zeros_like(positions)
        held = elastic.forces(self.bodies, elastic.strain(self.bodies, positions[:, frame.elements]))
        force.index_add_(1, frame.elements.ravel(), held.flatten(1, 2))
        force.index_add_(1, skin.faces.ravel(), pressed.flatten(1, 2))
        force[:, :, 2] += self.loads.weight
        residual = force * frame.free
        scale = torch.linalg.vector_norm(push, dim=1) + self.loads.weight.sum(dim=1) + self.loads.least
        return State(residual, push, touched.penetration, torch.linalg.vector_norm(residual.flatten(1), dim=1) / scale)

    def tangent(self, positions: Tensor, balls: Balls, bending: Tensor, dtype: torch.dtype) -> Tensor:
        """Entries (b, entries + 1) of the tangents over E [m], in a precision; `bending` (b,) as in `contact.matrices`."""
        skin = self.frame.skin
        deformed = elastic.strain(self.bodies, positions[:, self.frame.elements])
        touched = contact.touch(skin, balls, positions)
        pressed = contact.matrices(skin, self.loads.areas, balls, touched, bending[:, None, None])
        return self.frame.layout.collect(elastic.matrices(self.bodies.to(dtype), deformed.to(dtype)), pressed.to(dtype))


def frame_of(model: BlockModel, device: torch.device) -> Frame:
    """What this model shares with all others on grids of its shape."""
    top = model.topology
    face, free = top.element.face, top.free.all(axis=1, keepdims=True).astype(float)
    elements, surface, shapes, gradients, loose = (
        torch.as_tensor(array, device=device) for array in (top.elements, top.surface, face.shapes, face.gradients, free)
    )
    return Frame(elements, loose, Skin(surface, shapes, gradients), Layout(top, model.mesh.nodes, device))


def blocks_of(models: Sequence[BlockModel], frame: Frame) -> Blocks:
    """The models as tensors on the frame's device; what several of them share goes there once."""
    device = frame.free.device
    rules = list({id(model.rule): model.rule for model in models}.values())
    which = torch.tensor([next(i for i, rule in enumerate(rules) if rule is model.rule) for model in models], device=device)

    def shared(name: str) -> Tensor:
        return torch.as_tensor(np.stack([getattr(rule, name) for rule in rules]), device=device)[which]

    def own(values: Sequence[FloatArray | float]) -> Tensor:
        return torch.as_tensor(np.stack(values), dtype=torch.float64, device=device)

    bodies = Bodies(
        gradients=shared("gradients").transpose(2, 3).contiguous(),
        weights=shared("weights"),
        pressures=shared("pressures"),
        mu=own([model.mu for model in models]),
        bulk=own([model.bulk for model in models]),
        stiffening=own([model.law.stiffening for model in models])[:, None, None],
        fibre=own([model.law.gamma * model.mu for model in models]),
        direction=own([model.law.direction for model in models]),
    )
    size = [model.setup.geometry.size for model in models]
    loads = Loads(
        areas=own([model.areas for model in models]),
        rest=own([model.mesh.nodes for model in models]),
        weight=own([model.weight_force for model in models]),
        rounding=own([model.rounding for model in models]),
        least=own([1e-5 * x * y for x, y, _ in size]),
    )
    return Blocks(frame, bodies, loads)


def balls_of(probes: Sequence[Probe], device: torch.device) -> Balls:
    """The tools as tensors."""
    centres = torch.as_tensor(np.stack([probe.centre for probe in probes]), dtype=torch.float64, device=device)
    radii = torch.as_tensor([probe.radius for probe in probes], dtype=torch.float64, device=device)
    return Balls(centres, radii[:, None, None])
