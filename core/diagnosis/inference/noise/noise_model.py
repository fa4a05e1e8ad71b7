"""The noise model: residuals without any cause, by sensor noise, mesh error, and engine accuracy.

A cause may be named only for residuals that none of these explains. The engine's accuracy is two
random fields, independent for each sequence: displacements are right to a few percent, and so is
the stiffness of any part of the block (a coarse contact zone acts like a stiffer part, another law
at large strain like a softer one). Without them an inconspicuous block is given inclusions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evidence import Block, gram
from palpate.diagnosis.inference.noise.beside_tool import beside_tool, width_of_smoothing
from palpate.diagnosis.inference.noise.isolated_errors import isolated_errors
from palpate.diagnosis.inference.noise.partly_seen import partly_seen
from palpate.diagnosis.inference.noise.shared_noise import clouds_in_patches, shared_noise
from palpate.diagnosis.observation.force_record import (
    constant_discrepancy,
    depth_discrepancy,
    force_discrepancy,
    force_scatter,
)
from palpate.foundation.arrays import FloatArray
from palpate.setup.phantom_geometry import Surface

__all__ = ["Noise", "noises", "patch_variance", "rows_of", "scatter_share", "smooth_basis"]


def patch_variance(predictions: Sequence[Prediction]) -> FloatArray:
    """Return the variance of single points about their patch's mean (p,), over all groups [m^2].

    Patches with few points get the median.
    """
    freedom = np.sum([np.maximum(item.count - 1, 0).sum(axis=0) for item in predictions], axis=0)
    squares = np.sum(
        [np.nansum(item.spread**2 * np.maximum(item.count - 1, 0), axis=0) for item in predictions],
        axis=0,
    )
    enough = freedom > CRITERIA.noise.least_freedom
    variance = np.where(enough, squares / np.maximum(freedom, 1), np.nan)
    typical = (
        float(np.nanmedian(variance))
        if enough.any()
        else float(squares.sum() / max(freedom.sum(), 1))
    )
    return np.where(enough, variance, typical)


def scatter_share(prediction: Prediction, shared: float) -> FloatArray:
    """Variance of each patch average (g, p) over that of single points [1].

    Args:
        prediction: with the points' numbers, and with their clouds if any noise is shared.
        shared: variance that a patch's points share in a cloud, over that of single points [1].
    """
    alone = 1 / np.maximum(prediction.count, 1)
    return alone + shared / clouds_in_patches(prediction) if shared else np.asarray(alone)


def smooth_basis(centres: FloatArray, length: float) -> FloatArray:
    """Return Gaussian bumps along the surface (p, b) whose squares add up to one.

    Args:
        centres: of the patches (p, 3) [m].
        length: distance between bumps [m].
    """
    chosen = [0]
    nearest = np.linalg.norm(centres - centres[0], axis=1)
    while nearest.max() > length:
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(centres - centres[chosen[-1]], axis=1))
    bumps = np.exp(
        -0.5 * (np.linalg.norm(centres[:, None] - centres[chosen], axis=2) / (0.8 * length)) ** 2
    )
    return np.asarray(bumps / np.linalg.norm(bumps, axis=1, keepdims=True))


def rows_of(item: Prediction) -> tuple[FloatArray, FloatArray]:
    """Return gaps (g, r) and columns (g, r, k) of a prediction.

    Rows are the surface's patches [m] and, with forces, their three components [N].
    """
    if item.forces is None:
        return item.gap, item.columns
    return np.concatenate([item.gap, item.forces.gap], axis=1), np.concatenate(
        [item.columns, item.forces.columns], axis=1
    )


@dataclass(frozen=True, eq=False)
class Noise:
    """The noise of one sequence under the baseline; the same weights serve every model, so that
    scores compare.

    Rows are the surface's patches in metres and, of a sequence with forces, three more in newtons,
    one for each component.

    Attributes:
        weights: (g, r) inverse variances [1/m^2].
        residual: (g, r) of the baseline [m], zero where unseen.
        mesh: (g, r) fine minus default mesh [m].
        discrepancy: (g, r, d) columns of the engine's own error, unit variance.
        centred: whether each row has a constant of its own, as the camera's pattern is; forces
            alone have none, since their bias was taken off.
        spots: how many of the last discrepancies are of local stiffness.
    """

    weights: FloatArray
    residual: FloatArray
    mesh: FloatArray
    discrepancy: FloatArray
    centred: bool = True
    spots: int = 0

    @classmethod
    def of(
        cls,
        baseline: Prediction,
        fine: Prediction,
        surface: Surface,
        variance: FloatArray,
        lumps: slice,
        shared: float = 0.0,
        edge: float = 0.0,
    ) -> Noise:
        """Make the noise of a sequence with clouds.

        Args:
            baseline: on the default mesh.
            fine: on the fine mesh.
            surface: of the block.
            variance: of single points by patch (p,) [m^2].
            lumps: the baseline's columns of local stiffness.
            shared: variance that a patch's points share in a cloud, over that of single points [1].
            edge: width of the band that the camera's filters round [m]; zero without filters.
        """
        (gap, columns), finer = rows_of(baseline), rows_of(fine)[0]
        seen = np.isfinite(gap) & np.isfinite(finer)
        seen[list(set(baseline.failed) | set(fine.failed))] = False
        mesh = np.where(seen, finer - gap, 0.0)
        scatter = variance * scatter_share(baseline, shared) + CRITERIA.noise.white_floor**2
        if baseline.forces is not None:
            scatter = np.concatenate([scatter, force_scatter(baseline.forces)], axis=1)
        scatter = scatter + (CRITERIA.noise.mesh_share * mesh) ** 2
        centres = surface.patch_centres
        size = np.array(
            [
                np.linalg.norm(frame.move(centres) - centres, axis=1)
                if frame.in_contact
                else np.zeros(len(centres))
                for frame in baseline.equilibria
            ]
        )
        displacement = (
            CRITERIA.noise.displacement_error
            * size[..., None]
            * smooth_basis(centres, CRITERIA.noise.field_length)
        )
        if baseline.forces is not None:
            displacement = _aside(
                displacement, force_discrepancy(baseline.forces, baseline.equilibria)
            )
        stiffness = CRITERIA.noise.stiffness_error * columns[..., lumps].astype(float)
        weights = np.where(seen, 1 / scatter, 0.0)
        patches = surface.patches
        weights[:, :patches][partly_seen(baseline.count)] = 0.0
        smoothed = beside_tool(baseline, centres, width_of_smoothing(edge, shared))
        weights[:, :patches][smoothed] = 0.0
        alone = isolated_errors(gap[:, :patches], weights[:, :patches], surface)
        weights[:, :patches][alone] = 0.0
        discrepancy = np.concatenate([displacement, stiffness], axis=2)
        return cls(weights, np.where(seen, gap, 0.0), mesh, discrepancy, spots=stiffness.shape[2])

    @classmethod
    def of_forces(cls, baseline: Prediction, fine: Prediction, lumps: slice) -> Noise:
        """Make the noise of a sequence without clouds, whose rows are those of the force.

        The depth of each push has an uncertainty of its own, and its force a constant where the
        sensor was never read clear of the phantom. Arguments as for `of`.
        """
        (gap, columns), finer = rows_of(baseline), rows_of(fine)[0]
        assert baseline.forces is not None
        seen = np.isfinite(gap) & np.isfinite(finer)
        seen[list(set(baseline.failed) | set(fine.failed))] = False
        mesh = np.where(seen, finer - gap, 0.0)
        scatter = force_scatter(baseline.forces) + (CRITERIA.noise.mesh_share * mesh) ** 2
        parts = [
            force_discrepancy(baseline.forces, baseline.equilibria),
            depth_discrepancy(baseline.forces, baseline.equilibria),
            constant_discrepancy(baseline.forces, baseline.equilibria),
            CRITERIA.noise.stiffness_error * columns[..., lumps].astype(float),
        ]
        weights = np.where(seen, 1 / scatter, 0.0)
        return cls(
            weights, np.where(seen, gap, 0.0), mesh, np.concatenate(parts, axis=2), centred=False
        )

    def remeshed(self, model: Prediction, fine: Prediction) -> Noise:
        """Return the noise with the mesh error of another model, which is settled by now.

        A patch that shows another side of it loses its weight: of a block that slid from under its
        edge, the points of the top are then points of a side, with that side's share of the
        camera's pattern. All else is unchanged, so that no patch gains or loses.

        Args:
            model: on the default mesh.
            fine: on the fine mesh.
        """
        gap, finer = rows_of(model)[0], rows_of(fine)[0]
        seen = np.isfinite(gap) & np.isfinite(finer) & (self.weights > 0)
        seen[list(set(model.failed) | set(fine.failed))] = False
        weights = self.weights.copy()
        if model.other_side is not None:
            weights[:, : model.other_side.shape[1]][
                model.other_side > CRITERIA.noise.other_side_share
            ] = 0.0
        return replace(self, weights=weights, mesh=np.where(seen, finer - gap, self.mesh))

    def block(self, prediction: Prediction) -> Block:
        """Return the quadratic form of residual and columns, with the discrepancy integrated out.

        The mesh error is the last column.
        """
        matrix, values = self.whole(prediction)
        kept = matrix.shape[0] - self.discrepancy.shape[2]
        cross, inner = matrix[:kept, kept:], matrix[kept:, kept:]
        reduced = matrix[:kept, :kept] - cross @ np.linalg.solve(
            inner + np.eye(len(inner)), cross.T
        )
        return Block(prediction.name, reduced, values)

    def whole(self, prediction: Prediction) -> tuple[FloatArray, float]:
        """Return the Gram matrix of residual, columns, mesh error and discrepancy, and the number
        of values.

        Where a model sees no patch or has no equilibrium, the baseline's residual counts, so that
        nothing is gained there.
        """
        gap, columns = rows_of(prediction)
        usable = np.isfinite(gap) & (self.weights > 0)
        usable[list(prediction.failed)] = False
        residual = np.where(usable, gap, self.residual) + self.mesh
        columns = np.where(usable[..., None], columns, 0.0)
        stacked = np.concatenate([columns, self.mesh[..., None], self.discrepancy], axis=2)
        return gram(residual, stacked, self.weights, self.centred)


def _aside(surface: FloatArray, force: FloatArray) -> FloatArray:
    """Return independent columns of surface and force in one array (g, p + 3, d + e).

    Args:
        surface: (g, p, d).
        force: (g, 3, e).
    """
    nothing = [
        np.zeros((*rows.shape[:2], other.shape[2]))
        for rows, other in ((surface, force), (force, surface))
    ]
    return np.concatenate(
        [
            np.concatenate([surface, nothing[0]], axis=2),
            np.concatenate([nothing[1], force], axis=2),
        ],
        axis=1,
    )


def noises(
    baseline: Sequence[Prediction],
    fine: Sequence[Prediction],
    surface: Surface | None,
    lumps: slice,
    edge: float = 0.0,
) -> list[Noise]:
    """Return the noise of every sequence.

    Args:
        baseline: on the default mesh.
        fine: on the fine mesh.
        surface: of the block; None for sequences without clouds.
        lumps: the baseline's columns of local stiffness.
        edge: width of the band that the camera's filters round [m]; zero without filters.
    """
    seen = [item for item in baseline if not item.force_only]
    variance = patch_variance(seen) if seen else np.empty(0)
    shared = shared_noise(seen)
    return [
        Noise.of_forces(b, f, lumps)
        if b.force_only or surface is None
        else Noise.of(b, f, surface, variance, lumps, shared, edge)
        for b, f in zip(baseline, fine, strict=True)
    ]
