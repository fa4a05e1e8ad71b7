"""The terms that stiffening and fibres add to the virtual block's law: derivatives, closed forms,
and nothing where neutral.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq, fmin

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.solver.holzapfel_fibres import (
    CURVING,
    assemble_fibres,
    fibre_energy,
    fibre_modulus,
)
from palpate.synthetic.solver.mooney_rivlin import assemble_solid, constants, solid_energy
from palpate.synthetic.solver.stiffening_laws import assemble_stiffening, stiffening_energy
from palpate.synthetic.solver.tet_block import TetBlock, TetGrading, mesh_block

SIZE = (0.03, 0.02, 0.02)
MODULUS = 5e3
NU = 0.45
SHEAR = MODULUS / (2 * (1 + NU))
ALONG = np.array([np.cos(0.7), np.sin(0.7), 0.0])

Energy = Callable[[FloatArray], float]
Assemble = Callable[[FloatArray, FloatArray, FloatArray], None]


@pytest.fixture(scope="module")
def block() -> TetBlock:
    return mesh_block(SIZE, TetGrading(np.zeros((1, 3)), np.zeros(1), np.full(1, 12e-3), 12e-3))


def _terms(block: TetBlock) -> dict[str, tuple[Energy, Assemble]]:
    grid = (block.elements, block.gradients, block.weights)
    # Different in every point, as they are with a skin on top.
    stiff = MODULUS * (1 + block.places[..., 2] / SIZE[2])
    return {
        "stiffening": (
            lambda u: stiffening_energy(u, *grid, stiff, 1.3),
            lambda u, stiffness, force: assemble_stiffening(u, *grid, stiff, 1.3, stiffness, force),
        ),
        "exponential": (
            lambda u: stiffening_energy(u, *grid, stiff, 1.3, True),
            lambda u, stiffness, force: assemble_stiffening(
                u, *grid, stiff, 1.3, stiffness, force, True
            ),
        ),
        "fibres": (
            lambda u: fibre_energy(u, *grid, stiff, ALONG),
            lambda u, stiffness, force: assemble_fibres(u, *grid, stiff, ALONG, stiffness, force),
        ),
    }


def _bent(block: TetBlock) -> FloatArray:
    """A displacement (n, 3) [m] with stretches between about 0.7 and 1.4 everywhere else."""
    rng = np.random.default_rng(2)
    return block.nodes @ rng.uniform(-0.2, 0.2, (3, 3)) + 3e-4 * rng.normal(size=block.nodes.shape)


def _answer(block: TetBlock, assemble: Assemble, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Element stiffness with its lower half filled in (e, 10, 10, 3, 3) [N/m], and force (n, 3)
    [N].
    """
    stiffness, force = np.zeros((len(block.elements), 10, 10, 3, 3)), np.zeros_like(u)
    assemble(u, stiffness, force)
    lower = np.tril_indices(10, -1)
    stiffness[:, lower[0], lower[1]] = np.swapaxes(stiffness[:, lower[1], lower[0]], 2, 3)
    return stiffness, force


@pytest.mark.parametrize("term", ["stiffening", "fibres"])
def test_force_is_the_slope_of_the_energy(block: TetBlock, term: str) -> None:
    energy, assemble = _terms(block)[term]
    u, rng, step = _bent(block), np.random.default_rng(3), 1e-7
    _, force = _answer(block, assemble, u)
    for _ in range(5):
        way = rng.normal(size=u.shape)
        slope = (energy(u + step * way) - energy(u - step * way)) / (2 * step)
        assert slope == pytest.approx(float(np.sum(force * way)), rel=1e-6)


