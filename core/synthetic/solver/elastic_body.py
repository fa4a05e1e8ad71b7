"""Elastic energy of the virtual block: base law, stiffening, fibres, history, and base springs."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.solver.holzapfel_fibres import assemble_fibres, fibre_energy
from palpate.synthetic.solver.mooney_rivlin import assemble_solid, constants, solid_energy
from palpate.synthetic.solver.rest_metric import assemble_metric, metric_energy
from palpate.synthetic.solver.solid_model import SolidModel
from palpate.synthetic.solver.stiffening_laws import assemble_stiffening, stiffening_energy
from palpate.synthetic.solver.tet_block import TetBlock, shape_values

__all__ = ["ElasticBody"]


class ElasticBody:
    """A block with its material, its weight and the springs under its base.

    Attributes:
        load: (n, 3) nodal forces of the weight [N].
        sole: (f, 10) nodes of the elements at the base.
        springs: (f, 10, 10) isotropic stiffness of the springs under each facet of the base [N/m].
    """

    def __init__(self, block: TetBlock, solid: SolidModel) -> None:
        self._block = block
        self._solid = solid
        self._grid = (block.elements, block.gradients, block.weights)
        c10, c01, lame = constants(solid.young_modulus, solid.poisson_ratio, solid.relaxed)
        self._constants = c10, c01, np.average(lame, axis=1, weights=block.weights)
        self._shear = 2 * (c10 + c01)
        self._unrelaxed_shear = self._shear / (1 - solid.relaxed)
        self.load = self._own_weight()
        self.sole = block.elements[block.sole.owner]
        self.springs = self._base_springs()

    def _own_weight(self) -> FloatArray:
        load = np.zeros_like(self._block.nodes)
        weights, per_volume = self._block.weights, self._solid.weight
        if np.ndim(per_volume):
            weights, per_volume = weights * per_volume, 1.0
        nodal = np.einsum("eq,qa->ea", weights, shape_values())
        np.add.at(load[:, 2], self._block.elements, -per_volume * nodal)
        return load

    def _base_springs(self) -> FloatArray:
        sole, springs = self._block.sole, self._solid.springs
        if springs is None:
            return np.zeros((0, 10, 10))
        return np.asarray(
            np.einsum("fq,fqa,fqb->fab", springs * sole.weights, sole.values, sole.values)
        )

    def energy(self, u: FloatArray, metric: FloatArray | None) -> float:
        """Energy [J] of block and springs for displacements u (n, 3) [m]; infinite if inverted.

        Args:
            u: (n, 3) [m].
            metric: (e, q, 3, 3) natural metric of a material with a history; None without.
        """
        solid = self._solid
        energy = float(solid_energy(u, *self._grid, *self._constants))
        if solid.stretch_limit is not None and np.isfinite(energy):
            energy += stiffening_energy(
                u, *self._grid, self._shear, solid.stretch_limit, solid.exponential
            )
        if solid.fibres is not None:
            modulus = solid.fibre_modulus * solid.young_modulus / len(solid.fibres)
            for fibres in solid.fibres:
                energy += fibre_energy(u, *self._grid, modulus, fibres)
        if metric is not None and np.isfinite(energy):
            energy += metric_energy(u, *self._grid, self._unrelaxed_shear, metric)
        if len(self.springs):
            moved = u[self.sole]
            energy += 0.5 * float(np.einsum("fai,fab,fbi->", moved, self.springs, moved))
        return energy

    def assemble(
        self, u: FloatArray, metric: FloatArray | None, stiffness: FloatArray, force: FloatArray
    ) -> None:
        """Add to element stiffness (e, 10, 10, 3, 3) [N/m] and to force (n, 3) [N]."""
        solid = self._solid
        assemble_solid(u, *self._grid, *self._constants, stiffness, force)
        if solid.stretch_limit is not None:
            limit = solid.stretch_limit
            assemble_stiffening(
                u, *self._grid, self._shear, limit, stiffness, force, solid.exponential
            )
        if solid.fibres is not None:
            modulus = solid.fibre_modulus * solid.young_modulus / len(solid.fibres)
            for fibres in solid.fibres:
                assemble_fibres(u, *self._grid, modulus, fibres, stiffness, force)
        if metric is not None:
            assemble_metric(u, *self._grid, self._unrelaxed_shear, metric, stiffness, force)
        if len(self.springs):
            np.add.at(force, self.sole, np.einsum("fab,fbi->fai", self.springs, u[self.sole]))
            np.add.at(stiffness, self._block.sole.owner, self.springs[..., None, None] * np.eye(3))
