"""A hypothesis: the stated setup with some causes in it, and what is known of everything else only
to its stated accuracy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.jacobian import TOOL_COLUMNS
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.effect_derivative import Tangent
from palpate.diagnosis.inference.evidence import Block
from palpate.effects import Effect
from palpate.effects.elastic_material import PoissonRatio, YoungModulus
from palpate.effects.sensor import CameraRegistration
from palpate.effects.tool import ToolOffset, ToolRadius
from palpate.foundation.arrays import FloatArray
from palpate.registration.registration import Registration
from palpate.setup.setup import Setup

__all__ = ["TWINS", "Model", "Nuisances", "nuisance_setups"]

CAMERA = np.array([CRITERIA.priors.camera_translation] * 3 + [CRITERIA.priors.camera_rotation] * 3)
"""Accuracies of the camera's pose beyond its covariance [m, rad]."""


TWINS: Mapping[type[Effect], tuple[int, ...]] = {
    ToolOffset: (0, 1, 2),
    ToolRadius: (TOOL_COLUMNS,),
    PoissonRatio: (TOOL_COLUMNS + 1,),
    CameraRegistration: tuple(range(TOOL_COLUMNS + 2, TOOL_COLUMNS + 8)),
    YoungModulus: (TOOL_COLUMNS + 8,),
}
"""Effects that do what a nuisance does, only more of it, and the nuisance's columns, in the order
of their numbers.

The last of them is there only where forces were measured: no surface shows it."""


@dataclass(frozen=True, eq=False)
class Nuisances:
    """What is known only to its stated accuracy: prior precision (n, n) of the columns every model
    has.
    """

    precision: FloatArray

    @classmethod
    def of(cls, registration: Registration, forces: bool = False) -> Nuisances:
        """From the registrations' covariances and the accuracies above; the last column is the
        mesh's error.

        With `forces` there is one more before it, of the modulus.
        """
        robot = registration.robot_covariance.copy()
        robot[:3, :3] += CRITERIA.priors.tool_tip**2 * np.eye(3)
        camera = registration.camera_covariance + np.diag(CAMERA**2)
        precision = np.zeros((15 + forces, 15 + forces))
        precision[:6, :6] = np.linalg.inv(robot)
        precision[6, 6], precision[7, 7] = (
            CRITERIA.priors.tool_radius**-2,
            CRITERIA.priors.poisson_ratio**-2,
        )
        precision[8:14, 8:14] = np.linalg.inv(camera)
        if forces:
            precision[14, 14] = CRITERIA.priors.young_modulus**-2
        precision[-1, -1] = 1.0
        return cls(precision)

    @property
    def forces(self) -> bool:
        """Whether the modulus is one of them."""
        return len(self.precision) > 15

    def beside(self, effects: Sequence[Effect]) -> FloatArray:
        """Prior precision (n, n) where these effects take all that they and their twins among the
        nuisances do together.

        Left free, a nuisance keeps a share of what the effect should state: a quarter of a camera's
        shift, for a price that the least nonlinearity outweighs.
        """
        precision = self.precision.copy()
        for effect in effects:
            own = list(TWINS.get(type(effect), ()))
            precision[own, own] += CRITERIA.priors.pinned_factor * np.diag(self.precision)[own]
        return precision


@dataclass(frozen=True, eq=False)
class Model:
    """One hypothesis on the data.

    Attributes:
        effects: its causes.
        setup: the stated setup with them.
        predictions: per sequence.
        blocks: quadratic forms.
        columns: index of the column of each search coordinate of each effect, in order.
        extra: further columns by name.
        nuisance: columns of the nuisances.
        tangents: what the columns `extra["tangents"]` are.
    """

    effects: tuple[Effect, ...]
    setup: Setup
    predictions: tuple[Prediction, ...]
    blocks: tuple[Block, ...]
    columns: tuple[int, ...]
    extra: dict[str, tuple[int, ...]]
    nuisance: tuple[int, ...]
    tangents: tuple[Tangent, ...] = ()

    @property
    def scales(self) -> FloatArray:
        """Step that matters of each search coordinate."""
        return np.array([item.scale for effect in self.effects for item in effect.numbers()])

    @property
    def coordinates(self) -> FloatArray:
        """Search coordinates of all effects."""
        return np.array([value for effect in self.effects for value in effect.coordinates])

    @property
    def ends(self) -> FloatArray:
        """-1 of each search coordinate that lies at its lower bound, 1 at the upper, else 0."""
        items, here = (
            [item for effect in self.effects for item in effect.numbers()],
            self.coordinates,
        )
        low, high = np.array([item.ends for item in items]).reshape(-1, 2).T
        room = CRITERIA.priors.at_bound * self.scales
        return np.where(here - low < room, -1, np.where(high - here < room, 1, 0))

    @property
    def names(self) -> tuple[str, ...]:
        """The effects' names."""
        return tuple(effect.name for effect in self.effects)


def nuisance_setups(setup: Setup, forces: bool) -> list[tuple[Setup, float]]:
    """Setups with each nuisance a little changed, and the steps: radius, Poisson's ratio, camera,
    with forces the modulus.
    """
    step = CRITERIA.derivatives.step * 3e-4
    found: list[tuple[Setup, float]] = [
        (ToolRadius(radius=setup.tool.radius + step).apply(setup), step)
    ]
    nu = setup.material.poisson_ratio
    change = -2e-4 if nu > 0.494 else 2e-4
    found.append((PoissonRatio(nu=nu + change).apply(setup), change))
    camera = CameraRegistration.neutral(setup)
    for number, item in enumerate(camera.numbers()):
        values = [0.0] * 6
        values[number] = CRITERIA.derivatives.step * item.scale
        found.append((camera.moved(values).apply(setup), values[number]))
    if forces:
        modulus = YoungModulus.neutral(setup)
        found.append(
            (
                modulus.at([modulus.coordinates[0] + CRITERIA.derivatives.step]).apply(setup),
                CRITERIA.derivatives.step,
            )
        )
    return found
