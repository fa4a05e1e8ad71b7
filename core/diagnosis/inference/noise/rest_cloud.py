"""The rest cloud against the stated shape, with the table as its floor.

Only the rest cloud shows the sag by gravity. The camera's pose is free, since it was fitted to this
cloud, and the camera's smooth bias is a random field. Its size and length come from the cloud, with
every side of the block free to bulge, so that a sagging block does not pass for a bad camera.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import Block
from palpate.diagnosis.inference.noise.camera_error_model import CameraErrors, camera_errors
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.patch_averages import patch_means
from palpate.measurement.segmentation import Cleaner
from palpate.measurement.surface_gaps import gaps
from palpate.mesh.protocol import Meshing
from palpate.registration.pose import motion_jacobian
from palpate.replay.replay import rest
from palpate.setup.free_form.cast_modes import CAST_MODES, cast_modes
from palpate.setup.setup import Setup

__all__ = ["RestCloud"]


@dataclass(frozen=True, eq=False)
class RestCloud:
    """The rest cloud, reduced to the places at which every model is compared.

    Attributes:
        centres: of the visible patches of the surface (p, 3) [m], phantom frame.
        normals: of these patches (p, 3).
        table: cells of the table (t, 3) [m].
        residual: of the stated model at patches and cells (p + t,) [m].
        factor: Cholesky factor of its covariance (p + t, p + t) [m^2], camera pose and bias
            included.
        errors: of the camera.
    """

    centres: FloatArray
    normals: FloatArray
    table: FloatArray
    residual: FloatArray
    factor: FloatArray
    errors: CameraErrors

    @classmethod
    def of(cls, cloud: FloatArray, cleaner: Cleaner, setup: Setup, grid: Meshing) -> RestCloud:
        """Reduce a raw rest cloud.

        Args:
            cloud: points (n, 3) [m], camera frame.
            cleaner: segments the block and the table.
            setup: as stated.
            grid: mesh for the sag.
        """
        clean = cleaner.clean(cloud)
        table, height, scatter = _table_cells(clean.table_points)
        surface, sight = setup.surface(), camera_model_for(setup, reference=True)
        points = sight.place(cloud[clean.indices])
        seen = gaps(
            points, sight.pose.translation, rest(setup, grid), surface, lowest=cleaner.lowest
        )
        means = patch_means(seen.gap, seen.patch, surface.patches, least=CRITERIA.rest.least_points)
        used = np.flatnonzero(np.isfinite(means.mean) & (means.count >= CRITERIA.rest.least_points))
        centres, normals = surface.patch_centres[used], surface.patch_normals[used]
        white = np.concatenate(
            [
                float(np.nanmedian(means.spread[used])) ** 2 / np.maximum(means.count[used], 1),
                scatter,
            ]
        )
        residual = np.concatenate([means.mean[used], height])
        places = np.concatenate([centres, table])
        directions = np.concatenate([normals, np.tile([0.0, 0.0, 1.0], (len(height), 1))])
        pivot = np.array([0.0, 0.0, setup.geometry.height])
        moved = np.einsum("ni,nij->nj", directions, motion_jacobian(places, pivot))
        free = np.column_stack([moved, _bulges(centres, surface.patch_sides[used], len(residual))])
        depth = sight.pose.inverse().apply(places)[:, 2]
        form = _offset_covariance(setup, centres, len(residual))
        errors = camera_errors(places, depth, white, residual, free, form)
        covariance = (
            errors.covariance
            + CRITERIA.rest.pose_freedom**2 * moved @ np.diag([1, 1, 1, 100, 100, 100]) @ moved.T
        )
        return cls(centres, normals, table, residual, cho_factor(covariance)[0], errors)

    def block(
        self,
        stated: Setup,
        setup: Setup,
        grid: Meshing,
        columns: int,
        varied: dict[int, tuple[Setup, float]],
    ) -> Block:
        """Return the quadratic form with the pose and the bias integrated out.

        Args:
            stated: setup for which the cloud was reduced.
            setup: of the model.
            grid: mesh for the sag.
            columns: total number of columns.
            varied: column to (setup a little changed, step) for effects that show at rest.
        """
        before, here = self._gap(stated, stated, grid), self._gap(stated, setup, grid)
        stacked = np.zeros((len(self.residual), 1 + columns))
        stacked[:, 0] = self.residual + here - before
        for column, (other, step) in varied.items():
            stacked[:, 1 + column] = (self._gap(stated, other, grid) - here) / step
        return Block(
            "rest", stacked.T @ cho_solve((self.factor, False), stacked), float(len(self.residual))
        )

    def _gap(self, stated: Setup, setup: Setup, grid: Meshing) -> FloatArray:
        """Return measured minus simulated position (p + t,) [m] under a setup.

        The measured points are taken to be where the stated setup has its block, without sag, and
        its table.
        """
        rays = camera_model_for(stated, reference=True).read(
            np.concatenate([self.centres, self.table])
        )
        gap = camera_model_for(setup, reference=True).place(rays)
        own = setup.surface().own(self.centres)
        sags = setup.load.specific_weight_over_stiffness
        gap[: len(self.centres)] -= rest(setup, grid).move(own) if sags else own
        return np.concatenate(
            [
                np.einsum("ni,ni->n", gap[: len(self.centres)], self.normals),
                gap[len(self.centres) :, 2],
            ]
        )


def _table_cells(table: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return cells of the table (t, 3) [m], their mean height (t,) [m], and its variance (t,)
    [m^2].

    Args:
        table: points (m, 3) [m].
    """
    _, index = np.unique(
        np.floor(table[:, :2] / CRITERIA.rest.table_cell).astype(int), axis=0, return_inverse=True
    )
    index = index.ravel()
    count = np.bincount(index)
    means = np.stack([np.bincount(index, table[:, axis]) / count for axis in range(3)], axis=1)
    spread = float(np.median(np.abs(table[:, 2] - means[index, 2]))) * 1.48 if len(table) else 0.0
    good = count >= CRITERIA.rest.least_table_points
    return means[good] * np.array([1.0, 1.0, 0.0]), means[good, 2], spread**2 / count[good]


def _offset_covariance(setup: Setup, centres: FloatArray, rows: int) -> FloatArray | None:
    """Return the covariance (rows, rows) [m^2] of a cast's offset at patches, which come first, and
    table cells; None for a block.

    Args:
        setup: as stated.
        centres: of the patches (p, 3) [m].
        rows: number of patches and cells.
    """
    if setup.geometry.is_block:
        return None
    heights = np.zeros((rows, CAST_MODES))
    heights[: len(centres)] = cast_modes(setup.stated_shape).at(centres)[0]
    return np.asarray(CRITERIA.camera_error.cast_size**2 * heights @ heights.T)


def _bulges(centres: FloatArray, sides: IntArray, rows: int) -> FloatArray:
    """Return columns (rows, c) by which each side is shifted and bulges, by second powers of the
    coordinates that change along it.

    The smooth bias is not to explain that.
    """
    found = []
    for side in np.unique(sides):
        here = (sides == side).astype(float)
        extent = np.ptp(centres[sides == side], axis=0)
        along = [axis for axis in range(3) if extent[axis] > 1e-6 * extent.max()]
        shapes = [here, *(here * centres[:, axis] ** power for axis in along for power in (1, 2))]
        found += [np.concatenate([shape, np.zeros(rows - len(centres))]) for shape in shapes]
    return np.column_stack(found) if found else np.zeros((rows, 0))
