from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from palpate.fem.linalg import sparsity as linear
from palpate.fem.linalg.direct_solver import NotPositiveDefinite
from palpate.fem.linalg.sparsity import SOLVERS, face_slots, factor_of, upper_pattern
from palpate.fem.newton import Outcome
from palpate.fem.topology import topology
from palpate.mesh.box_mesh import GridSpec, box_mesh
from palpate.replay.replay import replay
from palpate.setup.setup import Box, Setup, Tool

EACH = pytest.mark.parametrize("solver", SOLVERS)


def _chain(count: int, diagonal: float) -> sp.csr_matrix:
    """Upper triangle of a chain of springs."""
    return sp.csr_matrix(sp.diags_array([[diagonal] * count, [-1.0] * (count - 1)], offsets=(0, 1)))


def _whole(upper: sp.csr_matrix) -> np.ndarray:
    dense = upper.toarray()
    return dense + np.triu(dense, 1).T


@EACH
def test_factor_solves_one_and_several_right_sides(solver):
    upper = _chain(40, 2.1)
    factor = factor_of(upper.copy(), solver)
    factor.factorise(upper.data)
    right = np.random.default_rng(0).normal(size=(40, 3))
    assert np.allclose(_whole(upper) @ factor.solve(right), right, atol=1e-12)
    assert np.allclose(_whole(upper) @ factor.solve(right[:, 0].copy()), right[:, 0], atol=1e-12)


@EACH
def test_second_factor_of_the_same_pattern_replaces_the_first(solver):
    upper = _chain(20, 2.5)
    factor = factor_of(upper.copy(), solver)
    right = np.arange(20.0)
    for scale in (1.0, 4.0):
        factor.factorise(scale * upper.data)
        assert np.allclose(scale * _whole(upper) @ factor.solve(right), right, atol=1e-11)


@EACH
def test_indefinite_matrix_is_refused_and_the_next_good_one_taken(solver):
    upper = _chain(20, 0.5)
    factor = factor_of(upper.copy(), solver)
    with pytest.raises(NotPositiveDefinite):
        factor.factorise(upper.data)
    good = _chain(20, 3.0)
    factor.factorise(good.data)
    assert np.allclose(_whole(good) @ factor.solve(np.ones(20)), 1.0, atol=1e-12)


def _grid(count: int) -> sp.csr_matrix:
    """Upper triangle of springs along the lines of a cube, each point weakly supported."""
    number = np.arange(count**3).reshape(count, count, count)
    pairs = [
        (number[:-1], number[1:]),
        (number[:, :-1], number[:, 1:]),
        (number[:, :, :-1], number[:, :, 1:]),
    ]
    rows, columns = (np.concatenate([pair[end].ravel() for pair in pairs]) for end in (0, 1))
    entries = np.concatenate([np.full(count**3, 6.3), np.full(len(rows), -1.0)])
    places = np.concatenate([number.ravel(), rows]), np.concatenate([number.ravel(), columns])
    return sp.csr_matrix((entries, places), shape=(count**3, count**3))


@EACH
def test_condensed_matrix_is_the_schur_complement_and_solves_with_any_values(solver):
    upper, right = _grid(9), np.random.default_rng(1).normal(size=729)
    factor, whole = factor_of(upper.copy(), solver), _whole(upper)
    for kept in (np.arange(700, 729), np.array([300, 5, 720]), np.array([8])):
        left_out = np.setdiff1d(np.arange(729), kept)
        inner, across = whole[np.ix_(left_out, left_out)], whole[np.ix_(left_out, kept)]
        wanted = whole[np.ix_(kept, kept)] - across.T @ np.linalg.solve(inner, across)
        for scale in (1.0, 3.0):
            made = factor.condense(scale * upper.data, kept)
            assert np.allclose(made.matrix, scale * wanted, atol=1e-12)
            reduced, partial = made.eliminate(right)
            balanced = np.asarray(np.linalg.solve(made.matrix, reduced), dtype=float)
            for values in (balanced, np.cos(np.asarray(kept, dtype=float))):
                found = made.substitute(partial, values)
                assert np.allclose(found[kept], values, atol=1e-12)
                assert np.allclose((scale * whole @ found)[left_out], right[left_out], atol=1e-11)
            assert made.stored
    factor.condense(2 * upper.data, kept)
    assert not made.stored


