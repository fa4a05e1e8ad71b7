"""How far a corrected surface is from what was measured, as a loss with gradients.

The Chamfer distance of Wu, Kazanzides and Unberath (2020) runs one way, from each measured point to
the nearest vertex of the surface super-sampled three-fold, because of what the camera does not see
there are no points. Nearest neighbours are exact: a k-d tree of SciPy on a processor, all distances
on a CUDA device. They are constants of a step, so that the gradient is that of the distance to the
vertex found.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, get_args

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor

from palpate.correction.samples.corrected_points import Body
from palpate.correction.samples.sample_store import Batch
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import CorrectionError

__all__ = ["Distance", "Loss", "SurfaceLoss", "hold_weights", "nearest"]

Distance = Literal["chamfer", "symmetric", "hausdorff"]
_LEAST = 1e-8
"""Added to distances in square [m], whose root has no gradient at zero."""
_ROOM = 2**26
"""Distances that are held at a time on a CUDA device."""
_DENSE = 2**20
"""Weights of a surface up to which a product with all of them is faster than picking its
corners."""
_SCARCE = 0.1
"""Share of the best seen material point's number of measured points, at which one is held half."""


@dataclass(frozen=True, eq=False)
class Loss:
    """Of a batch: what is minimised [mm], and its parts: distance [mm], and correction of what is
    hidden [mm^2].
    """

    total: Tensor
    distance: Tensor
    hidden: Tensor


def hold_weights(seen: FloatArray) -> FloatArray:
    """How much each material point (v,) is to stay where the simulation has it [0..1], by the
    measured points near it (v,).
    """
    best = float(seen.max(initial=0.0))
    return (
        np.ones_like(seen)
        if best == 0.0
        else np.asarray(1.0 / (1.0 + (seen / (_SCARCE * best)) ** 4))
    )


class SurfaceLoss:
    """The distance of clouds to the surface of a body, and what holds its hidden points near the
    simulation.

    Args:
        body: whose surface.
        seen: (v,) measured points near each of its material points, see `Samples.seen`.
        distance: one-directional Chamfer (points to surface), symmetric (and what is seen of the
            surface to the points), or Hausdorff's (the largest of both).
        hold: weight of the hidden points' squared correction [1/mm].
        device: of batches.
    """

    def __init__(
        self,
        body: Body,
        seen: FloatArray,
        *,
        distance: Distance = "chamfer",
        hold: float = 0.1,
        device: torch.device | str = "cpu",
    ) -> None:
        if distance not in get_args(Distance):
            known = ", ".join(get_args(Distance))
            raise CorrectionError(
                f"distance = {distance!r}; expected one of {known}", key="distance", value=distance
            )
        if not 0 <= hold <= 1e6:
            raise CorrectionError(f"hold = {hold:g}; expected 0 to 1e6", key="hold", value=hold)
        self.distance, self.hold, self._flat = distance, hold, body.flat
        weights = hold_weights(seen)
        self._held = torch.as_tensor(weights, dtype=torch.float32, device=device)
        self._visible = torch.as_tensor(
            (weights[body.corners] * body.shares).sum(axis=1) < 0.5, device=device
        )
        self.surface = _surface_of(body, device)

    def distances(self, vertices: Tensor, batch: Batch) -> tuple[Tensor, Tensor]:
        """From each measured point (b, p) [m] to the surface of vertices (b, v, 3) [m], and which
        of them count (b, p).
        """
        dense, valid = self.surface(vertices), self.valid(batch)
        points = torch.where(valid[:, :, None], batch.points, 0.0)
        return _apart(points, dense, nearest(points, dense, valid)), valid

    def valid(self, batch: Batch) -> Tensor:
        """Which points (b, p) are there and of the part of the surface that is corrected."""
        count = batch.count[:, 0 if self._flat else 1]
        return torch.arange(batch.points.shape[1], device=count.device) < count[:, None]

    def __call__(self, corrected: Tensor, batch: Batch, raw: Tensor) -> Loss:
        """Of corrected and simulated vertices (b, v, 3) [m]."""
        distance = self._distance(corrected, batch) * 1e3
        moved = ((corrected - raw) * 1e3).square().sum(dim=2)
        hidden = (moved @ self._held).mean() / len(self._held)
        return Loss(distance + self.hold * hidden, distance, hidden)

    def _distance(self, vertices: Tensor, batch: Batch) -> Tensor:
        apart, valid = self.distances(vertices, batch)
        if self.distance == "chamfer":
            return _means(apart, valid).mean()
        dense = self.surface(vertices)[:, self._visible]
        counted = valid.any(dim=1)
        points = torch.where(valid[:, :, None], batch.points, torch.inf)[counted]
        back = _apart(
            dense[counted],
            points,
            nearest(
                dense[counted], points, torch.ones_like(dense[counted, :, 0], dtype=torch.bool)
            ),
        )
        if self.distance == "symmetric":
            return _means(apart, valid).mean() + back.mean(dim=1).sum() / len(valid)
        there = torch.where(valid, apart, 0.0).amax(dim=1)
        return torch.maximum(there[counted], back.amax(dim=1)).sum() / len(valid)


