"""Error and time of quadratic tetrahedra, compared with quadratic hexahedra.

The tetrahedra fill the reference block given as a closed surface.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from rich.table import Table

from benchmarks.cpu_time import timed
from benchmarks.reference_pokes import SETUP, compared, poke_centres, poke_frames, reference
from benchmarks.replay import RATE, motion
from palpate.mesh.box_mesh import GridSpec
from palpate.mesh.protocol import Meshing
from palpate.mesh.tet_fill import TetSpec
from palpate.replay.replay import replay, require_converged
from palpate.setup.setup import Setup, Shape

__all__ = ["run"]

START, STOP = 2.0, 6.0
"""Start and end of the replayed part of the motion [s]: most of a 4 mm poke, at 30 Hz."""


def surface() -> Shape:
    """Return the block as a surface of twelve triangles."""
    low, high = SETUP.geometry.low, SETUP.geometry.high
    vertices = np.array(
        [np.where(np.array(list(f"{number:03b}")) == "1", high, low) for number in range(8)]
    )
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return Shape(
        vertices,
        np.array(
            [[quad[k] for k in corners] for quad in quads for corners in ((0, 1, 2), (0, 2, 3))]
        ),
        name="block",
    )


def _tets(spacing: float, coarsest: float) -> TetSpec:
    return TetSpec.along(
        poke_centres(), SETUP.tool.radius, spacing=spacing, growth=0.5, coarsest=coarsest
    )


@dataclass(frozen=True)
class Case:
    """One mesh.

    Attributes:
        name: name for readers.
        setup: the setup, whose geometry is the block or its surface.
        mesh: the mesh protocol.
        top: largest errors of the top's displacement at 4 and 8 mm [1].
        force: largest errors of the force at 4 and 8 mm [1].
    """

    name: str
    setup: Setup
    mesh: Meshing
    top: tuple[float, float]
    force: tuple[float, float]


SHAPE = replace(SETUP, geometry=surface())
CASES = (
    Case(
        "hexahedra, 13x9x9, 1.5 mm",
        SETUP,
        GridSpec(nodes=(13, 9, 9), spacing=1.5e-3, order=2),
        (0.11, 0.1),
        (0.03, 0.03),
    ),
    Case(
        "hexahedra, 17x13x9, 1.2 mm",
        SETUP,
        GridSpec(nodes=(17, 13, 9), spacing=1.2e-3, order=2),
        (0.05, 0.08),
        (0.03, 0.03),
    ),
    Case("tetrahedra, 2 mm", SHAPE, _tets(2e-3, 6e-3), (0.09, 0.12), (0.04, 0.08)),
    Case("tetrahedra, 1.5 mm", SHAPE, _tets(1.5e-3, 5e-3), (0.065, 0.07), (0.01, 0.03)),
    Case("tetrahedra, 1.2 mm", SHAPE, _tets(1.2e-3, 5e-3), (0.04, 0.045), (0.01, 0.02)),
)


def run() -> list[Table]:
    """Solve the reference pokes and replay four seconds on each mesh.

    Raises RuntimeError where an error is larger than allowed.
    """
    heads = (
        "elements, spacing at the tool",
        "unknowns",
        "top off by",
        "force off by",
        "ms a frame",
        "CPU s per s",
    )
    table = Table(
        *heads,
        title="Block given as a surface, one thread; errors against a converged solution, 4 / 8 mm",
    )
    centres = motion()[round(START * RATE) : round(STOP * RATE)]
    for case in CASES:
        frames = poke_frames(case.mesh, case.setup)
        displacement, force = reference().error(compared(frames))
        if (displacement > case.top).any() or (np.abs(force) > case.force).any():
            errors = ", ".join(f"{value:.1%}" for value in (*displacement, *force))
            raise RuntimeError(
                f"{case.name}: errors of displacement and force at 4 and 8 mm: {errors}"
            )
        followed, seconds = timed(partial(replay, case.setup, centres, case.mesh))
        require_converged(followed)
        shared = frames[0].mesh.connectivity
        table.add_row(
            case.name,
            str(3 * (shared.count - len(shared.base_nodes))),
            f"{displacement[0]:.1%} / {displacement[1]:.1%}",
            f"{force[0]:.1%} / {force[1]:.1%}",
            f"{1e3 * seconds / len(centres):.1f}",
            f"{seconds / (STOP - START):.2f}",
        )
    return [table]