@EACH
def test_condensation_leaves_the_factor_of_the_whole_matrix_correct(solver):
    upper, kept = _grid(5), np.arange(40)
    factor = factor_of(upper.copy(), solver)
    for scale in (1.0, 2.0):
        factor.factorise(scale * upper.data)
        assert np.allclose(scale * _whole(upper) @ factor.solve(np.ones(125)), 1.0, atol=1e-12)
        factor.condense(5 * upper.data, kept)
    factor.factorise(2 * upper.data)
    assert np.allclose(2 * _whole(upper) @ factor.solve(np.ones(125)), 1.0, atol=1e-12)


@EACH
def test_indefinite_matrix_is_not_condensed(solver):
    upper = _grid(5)
    with pytest.raises(NotPositiveDefinite):
        factor_of(upper.copy(), solver).condense(-upper.data, np.arange(40))


def test_elimination_order_does_not_depend_on_earlier_matrices():
    pardiso = pytest.importorskip("palpate.fem.linalg.pardiso")
    upper, right = _grid(9), np.random.default_rng(1).normal(size=729)
    kept, others = np.arange(700, 729), np.arange(50)
    fresh, used = pardiso.Pardiso(upper.copy()), pardiso.Pardiso(upper.copy())
    used.factorise(upper.data)
    for unknowns in (others, np.arange(9), kept, np.arange(7)):
        used.condense(3 * upper.data, unknowns)
    one, other = (factor.condense(upper.data, kept) for factor in (fresh, used))
    assert np.array_equal(one.matrix, other.matrix)
    assert np.array_equal(one.eliminate(right)[1], other.eliminate(right)[1])


def test_wrong_schur_complements_are_logged_and_avoided(monkeypatch, caplog):
    pardiso = pytest.importorskip("palpate.fem.linalg.pardiso")
    upper, kept = _grid(7), np.arange(300, 343)
    factor, inverse = pardiso.Pardiso(upper.copy()), np.linalg.inv(_whole(upper))
    carry_out = pardiso._Handle.run

    def wrong(handle, phase, right=None):
        found = carry_out(handle, phase, right)
        return 1.001 * found if phase == pardiso._FORWARD else found

    monkeypatch.setattr(pardiso._Handle, "run", wrong)
    for scale in (1.0, 3.0):
        made = factor.condense(scale * upper.data, kept)
        reduced, partial = made.eliminate(np.ones(343))
        values = np.linalg.solve(made.matrix, reduced)
        assert np.allclose(scale * values, inverse[kept].sum(axis=1), atol=1e-12)
        assert np.allclose(
            scale * made.substitute(partial, values), inverse.sum(axis=1), atol=1e-12
        )
    assert caplog.text.count("wrong on this machine") == 1


def test_factor_is_kept_for_equal_entries_and_a_failed_one_is_not():
    pardiso = pytest.importorskip("palpate.fem.linalg.pardiso")
    upper = _grid(7)
    factor, numbers, indefinite = pardiso.Pardiso(upper.copy()), [], -upper.data
    for data in (upper.data, upper.data.copy(), 2 * upper.data):
        factor.factorise(data)
        numbers.append(factor.generation)
        assert np.allclose(
            data[0] / upper.data[0] * _whole(upper) @ factor.solve(np.ones(343)), 1.0, atol=1e-12
        )
    assert numbers == [1, 1, 2]
    for _ in range(2):
        with pytest.raises(NotPositiveDefinite):
            factor.factorise(indefinite)


