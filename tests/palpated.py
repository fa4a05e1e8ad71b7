"""A palpation by force alone in a folder, its forces those of a replay on a finer mesh, with a
sensor's noise and bias.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import Replay
from palpate.setup.setup import Setup

__all__ = ["write_palpation"]

RATE, HOVER, NOISE = 100.0, 5e-3, 4e-3
BIAS = np.array([0.03, -0.02, 0.01])


def _resisting(
    setup: Setup, mesh: Meshing, place: FloatArray, normal: FloatArray, depths: FloatArray
) -> FloatArray:
    """Force on the tool (d, 3) [N] at these depths (d,) [m]."""
    block, found, frame = Replay(setup, mesh, 3e-4), [], None
    for depth in depths:
        frame = block.solve_from_any(place + (setup.tool.radius - depth) * normal, (frame,))
        found.append(frame.force)
    return np.array(found)


def _sequence(
    folder: Path,
    setup: Setup,
    mesh: Meshing,
    pushes: Sequence[tuple[FloatArray, FloatArray]],
    depth: float,
    seed: int,
) -> None:
    random, knots = np.random.default_rng(seed), np.linspace(0.0, depth, 4)[1:]
    legs = np.concatenate(
        [np.linspace(0, 1, 100), np.ones(80), np.linspace(1, 0, 60), np.zeros(60)]
    )
    centres, forces = [], []
    for place, normal in pushes:
        resisting = _resisting(setup, mesh, place, normal, knots)
        arc = legs * (HOVER + depth) - HOVER
        # Hertz: the force goes with the depth to the power of 1.5, and little is left to
        # interpolate.
        shares = np.concatenate([[0.0], knots]) ** 1.5
        sizes = np.column_stack(
            [
                np.interp(np.maximum(arc, 0) ** 1.5, shares, np.append(0.0, one))
                for one in resisting.T
            ]
        )
        centres.append(place + (setup.tool.radius - arc)[:, None] * normal)
        forces.append(sizes)
    still = round(1.5 * RATE)
    way = np.concatenate([np.tile(centres[0][0], (still, 1)), *centres])
    force = np.concatenate([np.zeros((still, 3)), *forces])
    stamps = np.arange(len(way)) / RATE
    folder.mkdir(parents=True)
    rows = [
        f"{t:.3f},{x:.7f},{y:.7f},{z:.7f},0,0,0,1" for t, (x, y, z) in zip(stamps, way, strict=True)
    ]
    (folder / "kinematics.csv").write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rows]) + "\n")
    read = force + BIAS + NOISE * random.normal(size=force.shape)
    rows = [f"{t:.3f},{x:.6f},{y:.6f},{z:.6f}" for t, (x, y, z) in zip(stamps, read, strict=True)]
    (folder / "forces.csv").write_text("\n".join(["t,fx,fy,fz", *rows]) + "\n")


def write_palpation(
    root: Path,
    true: Setup,
    mesh: Meshing,
    sequences: dict[str, list[tuple[FloatArray, FloatArray]]],
    splits: dict[str, list[str]],
    phantom: str,
    depth: float = 4e-3,
) -> Path:
    """Write a dataset of pushes of the `true` setup; robot and phantom have one frame.

    Args:
        mesh: what the forces come from.
        sequences: name to places of the surface and outward normals (3,) [m], in order.
        phantom: lines of [phantom], without mass, support and material.
    """
    for seed, (name, pushes) in enumerate(sequences.items()):
        _sequence(root / "sequences" / name, true, mesh, pushes, depth, seed)
    x, y = true.geometry.size[0] / 2, true.geometry.size[1] / 2
    marks = {
        f"mark_{n}": (a * x, b * y, true.geometry.height / 2)
        for n, (a, b) in enumerate([(1, 1), (1, -1), (-1, -1), (-1, 1)])
    }
    (root / "touches.csv").write_text(
        "\n".join(["landmark,x,y,z", *(f"{n},{a},{b},{c}" for n, (a, b, c) in marks.items())])
        + "\n"
    )
    lines = [
        "format = 1",
        f'name = "{root.name}"',
        "[phantom]",
        phantom,
        'mass = 0.1\nfixed = "base"\nyoung_modulus = 5e3',
        '[tool]\nshape = "sphere"',
        f"radius = {true.tool.radius}",
        "[landmarks]",
        *(f"{name} = [{a}, {b}, {c}]" for name, (a, b, c) in marks.items()),
        "[splits]",
        *(f"{split} = {names}".replace("'", '"') for split, names in splits.items()),
    ]
    (root / "dataset.toml").write_text("\n".join(lines) + "\n")
    return root
