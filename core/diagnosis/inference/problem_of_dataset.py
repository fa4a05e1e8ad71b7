"""The inference problem of a dataset: its meshes, and its data at rest."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.diagnosis.inference.inference_problem import InferenceProblem
from palpate.diagnosis.inference.noise.rest_cloud import RestCloud
from palpate.diagnosis.inference.noise.rest_evidence import RestEvidence
from palpate.diagnosis.observation.force_only import contact_places, pushed_places
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.experiment import Experiment
from palpate.mesh.default_meshes import Use, default_mesh
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import Setup

__all__ = ["problem_of_dataset"]


def problem_of_dataset(
    experiment: Experiment, fitted: Sequence[Observations], held_out: Sequence[Observations]
) -> InferenceProblem:
    """Return the inference problem of a dataset.

    Args:
        experiment: the registered dataset with its rest cloud.
        fitted: sequences that causes are fitted on.
        held_out: sequences of the test, whose pushes the meshes must resolve too.
    """
    setup = experiment.stated
    grid, fine, coarse = _meshes(setup, [*fitted, *held_out])
    touched = contact_places(fitted, setup)
    clouds, at_rest = any(not item.force_only for item in fitted), None
    if clouds:
        cloud = experiment.dataset.rest_cloud()
        at_rest = RestEvidence(RestCloud.of(cloud, experiment.cleaner, setup, grid))
    return InferenceProblem(
        setup=setup,
        registration=experiment.registration,
        names=tuple(item.name for item in fitted),
        at_rest=at_rest,
        grid=grid,
        fine_grid=fine,
        coarse_grid=coarse,
        forces=any(item.forces for item in fitted),
        clouds=clouds,
        pushes=pushed_places(fitted, setup),
        contacts=(touched, setup.geometry.facing(touched)[1]),
        height_sigma=experiment.dataset.config.height_sigma,
    )


def _meshes(setup: Setup, data: Sequence[Observations]) -> tuple[Meshing, Meshing, Meshing]:
    """Return the mesh of the diagnosis, the fine one and the coarse one."""
    radius = setup.tool.radius
    places = contact_places(data, setup)
    default, fine, coarse = (
        default_mesh(use, setup.geometry, radius, places)
        for use in (Use.REPLAY, Use.FINE, Use.SCREEN)
    )
    return default, fine, coarse
