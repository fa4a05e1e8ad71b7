"""Fibres along one direction, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from free_body import stretched_bar
from scipy.optimize import brentq

from palpate.fem.constitutive.elastic import Law, lame, reinforcement
from palpate.mesh.elements import HEXAHEDRA

ORDERS = pytest.mark.parametrize("order", HEXAHEDRA)


@ORDERS
@pytest.mark.parametrize("poisson_ratio", [0.3, 0.45])
@pytest.mark.parametrize("ratio", [1.5, 4.0])
def test_small_strain_stiffness_ratio_is_the_stated_one(order, ratio, poisson_ratio):
    gamma, step = reinforcement(ratio, poisson_ratio), 2e-3

    def modulus(angle: float) -> float:
        pulls = [
            stretched_bar(Law(gamma=gamma, angle=angle), order, poisson_ratio, 1 + sign * step)[0]
            for sign in (1, -1)
        ]
        return (pulls[0] - pulls[1]) / (2 * step)

    assert modulus(0.0) / modulus(np.pi / 2) == pytest.approx(ratio, rel=1e-4)


@ORDERS
@pytest.mark.parametrize("stretch", [0.8, 1.3])
def test_stretch_along_the_fibres_is_that_of_the_closed_form(order, stretch):
    poisson_ratio, gamma = 0.45, 1.2
    mu, kappa = lame(Law(), poisson_ratio)

    def matrix(across: float) -> tuple[float, float]:
        """Stresses along and across of the material without its fibres, which pull along alone."""
        volume, square = stretch * across**2, stretch**2 + 2 * across**2
        pressure = kappa / 2 * (volume - 1 / volume)
        along, aside = (
            mu * volume ** (-2 / 3) * (one - square / (3 * one)) + pressure * volume / one
            for one in (stretch, across)
        )
        return along, aside

    across = brentq(
        lambda value: matrix(value)[1], 0.8 * stretch**-0.5, 1.2 * stretch**-0.3, xtol=1e-14
    )
    pull, measured = stretched_bar(Law(gamma=gamma), order, poisson_ratio, stretch)
    assert measured == pytest.approx(across, rel=1e-9)
    assert pull == pytest.approx(
        matrix(across)[0] + 2 * gamma * mu * (stretch**2 - 1) * stretch, rel=1e-9
    )


@ORDERS
def test_contracts_less_along_the_fibres_when_pulled_across(order):
    _, (along, across) = stretched_bar(Law(gamma=1.2, angle=np.pi / 2), order, 0.45, 1.1)
    _, (free, _) = stretched_bar(Law(), order, 0.45, 1.1)
    assert across < free < along < 1
