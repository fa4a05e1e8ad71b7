"""The description of one inference problem: stated setup, data, meshes, priors, and effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from palpate.diagnosis.inference.applicable_effects import applicable_effects
from palpate.diagnosis.inference.noise.rest_evidence import RestEvidence
from palpate.diagnosis.inference.nuisances import Nuisances
from palpate.diagnosis.inference.parameter_blocks import ParameterBlocks
from palpate.effects import CATALOGUE, Effect, NuisanceBlock
from palpate.foundation.arrays import FloatArray
from palpate.mesh.protocol import Meshing
from palpate.registration.registration import Registration
from palpate.setup.phantom_geometry import Surface
from palpate.setup.setup import Setup

__all__ = ["InferenceProblem"]


def _no_pushes() -> tuple[FloatArray, FloatArray]:
    return np.empty((0, 3)), np.empty((0, 3))


@dataclass(frozen=True, eq=False, kw_only=True)
class InferenceProblem:
    """The inference problem of one dataset. It is immutable.

    Attributes:
        setup: as stated.
        registration: of robot and camera, with the covariances from which the priors start.
        names: of the sequences that are fitted.
        at_rest: data without a push; None without clouds.
        grid: mesh of the diagnosis.
        fine_grid: second mesh, from which the mesh error is estimated.
        coarse_grid: mesh on which finite effects are screened.
        forces: whether any sequence has forces.
        clouds: whether any sequence has clouds.
        pushes: places and outward normals (k, 3) of the pushes of sequences without clouds.
        contacts: the same of what the tool touches in any fitted sequence.
        height_sigma: standard deviation of the stated height [m]; None if not stated.
        catalogue: effects to choose from.
    """

    setup: Setup
    registration: Registration
    names: tuple[str, ...]
    at_rest: RestEvidence | None
    grid: Meshing
    fine_grid: Meshing
    coarse_grid: Meshing
    forces: bool = False
    clouds: bool = True
    pushes: tuple[FloatArray, FloatArray] = field(default_factory=_no_pushes)
    contacts: tuple[FloatArray, FloatArray] = field(default_factory=_no_pushes)
    height_sigma: float | None = None
    catalogue: Sequence[type[Effect]] = CATALOGUE

    @cached_property
    def nuisances(self) -> Nuisances:
        """Prior of the nuisance parameters."""
        return Nuisances.of(self.registration.repaired, self.forces)

    @property
    def blocks(self) -> ParameterBlocks:
        """The nuisance parameters by name."""
        return self.nuisances.blocks

    @cached_property
    def applicable(self) -> tuple[type[Effect], ...]:
        """The effects that this data can show."""
        return applicable_effects(
            self.setup, clouds=self.clouds, forces=self.forces, catalogue=self.catalogue
        )

    @cached_property
    def surface(self) -> Surface:
        """The block's surface as the camera sees it; SetupError for other bodies."""
        return self.setup.surface()

    def effects_sharing(self, block: NuisanceBlock) -> tuple[type[Effect], ...]:
        """Return the effects of the catalogue that share these nuisance parameters."""
        return tuple(kind for kind in self.catalogue if kind.nuisance is block)
