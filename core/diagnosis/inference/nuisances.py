"""Parameters that are known only to their stated accuracy, which every model may adjust."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.effect_derivative import SetupChange
from palpate.diagnosis.inference.parameter_blocks import ParameterBlocks
from palpate.effects import Effect, NuisanceBlock
from palpate.effects.sensor import with_moved_camera
from palpate.foundation.arrays import FloatArray
from palpate.registration.registration import Registration
from palpate.setup.setup import Setup

__all__ = ["Nuisances", "nuisance_setups", "poisson_change"]


@dataclass(frozen=True, eq=False)
class Nuisances:
    """Prior of the nuisance parameters.

    Attributes:
        blocks: their places by name.
        precision: inverse covariance (n, n) of the prior.
    """

    blocks: ParameterBlocks
    precision: FloatArray

    @classmethod
    def of(cls, registration: Registration, forces: bool = False) -> Nuisances:
        """Make the prior from the registrations' covariances and the stated accuracies.

        Args:
            registration: of robot and camera.
            forces: whether forces were measured.
        """
        priors, blocks = CRITERIA.priors, ParameterBlocks(forces)
        robot = registration.robot_covariance.copy()
        robot[:3, :3] += priors.tool_tip**2 * np.eye(3)
        accuracy = np.array([priors.camera_translation] * 3 + [priors.camera_rotation] * 3)
        camera = registration.camera_covariance + np.diag(accuracy**2)
        parts: dict[tuple[NuisanceBlock, ...], ArrayLike] = {
            (NuisanceBlock.TOOL_POSITION, NuisanceBlock.TOOL_ROTATION): np.linalg.inv(robot),
            (NuisanceBlock.TOOL_RADIUS,): priors.tool_radius**-2,
            (NuisanceBlock.POISSON_RATIO,): priors.poisson_ratio**-2,
            (NuisanceBlock.CAMERA_POSE,): np.linalg.inv(camera),
            (NuisanceBlock.YOUNG_MODULUS,): priors.young_modulus**-2,
            (NuisanceBlock.MESH_ERROR,): 1.0,
        }
        precision = np.zeros((blocks.size, blocks.size))
        for names, part in parts.items():
            own = list(blocks.places(*names))
            precision[np.ix_(own, own)] = np.asarray(part)
        return cls(blocks, precision)

    def with_effects(self, effects: Sequence[Effect]) -> FloatArray:
        """Return the prior precision (n, n) under a model with these effects.

        A nuisance that an effect shares is held, so that the effect states the whole change. Left
        free, it keeps a share of it: a quarter of a camera's shift, at a price in the prior that
        the least nonlinearity outweighs.
        """
        precision = self.precision.copy()
        for effect in effects:
            if effect.nuisance is not None and effect.has_derivative():
                own = list(self.blocks.places(effect.nuisance))
                precision[own, own] += CRITERIA.priors.pinned_factor * np.diag(self.precision)[own]
        return precision


def nuisance_setups(setup: Setup, forces: bool) -> list[SetupChange]:
    """Return the setup with each nuisance a little changed, and the steps.

    The order is that of `NuisanceBlock`, without the tool's motion and the mesh error, whose
    columns need no other setup.

    Args:
        setup: of the model.
        forces: whether the modulus is one of the nuisances.
    """
    small, tool, material = CRITERIA.derivatives.step, setup.tool, setup.material
    step = small * CRITERIA.derivatives.radius_scale
    found = [(replace(setup, tool=replace(tool, radius=tool.radius + step)), step)]
    found.append(poisson_change(setup))
    for number, scale in enumerate(CRITERIA.derivatives.camera_scales):
        motion = [0.0] * len(CRITERIA.derivatives.camera_scales)
        motion[number] = small * scale
        found.append((with_moved_camera(setup, motion), motion[number]))
    if forces:
        modulus = math.exp(math.log(material.young_modulus) + small)
        found.append((replace(setup, material=replace(material, young_modulus=modulus)), small))
    return found


def poisson_change(setup: Setup) -> SetupChange:
    """Return the setup with another Poisson's ratio, and the step."""
    ratio = setup.material.poisson_ratio
    step = CRITERIA.derivatives.poisson_step
    step = -step if ratio > CRITERIA.derivatives.nearly_incompressible else step
    return replace(setup, material=replace(setup.material, poisson_ratio=ratio + step)), step
