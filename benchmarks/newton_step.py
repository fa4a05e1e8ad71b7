"""Time of the two expensive parts of a Newton step: the stiffness matrix and its factorisation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import count

import numpy as np
import scipy.sparse as sp
from rich.table import Table

from benchmarks.cpu_time import timed
from benchmarks.reference_pokes import SETUP
from palpate.fem.linalg.direct_solver import Factor
from palpate.fem.linalg.sparsity import SOLVERS, factor_of
from palpate.fem.model import BlockModel
from palpate.foundation.arrays import FloatArray
from palpate.gradients.frame_tangent import local_tool
from palpate.mesh.graded_mesh import REPLAY_GRID
from palpate.replay.replay import replay

__all__ = ["run"]

ROUNDS, DEPTHS = 10, (1.5e-3, 3e-3, 4.5e-3)
STEP = 1e-8
"""Step of the nodes [m] for the finite differences that check the tangent."""
OFF, DIGITS = 1e-5, {True: 1e-4, False: 1e-10}
"""Largest relative error of the tangent, and of a solution in single (True) or double precision."""


def _pressed() -> tuple[BlockModel, FloatArray, sp.csr_matrix, FloatArray]:
    """Return model, node positions (n, 3) [m], tangent and a load (u,) of the pushed block."""
    top = SETUP.geometry.height + SETUP.tool.radius
    frame = replay(SETUP, np.array([[0.0, 0.0, top - depth] for depth in DEPTHS]), REPLAY_GRID)[-1]
    model, positions = BlockModel(SETUP, frame.mesh), frame.mesh.nodes + frame.displacement
    state, pattern = model.assemble(positions, local_tool(frame)), model.topology.pattern
    upper = sp.csr_matrix((state.data, pattern.indices, pattern.indptr), shape=pattern.shape)
    along = np.random.default_rng(0).standard_normal(pattern.shape[0])
    ways = [_moved(model, positions, sign * STEP * along) for sign in (1, -1)]
    ahead, behind = (model.assemble(way, local_tool(frame), tangent=False).residual for way in ways)
    expected, diagonal = (ahead - behind) / (2 * STEP), sp.diags_array(upper.diagonal())
    wrong = float(
        np.linalg.norm((upper + upper.T - diagonal) @ along - expected) / np.linalg.norm(expected)
    )
    if wrong > OFF:
        raise RuntimeError(
            f"the tangent differs from differences of forces by {wrong:.1g}; expected {OFF:g}"
        )
    return model, positions, upper, expected


def _moved(model: BlockModel, positions: FloatArray, step: FloatArray) -> FloatArray:
    moved = positions.copy()
    moved[model.topology.free] += step
    return moved


def _each(work: Callable[[], object]) -> float:
    """Return the CPU time of one call [ms]."""
    work()
    return 1e3 * timed(lambda: [work() for _ in range(ROUNDS)])[1] / ROUNDS


def _anew(factor: Factor, scale: Iterator[int], entries: FloatArray) -> None:
    """Factorise scaled entries: the factor of equal entries would be reused."""
    factor.factorise(next(scale) * entries)


def run() -> list[Table]:
    """Measure assembly and factorisations; RuntimeError where one is wrong."""
    model, positions, upper, right = _pressed()
    size = f"{upper.shape[0]} unknowns, {len(model.topology.elements)} elements of 27 nodes"
    table = Table("part", "ms", "error", title=f"A Newton step of {size}, one thread")
    table.add_row(
        "stiffness of the elements", f"{_each(lambda: model.assemble(positions, None)):.1f}", ""
    )
    table.add_row(
        "forces of the elements",
        f"{_each(lambda: model.assemble(positions, None, tangent=False)):.1f}",
        "",
    )
    table.add_section()
    whole, entries = upper + upper.T - sp.diags_array(upper.diagonal()), upper.data.copy()
    for name in SOLVERS:
        for single in (True, False) if name == "pardiso" else (False,):
            factor = factor_of(
                sp.csr_matrix((entries.copy(), upper.indices, upper.indptr), shape=upper.shape),
                name,
                single=single,
            )
            factor.factorise(entries)
            step = factor.approximate(right)
            wrong = float(np.linalg.norm(step - factor.solve(right)) / np.linalg.norm(step))
            left = float(
                np.linalg.norm(whole @ factor.solve(right) - right) / np.linalg.norm(right)
            )
            if wrong > DIGITS[single] or left > DIGITS[False]:
                raise RuntimeError(
                    f"{name}: the error of a step is {wrong:.1g}, and a solution leaves "
                    f"{left:.1g} of the load"
                )
            kind = f"{name}, {'single' if single else 'double'} precision"
            table.add_row(
                f"factor, {kind}", f"{_each(partial(_anew, factor, count(1), entries)):.1f}", ""
            )
            table.add_row(
                f"step, {kind}", f"{_each(partial(factor.approximate, right)):.2f}", f"{wrong:.0e}"
            )
    return [table]
