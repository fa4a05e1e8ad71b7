"""Size, quality and time of the mesh that a diagnosis of a shape uses, and the mesh's own error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

import numpy as np

from palpate.app.commands.console import out, print_warnings, progress

if TYPE_CHECKING:
    from palpate.dataset import Dataset
    from palpate.mesh.tet_mesh import TetMesh
    from palpate.registration.registration import Registration
    from palpate.replay.equilibrium import Equilibrium
    from palpate.replay.mesh_convergence import MeshErrorEstimate

__all__ = ["print_mesh", "print_mesh_errors"]


def print_mesh(dataset: Dataset, registration: Registration) -> None:
    """Mesh the body for its deepest push, as a diagnosis does, and print size, quality and time."""
    from palpate.mesh.default_meshes import Use, default_mesh
    from palpate.mesh.meshers.mesh_quality import POOR_QUALITY, measured_mesh
    from palpate.mesh.meshers.mesher_choice import chosen_mesher
    from palpate.registration.registration import setup_from

    setup = setup_from(dataset, registration)
    paths = [dataset.sequence(name).kinematics.position for name in dataset.sequences]
    centres = setup.phantom_from_robot.apply(np.concatenate(paths))
    deepest = centres[setup.geometry.gap(centres, setup.tool.radius).argmin()]
    spec = default_mesh(Use.REPLAY, setup.geometry, setup.tool.radius, deepest[None])
    with progress(f"mesh {dataset.name}") as report:
        report(0.0, f"{chosen_mesher().name} fills the body")
        made = measured_mesh(lambda: cast("TetMesh", spec.mesh(setup, deepest)))
    out.print(
        f"mesh of the deepest push by {chosen_mesher().name}: {made.nodes} nodes, "
        f"{made.tetrahedra} tetrahedra in {made.seconds:.1f} s, quality {made.typical:.2f}, at "
        f"least {made.least:.2f} (1 is regular)",
        highlight=False,
    )
    if made.least < POOR_QUALITY:
        text = f"the worst tetrahedron has a quality of {made.least:.3f}, at least {POOR_QUALITY:g}"
        print_warnings([f"{text} is expected: smooth the surface with `palpate surface`"])


def print_mesh_errors(frames: Sequence[Equilibrium], errors: Sequence[MeshErrorEstimate]) -> None:
    """Print the own error of the mesh, and the hardest frames in which it is unknown."""
    from palpate.replay.mesh_convergence import hardest_frames

    if errors:
        worst = max(errors, key=lambda error: error.displacement)
        size = f"{1e3 * worst.displacement:.2f} mm RMS ({worst.relative:.0%})"
        out.print(
            f"the grid's own error, by a finer one: {size} and {worst.force:.0%} of the force "
            f"at frame {worst.frame}, the worst of {len(errors)} touches"
        )
    for number in sorted(set(hardest_frames(frames)) - {error.frame for error in errors}):
        out.print(
            f"[yellow]frame {number}[/] no equilibrium on the finer grid, "
            "so its mesh error is unknown",
            highlight=False,
        )
