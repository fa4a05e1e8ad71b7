from __future__ import annotations

import numpy as np

from palpate.fem.secant_pairs import SecantPairs


def _residuals(rounds: int, pairs: SecantPairs | None) -> list[float]:
    """Norms of b - A x while x is found with a tangent that is wrong along three directions."""
    rng = np.random.default_rng(0)
    size, kept = 200, np.diag(rng.uniform(1.0, 3.0, 200))
    along = np.linalg.qr(rng.normal(size=(size, 3)))[0]
    right = kept + along @ np.diag([0.8, 0.5, -0.4]) @ along.T
    load, place, norms = rng.normal(size=size), np.zeros(size), []
    for _ in range(rounds):
        residual = right @ place - load
        norms.append(float(np.linalg.norm(residual)))
        plain = -np.linalg.solve(kept, residual)
        place = place + (plain if pairs is None else pairs.corrected(plain))
    return norms


def test_pairs_correct_a_tangent_that_is_wrong_along_few_directions():
    plain, corrected = _residuals(9, None), _residuals(9, SecantPairs())
    assert corrected[1] == plain[1]
    assert corrected[-1] < 1e-4 * plain[-1]


def test_a_new_sequence_keeps_what_was_learned_and_pairs_no_unrelated_steps():
    pairs = SecantPairs()
    _residuals(9, pairs)
    pairs.begin()
    again = _residuals(4, pairs)
    assert again[2] < 0.1 * _residuals(4, None)[2]


def test_the_first_step_and_an_exact_tangent_are_left_as_they_are():
    pairs, step = SecantPairs(), np.array([1.0, -2.0, 0.5])
    assert np.array_equal(pairs.corrected(step), step)
    assert np.allclose(pairs.corrected(np.zeros(3)), 0.0)  # the step before left no residual
    assert np.allclose(pairs.corrected(step), step, atol=1e-12)
