from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from core.fem.linear import NotPositiveDefinite, SparseCholesky, face_slots, upper_pattern
from core.mesh import GridSpec, box_mesh


def _chain(count: int, diagonal: float) -> sp.csr_matrix:
    """Upper triangle of a chain of springs."""
    return sp.csr_matrix(sp.diags([np.full(count, diagonal), np.full(count - 1, -1.0)], [0, 1]))


def _whole(upper: sp.csr_matrix) -> np.ndarray:
    dense = upper.toarray()
    return dense + np.triu(dense, 1).T


def test_factor_solves_one_and_several_right_sides():
    upper = _chain(40, 2.1)
    factor = SparseCholesky(upper.copy())
    factor.factorise(upper.data)
    right = np.random.default_rng(0).normal(size=(40, 3))
    assert np.allclose(_whole(upper) @ factor.solve(right), right, atol=1e-12)
    assert np.allclose(_whole(upper) @ factor.solve(right[:, 0].copy()), right[:, 0], atol=1e-12)


def test_second_factor_of_the_same_pattern_replaces_the_first():
    upper = _chain(20, 2.5)
    factor = SparseCholesky(upper.copy())
    right = np.arange(20.0)
    for scale in (1.0, 4.0):
        factor.factorise(scale * upper.data)
        assert np.allclose(scale * _whole(upper) @ factor.solve(right), right, atol=1e-11)


def test_indefinite_matrix_is_refused_and_the_next_good_one_taken():
    upper = _chain(20, 0.5)
    factor = SparseCholesky(upper.copy())
    with pytest.raises(NotPositiveDefinite):
        factor.factorise(upper.data)
    good = _chain(20, 3.0)
    factor.factorise(good.data)
    assert np.allclose(_whole(good) @ factor.solve(np.ones(20)), 1.0, atol=1e-12)


def test_two_factors_do_not_disturb_each_other():
    first, second = _chain(15, 2.5), _chain(25, 3.5)
    factors = [SparseCholesky(upper.copy()) for upper in (first, second)]
    for factor, upper in zip(factors, (first, second), strict=True):
        factor.factorise(upper.data)
    assert np.allclose(_whole(first) @ factors[0].solve(np.ones(15)), 1.0, atol=1e-12)
    del factors[0]
    assert np.allclose(_whole(second) @ factors[0].solve(np.ones(25)), 1.0, atol=1e-12)


def test_pattern_holds_every_entry_of_every_element_once():
    mesh = box_mesh((0.03, 0.02, 0.02), GridSpec(nodes=(4, 3, 3)))
    unknown = np.arange(3 * len(mesh.nodes)).reshape(-1, 3)
    unknown[mesh.base_nodes] = -1
    free = unknown >= 0
    unknown[free] = np.arange(free.sum())
    pattern, slots = upper_pattern(mesh.hexahedra, unknown)
    rng = np.random.default_rng(2)
    data, wanted = np.zeros(pattern.nnz), np.zeros((free.sum(), free.sum()))
    for element, slot in zip(mesh.hexahedra, slots, strict=True):
        block = rng.normal(size=(24, 24))
        block += block.T
        np.add.at(data, slot[slot >= 0], block[slot >= 0])
        numbers = unknown[element].ravel()
        used = numbers >= 0
        wanted[np.ix_(numbers[used], numbers[used])] += block[np.ix_(used, used)]
    pattern.data = data
    assert np.allclose(_whole(pattern), wanted)
    on_top = face_slots(pattern, mesh.faces["+z"], unknown)
    corner = unknown[mesh.faces["+z"][0, 1], 2]
    assert pattern.indices[on_top[0, 5, 5]] == corner
