"""CalculiX (Dhondt; Debian's calculix-ccx) as a referee: a ball pushed into the middle of a block's
top, on a quarter of both.

Its elements (20-node serendipity hexahedra), its contact (surface to surface), its volumetric law
(K/2 (J - 1)^2) and its solver are not the engine's. Lengths in mm, stresses over E.
"""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.box_mesh import GridSpec, box_mesh
from palpate.setup.setup import Setup

__all__ = ["Referee", "poke"]

_GRID = GridSpec(nodes=(15, 13, 13), spacing=0.9e-3, order=2)
"""With 0.6 mm between nodes the force at 8 mm changes by 2 per mille."""
_CELLS = 8
_SKIN = 1.0
_PENALTY = 50.0
_INCREMENT = 0.05
"""Of a step: contact takes the ball for its tangent planes within one, and four to a step made the
8 mm push 2 % too stiff."""
_CORNERS = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
_EDGES = [
    *((1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2)),
    *((0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1)),
]
_SERENDIPITY = [i + 3 * j + 9 * k for i, j, k in _CORNERS + _EDGES]
"""The 20 of 27 nodes, in CalculiX' order; its face S1 is the lower one, S2 the upper."""


@dataclass(frozen=True, eq=False)
class Referee:
    """At each depth: displacement (d, n, 3) [m] of the top's nodes, at rest at (n, 3) [m], and
    force (d,) over E [m^2].
    """

    rest: FloatArray
    displacement: FloatArray
    force: FloatArray


def _block(size: FloatArray) -> tuple[FloatArray, IntArray]:
    """Nodes (n, 3) [mm] and elements (e, 20) of the quarter x, y > 0."""
    quarter = (size[0] / 2, size[1] / 2, size[2])
    mesh = box_mesh(quarter, _GRID, np.array([-quarter[0] / 2, -quarter[1] / 2, size[2]]))
    return 1e3 * (mesh.nodes + np.array([quarter[0] / 2, quarter[1] / 2, 0.0])), mesh.hexahedra[
        :, _SERENDIPITY
    ]


def _patch(
    along: FloatArray, across: FloatArray, outward: FloatArray, axes: tuple[int, int], radius: float
) -> tuple[FloatArray, IntArray]:
    """One side of a cube's surface blown up to the sphere, as a skin: nodes (n, 3) [mm], elements
    (e, 20), upper face outside.
    """
    u, v = np.meshgrid(np.tan(along), np.tan(across), indexing="xy")
    rays = np.tile(outward, (*u.shape, 1))
    rays[..., axes[0]], rays[..., axes[1]] = u, v
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    nodes = np.stack([r * rays for r in radius - _SKIN * np.array([1.0, 0.5, 0.0])])
    number = np.arange(nodes[..., 0].size).reshape(nodes.shape[:3])
    steps = [slice(0, -1, 2), slice(1, None, 2), slice(2, None, 2)]
    local = np.stack(
        [
            number[k, steps[j], steps[i]].ravel()
            for k in range(3)
            for j in range(3)
            for i in range(3)
        ],
        axis=1,
    )
    return nodes.reshape(-1, 3), local[:, _SERENDIPITY]


def _ball(radius: float) -> tuple[FloatArray, IntArray]:
    """The ball's skin about its centre, its lower half and more, a little over the planes of
    symmetry.
    """
    wide = np.linspace(-np.pi / 16, np.pi / 4, 2 * _CELLS + 1)
    high = np.linspace(-np.pi / 4, np.pi / 8, 2 * _CELLS + 1)
    # The order of the two directions makes each patch right-handed with its way out.
    patches = [
        _patch(wide, wide, np.array([0.0, 0.0, -1.0]), (1, 0), radius),
        _patch(wide, high, np.array([1.0, 0.0, 0.0]), (1, 2), radius),
        _patch(high, wide, np.array([0.0, 1.0, 0.0]), (2, 0), radius),
    ]
    nodes, elements, first = [], [], 0
    for points, hexahedra in patches:
        nodes.append(points)
        elements.append(hexahedra + first)
        first += len(points)
    return np.concatenate(nodes), np.concatenate(elements)


def _rows(numbers: IntArray, values: FloatArray | IntArray, kind: str) -> str:
    lines = []
    for number, row in zip(numbers, values, strict=True):
        entries = [str(number), *(format(value, kind) for value in row)]
        pieces = [", ".join(entries[at : at + 15]) for at in range(0, len(entries), 15)]
        lines.append(",\n".join(pieces))
    return "\n".join(lines)


def _set(name: str, numbers: IntArray, kind: str = "NSET") -> str:
    return f"*{kind}, {kind}={name}\n" + ",\n".join(map(str, numbers))


def _friction(coefficient: float) -> list[str]:
    """Coulomb's, with a stick as stiff as the contact."""
    return ["*FRICTION", f"{coefficient:g}, {_PENALTY}"] if coefficient else []