def _surface_of(body: Body, device: torch.device | str) -> Callable[[Tensor], Tensor]:
    """Vertices (b, v, 3) to the super-sampled surface (b, s, 3)."""
    count = len(body.corners)
    if count * len(body.rest) <= _DENSE:
        weights = np.zeros((count, len(body.rest)), dtype=np.float32)
        np.add.at(weights, (np.arange(count)[:, None], body.corners), body.shares)
        matrix = torch.as_tensor(weights, device=device)
        return lambda vertices: matrix @ vertices
    corners = torch.as_tensor(body.corners.astype(np.int64).ravel(), device=device)
    shares = torch.as_tensor(body.shares, dtype=torch.float32, device=device)[None, :, :, None]
    shape = body.corners.shape
    return lambda vertices: (
        vertices.index_select(1, corners).reshape(len(vertices), *shape, 3) * shares
    ).sum(dim=2)


def _apart(points: Tensor, others: Tensor, index: Tensor) -> Tensor:
    """Distance (b, p) [m] of points (b, p, 3) to those of others (b, s, 3) with this number (b,
    p)."""
    # By one flat index: its gradient is added up in one order on CUDA, too, if that is asked for.
    flat = index + others.shape[1] * torch.arange(len(others), device=index.device)[:, None]
    found = others.reshape(-1, 3).index_select(0, flat.flatten()).reshape(points.shape)
    return ((found - points).square().sum(dim=2) + _LEAST**2).sqrt()


def _means(values: Tensor, valid: Tensor) -> Tensor:
    """Mean (b,) over the valid of values (b, p); zero where there are none."""
    return torch.where(valid, values, 0.0).sum(dim=1) / valid.sum(dim=1).clamp_min(1)


@torch.no_grad()
def nearest(points: Tensor, others: Tensor, valid: Tensor) -> Tensor:
    """Number (b, p) of the nearest of others (b, s, 3) to each of points (b, p, 3); zero where not
    valid (b, p).

    Exact on every device; of two that are equally near the tree and the list of all distances may
    choose differently.
    """
    if points.device.type == "cpu":
        return _by_tree(points, others, valid)
    return torch.where(valid, _by_all(points, others), 0)


def _by_all(points: Tensor, others: Tensor) -> Tensor:
    index = torch.zeros(points.shape[:2], dtype=torch.long, device=points.device)
    step = max(1, _ROOM // (points.shape[1] * others.shape[1]))
    for start in range(0, len(points), step):
        part = slice(start, start + step)
        # Through a matrix product distances below a tenth of a millimetre would be lost, and
        # torch.cdist without one was 88 to 98 % of a training step on an H200.
        here, there = points[part, :, None], others[part, None]
        apart = (here[..., 0] - there[..., 0]).square_()
        for axis in (1, 2):
            apart += (here[..., axis] - there[..., axis]).square_()
        index[part] = apart.argmin(dim=2)
    return index


def _by_tree(points: Tensor, others: Tensor, valid: Tensor) -> Tensor:
    here, there, counted = points.detach().numpy(), others.detach().numpy(), valid.numpy()
    index = np.zeros(here.shape[:2], dtype=np.int64)

    def search(row: int) -> None:
        index[row, counted[row]] = _query(there[row], here[row, counted[row]])

    threads = min(torch.get_num_threads(), len(here))
    if threads > 1:
        list(_pool(threads).map(search, range(len(here))))
    else:
        for row in range(len(here)):
            search(row)
    return torch.from_numpy(index)


def _query(others: Any, points: Any) -> Any:
    usable = np.isfinite(others).all(axis=1)
    if not usable.any():
        return np.zeros(len(points), dtype=np.int64)
    found = cKDTree(others[usable]).query(points)[1]
    return found if usable.all() else np.flatnonzero(usable)[found]


@lru_cache(maxsize=4)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="nearest")
