"""Accuracy and speed of the default mesh on bodies of any shape, against a finer mesh.

One push of 8 mm along the normal into one body of each family, at 30 frames a second, frictionless
ball of 5 mm, E 5 kPa, nu 0.45. The reference is by the same law on a mesh with 0.4 times the
spacing near the tool, which grows half as fast with the distance from there.

`python -m benchmarks.shape_accuracy` solves and stores the reference anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.cpu_time import timed
from palpate.foundation.arrays import FloatArray
from palpate.mesh.default_meshes import Use, default_mesh
from palpate.mesh.protocol import Meshing
from palpate.mesh.push_meshes import PushMeshSpec
from palpate.replay.replay import Equilibrium, replay, require_converged
from palpate.setup.setup import Material, Setup, Tool
from palpate.synthetic.bodies.shape_families import FAMILIES, draw_shape

__all__ = ["run"]

DEPTHS, RADIUS = (4e-3, 8e-3), 5e-3
MOST_OFF = {"displacement": (0.05, 0.08), "force": (0.05, 0.08)}
"""Largest errors on the default mesh at 4 and 8 mm [1]."""
FRAMES, FRAME_MS = 60, 25.0
"""Frames of a push, 30 a second, and the reference for the CPU time of one [ms]."""
FINEST = PushMeshSpec(spacing=0.65e-3, growth=0.35, coarsest=2.6e-3)
_STEPS = 4
_FILE = Path(__file__).with_name("shape_accuracy.npz")


@dataclass(frozen=True, eq=False)
class ShapePush:
    """A push into one body.

    Attributes:
        setup: the body and the tool.
        place: (3,) that is pushed [m].
        normal: (3,) outwards.
    """

    setup: Setup
    place: FloatArray
    normal: FloatArray

    def frames(self, grid: Meshing, count: int) -> list[Equilibrium]:
        """Return the equilibria of a push in this many even steps."""
        depths = np.arange(1, count + 1) / count * DEPTHS[-1]
        centres = self.place + (RADIUS - depths)[:, None] * self.normal
        frames = replay(self.setup, centres, grid, tolerance=1e-5)
        require_converged(frames)
        return frames

    def compared(self, frames: list[Equilibrium]) -> tuple[FloatArray, FloatArray]:
        """Return displacement (2, m, 3) [m] of the free surface and force (2, 3) [N] at DEPTHS."""
        points = self.setup.geometry.surface_points()
        chosen = [frames[round(len(frames) * depth / DEPTHS[-1]) - 1] for depth in DEPTHS]
        moved = np.stack([frame.move(points) - points for frame in chosen])
        return moved, np.array([frame.force for frame in chosen])


def shape_push(family: str) -> ShapePush:
    """Return the push into a family's body, near the top."""
    shape = draw_shape(family, 0)
    places = shape.surface_points()
    normals = shape.facing_free(places)[1]
    # Off the axis, so that no symmetry makes it easy.
    wanted = shape.high * (0.25, 0.25, 1.0)
    number = int(np.linalg.norm(places - wanted, axis=1).argmin())
    setup = Setup(
        geometry=shape, tool=Tool(radius=RADIUS), material=Material(poisson_ratio=0.45), mass=0.05
    )
    return ShapePush(setup, places[number], normals[number])


def store_reference() -> None:
    """Solve all pushes on the finest mesh, and store them."""
    stored: dict[str, Any] = {}
    for family in FAMILIES:
        push = shape_push(family)
        frames = push.frames(FINEST.at(push.place[None]), _STEPS)
        displacement, force = push.compared(frames)
        stored[f"{family} displacement"], stored[f"{family} force"] = (
            displacement.astype(np.float32),
            force,
        )
        Console().print(f"{family}: {len(frames[-1].mesh.nodes)} nodes, {force[-1].round(3)} N")
    np.savez_compressed(_FILE, **stored)


def run() -> list[Table]:
    """Replay the pushes on the default mesh; RuntimeError where an error is larger than allowed."""
    errors_of = ("surface off by", "force off by")
    heads = ("body", "nodes", *errors_of, "steps a frame", f"ms a frame (of {FRAME_MS:g})")
    table = Table(*heads, title="Default mesh on shapes, errors against a finer mesh, 4 / 8 mm")
    wrong = []
    with np.load(_FILE) as stored:
        truth = {name: stored[name].astype(float) for name in stored.files}
    for family in FAMILIES:
        push = shape_push(family)
        grid = default_mesh(Use.REPLAY, push.setup.geometry, RADIUS, push.place[None])
        push.frames(grid, _STEPS)  # warm-up: mesh, compilation and symbolic factorisation
        frames, seconds = timed(partial(push.frames, grid, FRAMES))
        displacement, force = push.compared(frames)
        errors = {
            "displacement": _relative(displacement, truth[f"{family} displacement"]),
            "force": _relative(force, truth[f"{family} force"]),
        }
        wrong += [
            f"{family}: {name} off by {', '.join(f'{value:.1%}' for value in values)}"
            for name, values in errors.items()
            if (values > MOST_OFF[name]).any()
        ]
        table.add_row(
            family,
            str(len(frames[-1].mesh.nodes)),
            *(" / ".join(f"{value:.1%}" for value in values) for values in errors.values()),
            f"{np.mean([frame.iterations for frame in frames]):.1f}",
            f"{1e3 * seconds / FRAMES:.0f}",
        )
    if wrong:
        raise RuntimeError("; ".join(wrong))
    return [table]


def _relative(values: FloatArray, truth: FloatArray) -> FloatArray:
    """Return relative errors (2,) of values (2, ...) at the two depths [1]."""
    miss, size = ((field.reshape(2, -1) ** 2).sum(axis=1) for field in (values - truth, truth))
    return np.asarray(np.sqrt(miss / size))


if __name__ == "__main__":
    store_reference()