def test_single_precision_factor_solves_to_double_precision():
    pardiso = pytest.importorskip("palpate.fem.linalg.pardiso")
    upper, kept, right = (
        _grid(9),
        np.arange(700, 729),
        np.random.default_rng(3).normal(size=(729, 3)),
    )
    factor, inverse = pardiso.Pardiso(upper.copy(), single=True), np.linalg.inv(_whole(upper))
    for scale in (1.0, 3.0):
        factor.factorise(scale * upper.data)
        near, exact = factor.approximate(right), factor.solve(right)
        # the factor is no double's
        assert 1e-9 < np.abs(scale * near - inverse @ right).max() < 1e-5
        assert np.abs(scale * exact - inverse @ right).max() < 1e-12
        assert np.abs(scale * factor.solve(right[:, 0]) - inverse @ right[:, 0]).max() < 1e-12
        made = factor.condense(scale * upper.data, kept)
        off = np.abs(scale * np.linalg.inv(made.matrix) - inverse[np.ix_(kept, kept)]).max()
        assert 1e-12 < off < 1e-6
    with pytest.raises(NotPositiveDefinite):
        factor.factorise(-upper.data)


def test_ill_conditioned_matrix_is_logged_and_solved_in_double(caplog):
    pardiso = pytest.importorskip("palpate.fem.linalg.pardiso")
    upper = _chain(20_000, 2.0)  # held at its ends alone: the condition number is 1.6e8
    places, factor = np.arange(1.0, 20_001), pardiso.Pardiso(upper.copy(), single=True)
    bent = places * (20_001 - places) / 2
    factor.factorise(upper.data)
    assert np.abs(factor.solve(np.ones(20_000)) - bent).max() < 1e-6 * bent.max()
    assert caplog.text.count("too ill-conditioned for single precision") == 1
    factor.factorise(2 * upper.data)
    assert np.abs(factor.approximate(np.ones(20_000)) - bent / 2).max() < 1e-6 * bent.max()


@EACH
def test_two_factors_do_not_disturb_each_other(solver):
    first, second = _chain(15, 2.5), _chain(25, 3.5)
    factors = [factor_of(upper.copy(), solver) for upper in (first, second)]
    for factor, upper in zip(factors, (first, second), strict=True):
        factor.factorise(upper.data)
    assert np.allclose(_whole(first) @ factors[0].solve(np.ones(15)), 1.0, atol=1e-12)
    del factors[0]
    assert np.allclose(_whole(second) @ factors[0].solve(np.ones(25)), 1.0, atol=1e-12)


@EACH
def test_singular_matrix_is_refused(solver):
    upper = sp.csr_matrix(np.triu([[1.0, -1.0], [-1.0, 1.0]]))
    with pytest.raises(NotPositiveDefinite):
        factor_of(upper.copy(), solver).factorise(upper.data)


def _without_mkl(pattern: sp.csr_matrix) -> None:
    raise ImportError("no MKL here")


def test_machine_without_mkl_logs_it_and_finds_the_same_equilibria(monkeypatch, caplog):
    setup = Setup(geometry=Box(size=(0.03, 0.02, 0.02)), tool=Tool(radius=4e-3), mass=0.02)
    centres, grid = (
        np.array([[0.0, 0.0, 0.024 - depth] for depth in (1e-3, 2e-3, 3e-3)]),
        GridSpec(nodes=(7, 5, 5)),
    )
    usual = replay(setup, centres, grid)
    monkeypatch.setitem(SOLVERS, "pardiso", _without_mkl)
    linear._best.cache_clear()
    topology.cache_clear()
    try:
        other = replay(setup, centres, grid)
    finally:
        linear._best.cache_clear()
        topology.cache_clear()
    assert "no pardiso on this machine (no MKL here)" in caplog.text
    for one, two in zip(usual, other, strict=True):
        assert one.outcome is two.outcome is Outcome.CONVERGED
        assert np.abs(one.displacement - two.displacement).max() < 1e-8


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