@pytest.mark.parametrize("term", ["stiffening", "fibres"])
def test_stiffness_is_the_slope_of_the_force(block: TetBlock, term: str) -> None:
    _, assemble = _terms(block)[term]
    u, rng, step = _bent(block), np.random.default_rng(4), 1e-7
    stiffness, _ = _answer(block, assemble, u)
    way = np.asarray(rng.normal(size=u.shape))
    slope = (
        _answer(block, assemble, u + step * way)[1] - _answer(block, assemble, u - step * way)[1]
    ) / (2 * step)
    product = np.zeros_like(u)
    np.add.at(product, block.elements, np.einsum("eabij,ebj->eai", stiffness, way[block.elements]))
    assert product == pytest.approx(slope, rel=1e-5, abs=1e-6 * float(np.abs(slope).max()))


@pytest.mark.parametrize("term", ["stiffening", "fibres"])
def test_turned_block_stores_as_much(block: TetBlock, term: str) -> None:
    energy, _ = _terms(block)[term]
    turn = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    u = _bent(block)
    assert energy((block.nodes + u) @ turn.T - block.nodes) == pytest.approx(energy(u), rel=1e-10)


def test_stiffening_stores_what_gent_does_above_neo_hooke(block: TetBlock) -> None:
    grid = (block.elements, block.gradients, block.weights)
    shear, limit, stretch = np.full(block.weights.shape, SHEAR), 2.5, 1.4
    u = block.nodes * (stretch - 1, stretch**-0.5 - 1, stretch**-0.5 - 1)
    strain = stretch**2 + 2 / stretch - 3
    gent = -SHEAR * limit / 2 * np.log(1 - strain / limit) - SHEAR / 2 * strain
    assert stiffening_energy(u, *grid, shear, limit) == pytest.approx(
        gent * np.prod(SIZE), rel=1e-9
    )
    assert stiffening_energy(1.2 * block.nodes, *grid, shear, limit) == pytest.approx(
        0.0, abs=1e-12
    )


def test_exponential_law_begins_like_gents_and_has_no_limit(block: TetBlock) -> None:
    grid = (block.elements, block.gradients, block.weights)
    shear = np.full(block.weights.shape, SHEAR)
    little, far = block.nodes * (0.02, -0.01, -0.01), block.nodes * (1.0, -0.3, -0.3)
    gent = stiffening_energy(little, *grid, shear, 1.5)
    assert stiffening_energy(little, *grid, shear, 1.5, True) == pytest.approx(gent, rel=2e-3)
    assert np.isfinite(stiffening_energy(far, *grid, shear, 1.5, True))


def test_block_stretched_to_the_limit_stores_without_bound(block: TetBlock) -> None:
    grid, shear = (
        (block.elements, block.gradients, block.weights),
        np.full(block.weights.shape, SHEAR),
    )
    assert stiffening_energy(block.nodes * (1.0, -0.3, -0.3), *grid, shear, 1.5) == np.inf


def test_material_without_a_limit_or_with_fibres_as_stiff_as_itself_gains_nothing(
    block: TetBlock,
) -> None:
    grid, shear = (
        (block.elements, block.gradients, block.weights),
        np.full(block.weights.shape, SHEAR),
    )
    stiffness, force = np.zeros((len(block.elements), 10, 10, 3, 3)), np.zeros_like(block.nodes)
    assemble_stiffening(_bent(block), *grid, shear, 1e9, stiffness, force)
    plain, pulled = np.zeros_like(stiffness), np.zeros_like(force)
    c10, c01, lame = constants(np.full(block.weights.shape, MODULUS), NU)
    assemble_solid(_bent(block), *grid, c10, c01, lame.mean(axis=1), plain, pulled)
    assert np.abs(stiffness).max() < 1e-8 * np.abs(plain).max()
    assert np.abs(force).max() < 1e-8 * np.abs(pulled).max()
    assert fibre_modulus(1.0, NU) == 0.0


