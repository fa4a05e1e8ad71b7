"""The static channel: the rest cloud against the stated shape, with the table as its floor.

Here alone the sag of gravity shows. The camera's pose is free, since it was fitted to this very cloud, and the camera's smooth
bias is a random field whose size the registration has estimated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.cleaning import Cleaner
from core.diagnosis.evidence import Block
from core.frames import FloatArray
from core.measurement import Surface, gaps, patch_means
from core.mesh import GridSpec
from core.registration import motion_jacobian
from core.replay import rest
from core.setup import Setup

__all__ = ["StaticChannel"]

_BIAS_LENGTH = 0.025
_TABLE_CELL = 0.012
_POSE_FREEDOM = 0.05


@dataclass(frozen=True, eq=False)
class StaticChannel:
    """The rest cloud, reduced.

    Attributes:
        points: (n, 3) cleaned, camera frame [m]. table: (m, 3) places of the table's cells, phantom frame [m].
        table_gap: (m,) their height above z = 0 [m]. table_variance: (m,) of those [m^2]. bias: of the camera [m].
        weights: (p,) points per patch in the stated model; the same for all models.
    """

    points: FloatArray
    table: FloatArray
    table_gap: FloatArray
    table_variance: FloatArray
    bias: float

    @classmethod
    def of(cls, cloud: FloatArray, cleaner: Cleaner, bias: float) -> StaticChannel:
        """From the raw rest cloud (n, 3) [m], camera frame."""
        clean = cleaner.clean(cloud)
        table = clean.table_points
        cell = np.floor(table[:, :2] / _TABLE_CELL).astype(int)
        _, index = np.unique(cell, axis=0, return_inverse=True)
        index = index.ravel()
        count = np.bincount(index)
        means = np.stack([np.bincount(index, table[:, axis]) / count for axis in range(3)], axis=1)
        spread = float(np.median(np.abs(table[:, 2] - means[index, 2]))) * 1.48 if len(table) else 0.0
        good = count >= 4
        places = means[good] * np.array([1.0, 1.0, 0.0])
        return cls(cloud[clean.indices], places, means[good, 2], spread**2 / count[good], bias)

    def block(
        self, setup: Setup, grid: GridSpec, columns: int, varied: dict[int, tuple[Setup, float]], support: FloatArray
    ) -> Block:
        """Quadratic form with the pose and the bias integrated out.

        Args:
            columns: total number of columns. varied: column to (setup a little changed, step) for those that change the rest shape.
            support: (p,) which patches to use, from the baseline.
        """
        surface, pose = Surface(setup.geometry), setup.phantom_from_camera
        frame = rest(setup, grid)
        seen = gaps(pose.apply(self.points), pose.translation, frame, surface)
        means = patch_means(seen.gap, seen.patch, surface.patches)
        used = np.flatnonzero(np.isfinite(means.mean) & support)
        centres, normals = surface.patch_centres[used], surface.patch_normals[used]
        places = np.concatenate([centres, self.table])
        directions = np.concatenate([normals, np.tile([0.0, 0.0, 1.0], (len(self.table), 1))])
        residual = np.concatenate([means.mean[used], self.table_gap])
        white = float(np.nanmedian(means.spread[used])) ** 2 / np.maximum(means.count[used], 1)
        distance = np.linalg.norm(places[:, None] - places, axis=2)
        covariance = self.bias**2 * np.exp(-0.5 * (distance / _BIAS_LENGTH) ** 2)
        covariance += np.diag(np.concatenate([white, self.table_variance]) + 4e-10)
        pose_columns = np.einsum("ni,nij->nj", directions, motion_jacobian(places, np.array([0.0, 0.0, setup.geometry.size[2]])))
        covariance += _POSE_FREEDOM**2 * pose_columns @ np.diag([1, 1, 1, 100, 100, 100]) @ pose_columns.T
        stacked = np.zeros((len(residual), 1 + columns))
        stacked[:, 0] = residual
        for column, (other, step) in varied.items():
            change = rest(other, grid).move(centres) - frame.move(centres)
            stacked[: len(used), 1 + column] = -np.einsum("ni,ni->n", change, normals) / step
        return Block("rest", stacked.T @ np.linalg.solve(covariance, stacked), float(len(residual)))

    def support(self, setup: Setup, grid: GridSpec) -> FloatArray:
        """(p,) patches with enough points in the stated model."""
        surface, pose = Surface(setup.geometry), setup.phantom_from_camera
        seen = gaps(pose.apply(self.points), pose.translation, rest(setup, grid), surface)
        return np.asarray(patch_means(seen.gap, seen.patch, surface.patches, least=3).count >= 3, dtype=float).astype(bool)