def _deck(setup: Setup, depths: tuple[float, ...]) -> tuple[str, FloatArray]:
    """The input file, and the rest positions (n, 3) [mm] of the nodes it prints."""
    size, radius, nu = (
        np.array(setup.geometry.size),
        1e3 * setup.tool.radius,
        setup.material.poisson_ratio,
    )
    body, bricks = _block(size)
    skin, shell = _ball(radius)
    place = np.array([0.0, 0.0, 1e3 * size[2] + radius])
    skin = skin + place
    used = np.unique(bricks)
    body_set, skin_used = 1 + used, 1 + len(body) + np.unique(shell)
    centre = 1 + len(body) + len(skin)
    top = used[np.abs(body[used, 2] - 1e3 * size[2]) < 1e-6]
    first = 1 + len(bricks)
    upper = 1 + np.flatnonzero(np.isin(bricks[:, 4:8], top).all(axis=1))
    shear, bulk = 1 / (2 * (1 + nu)), 1 / (3 * (1 - 2 * nu))
    parts = [
        "*NODE",
        _rows(body_set, body[used], ".12g"),
        _rows(skin_used, skin[np.unique(shell)], ".12g"),
        _rows(np.array([centre, centre + 1]), np.array([place, place]), ".12g"),
        "*ELEMENT, TYPE=C3D20, ELSET=BLOCK",
        _rows(np.arange(1, first), 1 + bricks, "d"),
        "*ELEMENT, TYPE=C3D20, ELSET=BALL",
        _rows(np.arange(first, first + len(shell)), 1 + len(body) + shell, "d"),
        _set("TOP", 1 + top),
        _set("BASE", 1 + used[body[used, 2] < 1e-9]),
        _set("MIDDLEX", 1 + used[body[used, 0] < 1e-9]),
        _set("MIDDLEY", 1 + used[body[used, 1] < 1e-9]),
        _set("UPPER", upper, "ELSET"),
        "*MATERIAL, NAME=GEL",
        "*HYPERELASTIC, NEO HOOKE",
        f"{shear / 2:.12g}, {2 / bulk:.12g}",
        "*MATERIAL, NAME=STEEL",
        "*ELASTIC",
        "1000., 0.3",
        "*SOLID SECTION, ELSET=BLOCK, MATERIAL=GEL",
        "*SOLID SECTION, ELSET=BALL, MATERIAL=STEEL",
        f"*RIGID BODY, ELSET=BALL, REF NODE={centre}, ROT NODE={centre + 1}",
        "*SURFACE, NAME=SOFT",
        "UPPER, S2",
        "*SURFACE, NAME=HARD",
        "BALL, S2",
        "*SURFACE INTERACTION, NAME=TOUCH",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
        f"{_PENALTY}",
        *_friction(setup.tool.friction_coefficient),
        "*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE",
        "SOFT, HARD",
        "*BOUNDARY",
        "BASE, 1, 3",
        "MIDDLEX, 1, 1",
        "MIDDLEY, 2, 2",
        f"{centre}, 1, 2",
        f"{centre + 1}, 1, 3",
    ]
    for depth in depths:
        parts += [
            "*STEP, NLGEOM, INC=1000",
            "*STATIC",
            f"{_INCREMENT}, 1., 1e-4, {_INCREMENT}",
            "*BOUNDARY",
            f"{centre}, 3, 3, {-1e3 * depth:.12g}",
            "*NODE PRINT, NSET=TOP, FREQUENCY=1000",
            "U",
            "*NODE PRINT, NSET=BASE, TOTALS=ONLY, FREQUENCY=1000",
            "RF",
            "*END STEP",
        ]
    return "\n".join(parts) + "\n", body[top]


def _read(file: Path, count: int, steps: int) -> tuple[FloatArray, FloatArray]:
    """Displacements (d, n, 3) [mm] and total reactions (d, 3) of the last increment of each
    step."""
    rows = [line.split() for line in file.read_text().splitlines()]
    tables = np.array(
        [[float(entry) for entry in row[1:]] for row in rows if len(row) == 4 and row[0].isdigit()]
    )
    totals = np.array(
        [
            [float(entry) for entry in row]
            for row in rows
            if len(row) == 3 and not row[0][:1].isalpha()
        ]
    )
    return tables.reshape(-1, count, 3)[-steps:], totals[-steps:]


def poke(program: str, setup: Setup, depths: tuple[float, ...], folder: Path) -> Referee:
    """Pokes to these depths [m] one after another, as `program` (ccx) solves them; raises
    RuntimeError when it does not.
    """
    deck, rest = _deck(setup, depths)
    (folder / "poke.inp").write_text(deck)
    done = subprocess.run(
        [program, "poke"], cwd=folder, capture_output=True, text=True, check=False
    )
    if done.returncode or "Job finished" not in done.stdout:
        raise RuntimeError(f"{program} failed: {done.stdout[-2000:]}")
    displacement, reaction = _read(folder / "poke.dat", len(rest), len(depths))
    return Referee(1e-3 * rest, 1e-3 * displacement, 4e-6 * reaction[:, 2])