class _Bar:
    """A block stretched evenly along x while its sides are free."""

    def __init__(
        self,
        block: TetBlock,
        angle: float = 0.0,
        ratio: float = 1.0,
        limit: float | None = None,
        nu: float = NU,
    ) -> None:
        self.block, self.limit = block, limit
        self.direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        self.fibres = np.full(block.weights.shape, fibre_modulus(ratio, nu) * MODULUS)
        c10, c01, lame = constants(np.full(block.weights.shape, MODULUS), nu)
        self.shear, self.constants = 2 * (c10 + c01), (c10, c01, lame.mean(axis=1))

    def energy(self, stretches: FloatArray) -> float:
        """Per volume [Pa]."""
        u, grid = (
            self.block.nodes * (stretches - 1),
            (self.block.elements, self.block.gradients, self.block.weights),
        )
        total = solid_energy(u, *grid, *self.constants) + fibre_energy(
            u, *grid, self.fibres, self.direction
        )
        total += 0.0 if self.limit is None else stiffening_energy(u, *grid, self.shear, self.limit)
        return float(total / np.prod(SIZE))

    def least(self, stretch: float) -> float:
        """Energy per volume [Pa] with sides that settle."""

        def relative(sides: FloatArray) -> float:
            return self.energy(np.array([stretch, *sides])) / MODULUS

        best = fmin(relative, np.full(2, stretch**-0.45), xtol=1e-9, ftol=1e-14, disp=False)
        return self.energy(np.array([stretch, *best]))

    def pull(self, stretch: float, step: float = 1e-3) -> float:
        """Force over the area at rest [Pa]."""
        return (self.least(stretch + step) - self.least(stretch - step)) / (2 * step)


@pytest.mark.parametrize("ratio", [1.0, 2.5, 5.0])
def test_modulus_along_the_fibres_is_so_many_times_that_across(
    block: TetBlock, ratio: float
) -> None:
    step = 2e-3
    along, across = (
        (bar.pull(1 + step, step / 2) - bar.pull(1 - step, step / 2)) / (2 * step)
        for bar in (_Bar(block, angle, ratio) for angle in (0.0, np.pi / 2))
    )
    assert along / across == pytest.approx(ratio, rel=2e-3)
    assert along == pytest.approx(MODULUS * (1 + fibre_modulus(ratio, NU)), rel=2e-3)


@pytest.mark.parametrize("stretch", [0.8, 1.25])
def test_bar_pulled_along_its_fibres_is_the_bare_bar_and_the_fibres(
    block: TetBlock, stretch: float
) -> None:
    strain = stretch**2 - 1
    tension = (
        fibre_modulus(4.0, NU)
        * MODULUS
        / 2
        * strain
        * stretch
        * np.exp(CURVING * max(strain, 0.0) ** 2)
    )
    assert _Bar(block, 0.0, 4.0).pull(stretch) == pytest.approx(
        _Bar(block).pull(stretch) + tension, rel=1e-3
    )


def test_nearly_incompressible_bar_stiffens_as_gents_does(block: TetBlock) -> None:
    """What a limit adds to the pull of an incompressible bar is mu (1 / (1 - x / J_m) - 1) (l - 1 /
    l^2).
    """
    limit, stretch, nu = 1.5, 1.35, 0.4995
    strain = stretch**2 + 2 / stretch - 3
    gent = MODULUS / (2 * (1 + nu)) * (1 / (1 - strain / limit) - 1) * (stretch - stretch**-2)
    stiffer, bare = _Bar(block, limit=limit, nu=nu).pull(stretch), _Bar(block, nu=nu).pull(stretch)
    assert stiffer - bare == pytest.approx(gent, rel=0.01)


def test_stretch_at_which_the_limit_is_reached_is_gents(block: TetBlock) -> None:
    limit = 0.9
    last = brentq(lambda stretch: stretch**2 + 2 / stretch - 3 - limit, 1.0, 3.0)
    bar = _Bar(block, limit=limit)
    assert np.isfinite(
        bar.energy(np.array([0.999 * last, (0.999 * last) ** -0.5, (0.999 * last) ** -0.5]))
    )
    assert (
        bar.energy(np.array([1.001 * last, (1.001 * last) ** -0.5, (1.001 * last) ** -0.5]))
        == np.inf
    )
