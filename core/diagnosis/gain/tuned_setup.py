"""The setup of a model with its fitted nuisances: robot pose, tool radius, Poisson's ratio."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.effects import NuisanceBlock
from palpate.effects.elastic_material import POISSON_BOUNDS
from palpate.registration.pose import small_motion
from palpate.setup.bounds import TOOL_RADII
from palpate.setup.setup import Setup

__all__ = ["tuned_setup"]


def tuned_setup(evaluator: Evaluator, model: Model) -> Setup:
    """The model's setup with the fitted pose of the robot, tool radius and Poisson's ratio.

    The camera's pose stays as stated, because the fixed pattern of each sequence contains its
    error. So does Young's modulus, because no surface shows it.
    """
    change = fit(
        evaluator.tempered(model),
        [*model.nuisance, *model.columns],
        evaluator.bounded_precision(model),
    ).change
    problem, setup = evaluator.problem, model.setup
    motion = problem.blocks.places(NuisanceBlock.TOOL_POSITION, NuisanceBlock.TOOL_ROTATION)
    (wider,) = problem.blocks.places(NuisanceBlock.TOOL_RADIUS)
    (softer,) = problem.blocks.places(NuisanceBlock.POISSON_RATIO)
    pose = (
        small_motion(change[list(motion)], problem.registration.robot_pivot)
        @ setup.phantom_from_robot
    )
    radius = float(np.clip(setup.tool.radius + float(change[wider]), *TOOL_RADII))
    nu = float(np.clip(setup.material.poisson_ratio + float(change[softer]), *POISSON_BOUNDS))
    return replace(
        setup,
        phantom_from_robot=pose,
        tool=replace(setup.tool, radius=radius),
        material=replace(setup.material, poisson_ratio=nu),
    )
