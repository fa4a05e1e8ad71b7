"""Distance of a corrected surface to the measured points, as a differentiable loss.

The Chamfer distance of Wu, Kazanzides and Unberath (2020) is one-directional, from each measured
point to the nearest vertex of the surface super-sampled three-fold: where the camera does not see
the surface there are no points. Nearest neighbours are exact, by SciPy's k-d tree on a CPU and by
all distances on a CUDA device. They are constant within a step, so the gradient is that of the
distance to the nearest vertex.
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
_SMOOTHING = 1e-8
"""Added to a distance in quadrature [m]: the gradient of the root is infinite at zero."""
_MOST_DISTANCES = 2**26
"""Most distances in memory at a time on a CUDA device."""
_DENSE = 2**20
"""Number of surface weights up to which a dense matrix product is faster than a gather."""
_HALF_SEEN = 0.1
"""Measured points near a material point, as a share of the largest number, at weight 1/2 [1]."""


@dataclass(frozen=True, eq=False)
class Loss:
    """The loss of a batch.

    Attributes:
        total: the value that is minimised [mm].
        distance: distance of surface and points [mm].
        hidden: mean squared correction of hidden nodes [mm^2].
    """

    total: Tensor
    distance: Tensor
    hidden: Tensor


def hold_weights(seen: FloatArray) -> FloatArray:
    """Return the weight (v,) [0..1] that holds each material point at its simulated position.

    `seen` (v,) is the number of measured points near it.
    """
    best = float(seen.max(initial=0.0))
    return (
        np.ones_like(seen)
        if best == 0.0
        else np.asarray(1.0 / (1.0 + (seen / (_HALF_SEEN * best)) ** 4))
    )


class SurfaceLoss:
    """The distance of clouds to the surface of a body, plus a penalty on hidden points' correction.

    Args:
        body: the body.
        seen: (n,) measured points near each of its nodes, see `Samples.seen`.
        distance: "chamfer" (points to surface), "symmetric" (also the visible surface to the
            points), or "hausdorff" (the largest of both).
        hold: weight of the hidden points' squared correction [1/mm].
        device: device of the batches.
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
        self._hidden_weights = torch.as_tensor(weights, dtype=torch.float32, device=device)
        self._visible = torch.as_tensor(
            (body.carry(weights)[body.corners] * body.shares).sum(axis=1) < 0.5, device=device
        )
        self.surface = _surface_of(body, device)

    def distances(self, vertices: Tensor, batch: Batch) -> tuple[Tensor, Tensor]:
        """Return the distance of each measured point (b, p) [m], and which points count (b, p).

        The surface is given by vertices (b, v, 3) [m].
        """
        dense, valid = self.surface(vertices), self.valid(batch)
        points = torch.where(valid[:, :, None], batch.points, 0.0)
        return _distances(points, dense, nearest(points, dense, valid)), valid

    def valid(self, batch: Batch) -> Tensor:
        """Return which points (b, p) exist and lie on the part of the surface that is corrected."""
        count = batch.count[:, 0 if self._flat else 1]
        return torch.arange(batch.points.shape[1], device=count.device) < count[:, None]

    def __call__(self, corrected: Tensor, batch: Batch, raw: Tensor) -> Loss:
        """Return the loss of corrected and simulated vertices (b, v, 3) [m]."""
        distance = self._distance(corrected, batch) * 1e3
        nodes = len(self._hidden_weights)
        moved = ((corrected - raw)[:, :nodes] * 1e3).square().sum(dim=2)
        hidden = (moved @ self._hidden_weights).mean() / nodes
        return Loss(distance + self.hold * hidden, distance, hidden)

    def _distance(self, vertices: Tensor, batch: Batch) -> Tensor:
        distances, valid = self.distances(vertices, batch)
        if self.distance == "chamfer":
            return _means(distances, valid).mean()
        dense = self.surface(vertices)[:, self._visible]
        counted = valid.any(dim=1)
        points = torch.where(valid[:, :, None], batch.points, torch.inf)[counted]
        back = _distances(
            dense[counted],
            points,
            nearest(
                dense[counted], points, torch.ones_like(dense[counted, :, 0], dtype=torch.bool)
            ),
        )
        if self.distance == "symmetric":
            return _means(distances, valid).mean() + back.mean(dim=1).sum() / len(valid)
        there = torch.where(valid, distances, 0.0).amax(dim=1)
        return torch.maximum(there[counted], back.amax(dim=1)).sum() / len(valid)


def _surface_of(body: Body, device: torch.device | str) -> Callable[[Tensor], Tensor]:
    """Return the map of vertices (b, v, 3) to the super-sampled surface (b, s, 3)."""
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


def _distances(points: Tensor, others: Tensor, index: Tensor) -> Tensor:
    """Return the distances (b, p) [m] of points (b, p, 3) to others (b, s, 3) at index (b, p)."""
    # One flat index has a gradient that is deterministic on CUDA as well.
    flat = index + others.shape[1] * torch.arange(len(others), device=index.device)[:, None]
    found = others.reshape(-1, 3).index_select(0, flat.flatten()).reshape(points.shape)
    return ((found - points).square().sum(dim=2) + _SMOOTHING**2).sqrt()


def _means(values: Tensor, valid: Tensor) -> Tensor:
    """Return the mean (b,) over the valid values (b, p); zero where there are none."""
    return torch.where(valid, values, 0.0).sum(dim=1) / valid.sum(dim=1).clamp_min(1)


@torch.no_grad()
def nearest(points: Tensor, others: Tensor, valid: Tensor) -> Tensor:
    """Return the index (b, p) of the nearest of others (b, s, 3) to each of points (b, p, 3).

    Zero where not valid (b, p). Exact on every device; between two equally near vertices CPU and
    CUDA may choose differently.
    """
    if points.device.type == "cpu":
        return _by_tree(points, others, valid)
    return torch.where(valid, _by_all(points, others), 0)


def _by_all(points: Tensor, others: Tensor) -> Tensor:
    index = torch.zeros(points.shape[:2], dtype=torch.long, device=points.device)
    step = max(1, _MOST_DISTANCES // (points.shape[1] * others.shape[1]))
    for start in range(0, len(points), step):
        part = slice(start, start + step)
        # A matrix product would lose distances below 0.1 mm. Measured: torch.cdist without one
        # takes 88 to 98 % of a training step on an H200.
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
