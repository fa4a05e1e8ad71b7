"""The columns of a model by name: nuisances, effects, tangents, inclusions, and mesh error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

from palpate.effects import Effect, NuisanceBlock

__all__ = ["ModelColumns", "ParameterBlocks"]


@dataclass(frozen=True)
class ParameterBlocks:
    """The nuisance parameters of every model, as named blocks of their vector.

    The columns of a replay begin with all of them but the last, the mesh error, whose column comes
    after all others.

    Attributes:
        forces: whether the modulus is one of them, as forces were measured.
    """

    forces: bool = False

    @property
    def names(self) -> tuple[NuisanceBlock, ...]:
        """The blocks in their order."""
        return tuple(
            block
            for block in NuisanceBlock
            if self.forces or block is not NuisanceBlock.YOUNG_MODULUS
        )

    @property
    def size(self) -> int:
        """Number of nuisance parameters."""
        return sum(block.size for block in self.names)

    @property
    def replayed(self) -> int:
        """Number of nuisance columns that a replay states: all but the mesh error."""
        return self.size - NuisanceBlock.MESH_ERROR.size

    def places(self, *blocks: NuisanceBlock) -> tuple[int, ...]:
        """Return the places of these blocks in the vector of nuisances; none of a missing block."""
        ends = accumulate(block.size for block in self.names)
        known = {
            name: range(end - name.size, end) for name, end in zip(self.names, ends, strict=True)
        }
        return tuple(place for block in blocks for place in known.get(block, ()))

    def columns(
        self, effects: Sequence[Effect], tangents: int, inclusions: int, count: int
    ) -> ModelColumns:
        """Return the columns of a model.

        Args:
            effects: of the model.
            tangents: number of tangents.
            inclusions: number of places of the inclusion grid.
            count: number of all columns of a replay.
        """
        sizes = (sum(len(effect.numbers()) for effect in effects), tangents, inclusions)
        ends = list(accumulate(sizes, initial=self.replayed))
        own, near, places = (tuple(range(first, last)) for first, last in pairwise(ends))
        return ModelColumns((*range(self.replayed), count), own, near, places)


@dataclass(frozen=True)
class ModelColumns:
    """The columns of one model.

    Attributes:
        nuisances: of the nuisance parameters, in the order of `ParameterBlocks`.
        effects: of each search coordinate of each effect.
        tangents: of each tangent.
        inclusions: of the stiffness contrast at each place of the inclusion grid.
        signatures: of each effect that is screened at a finite size.
    """

    nuisances: tuple[int, ...]
    effects: tuple[int, ...] = ()
    tangents: tuple[int, ...] = ()
    inclusions: tuple[int, ...] = ()
    signatures: tuple[int, ...] = ()
