from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np
import pytest
from free_body import FreeBody, distorted, grid, stretched_bar
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from palpate.fem.constitutive.elastic import Law, lame
from palpate.fem.constitutive.stiffness_field import log_stiffness
from palpate.mesh.elements import HEXAHEDRA, Quadrature, quadrature
from palpate.setup.setup import Box, Layer, Material

NEO_HOOKE, COROTATIONAL, GENT, FIBRED = (
    Law(),
    Law(corotational=True),
    Law(stiffening=0.2),
    Law(gamma=1.5, angle=0.6),
)


def _laws(**laws: Law) -> pytest.MarkDecorator:
    """Parametrise a test by these laws and each order."""
    cases = [
        pytest.param(law, order, id=f"{name}-{order}")
        for (name, law), order in product(laws.items(), HEXAHEDRA)
    ]
    return pytest.mark.parametrize(("law", "order"), cases)


EACH = _laws(neo_hooke=NEO_HOOKE, corotational=COROTATIONAL, gent=GENT)
EVERY = _laws(neo_hooke=NEO_HOOKE, corotational=COROTATIONAL, gent=GENT, fibres=FIBRED)
ORDERS = pytest.mark.parametrize("order", HEXAHEDRA)
AFFINE = np.array([[1.20, 0.10, -0.05], [0.03, 0.85, 0.12], [-0.08, 0.02, 1.10]])


def _uneven(spread: float, rule: Quadrature) -> np.ndarray:
    return np.asarray(spread * np.random.default_rng(2).standard_normal(rule.weights.shape))


def _loose(
    law: Law, order: int, poisson_ratio: float = 0.45, seed: int = 0, spread: float = 0.5
) -> FreeBody:
    """A small unsupported block of distorted elements whose stiffness varies from point to
    point.
    """
    mesh = grid((0.05, 0.03, 0.02), (5, 5, 3), order)
    nowhere = np.zeros((len(mesh.nodes), 3), dtype=bool)
    return FreeBody(
        mesh, distorted(mesh, 0.25, seed), law, poisson_ratio, nowhere, partial(_uneven, spread)
    )


def _bent(body: FreeBody, seed: int) -> np.ndarray:
    """Positions strained by some ten percent, differently at each node."""
    noise = np.random.default_rng(seed).normal(0, 1, body.nodes.shape)
    return body.nodes @ AFFINE.T + 4e-4 * noise


@ORDERS
def test_weights_of_distorted_elements_add_up_to_the_volume(order):
    mesh = grid((0.05, 0.03, 0.02), (5, 5, 3), order)
    rule = quadrature(HEXAHEDRA[order], distorted(mesh, 0.25, 1)[mesh.hexahedra])
    assert rule.weights.sum() == pytest.approx(0.05 * 0.03 * 0.02, rel=1e-12)


@ORDERS
def test_pressures_are_orthonormal_over_each_element(order):
    mesh = grid((0.05, 0.03, 0.02), (5, 5, 3), order)
    rule = quadrature(HEXAHEDRA[order], distorted(mesh, 0.2, 1)[mesh.hexahedra])
    products = np.einsum("eq,eqm,eqn->emn", rule.weights, rule.pressures, rule.pressures)
    assert np.abs(products - np.eye(products.shape[1])).max() < 1e-12


@EACH
def test_patch_test_leaves_no_force_inside_distorted_elements(law, order):
    mesh = grid((0.05, 0.03, 0.02), (5, 5, 5), order)
    held = np.zeros((len(mesh.nodes), 3), dtype=bool)
    body = FreeBody(mesh, distorted(mesh, 0.3, 3), law, 0.45, held)
    force, _ = body.assemble(body.nodes @ AFFINE.T)
    low, high = mesh.nodes.min(axis=0), mesh.nodes.max(axis=0)
    inside = np.all((mesh.nodes > low + 1e-9) & (mesh.nodes < high - 1e-9), axis=1)
    assert inside.sum() == 27
    assert np.abs(force[inside]).max() < 1e-13 * np.abs(force).max()


@EVERY
def test_patch_test_finds_the_affine_field_from_its_boundary(law, order):
    mesh = grid((0.05, 0.03, 0.02), (5, 5, 5), order)
    low, high = mesh.nodes.min(axis=0), mesh.nodes.max(axis=0)
    inside = np.all((mesh.nodes > low + 1e-9) & (mesh.nodes < high - 1e-9), axis=1)
    body = FreeBody(
        mesh, distorted(mesh, 0.2, 4), law, 0.45, np.repeat(~inside[:, None], 3, axis=1)
    )
    wanted = body.nodes @ AFFINE.T
    start = wanted + np.where(
        inside[:, None], np.random.default_rng(1).normal(0, 2e-4, wanted.shape), 0.0
    )
    found, _ = body.equilibrium(start)
    assert np.abs(found - wanted).max() < 1e-12


@EVERY
def test_force_is_the_gradient_of_the_energy(law, order):
    body = _loose(law, order)
    positions = _bent(body, 2)
    force, _ = body.assemble(positions)
    direction = np.random.default_rng(3).normal(0, 1, positions.shape)
    step = 1e-7
    slope = (
        body.energy(positions + step * direction) - body.energy(positions - step * direction)
    ) / (2 * step)
    assert slope == pytest.approx(np.vdot(force, direction), rel=1e-7)


@EVERY
@pytest.mark.parametrize("poisson_ratio", [0.0, 0.45, 0.49])
def test_tangent_is_the_derivative_of_the_force(law, order, poisson_ratio):
    body = _loose(law, order, poisson_ratio)
    positions = _bent(body, 5)
    tangent = body.tangent(positions)
    direction = np.random.default_rng(6).normal(0, 1, positions.shape)
    step = 1e-7
    ahead, behind = (body.assemble(positions + sign * step * direction)[0] for sign in (1, -1))
    numeric = ((ahead - behind) / (2 * step)).ravel()
    assert np.abs(tangent @ direction.ravel() - numeric).max() < 2e-8 * np.abs(numeric).max()
    assert np.array_equal(tangent, tangent.T)


@EVERY
def test_rigid_motion_leaves_no_stress_and_no_energy(law, order):
    body = _loose(law, order)
    turn = Rotation.from_rotvec([0.9, -1.7, 0.6]).as_matrix()
    moved = body.nodes @ turn.T + np.array([0.1, -0.2, 0.05])
    force, _ = body.assemble(moved)
    strained, _ = body.assemble(_bent(body, 1))
    assert np.abs(force).max() < 1e-13 * np.abs(strained).max()
    assert abs(body.energy(moved)) < 1e-14 * body.energy(_bent(body, 1))


@EVERY
def test_energy_does_not_change_with_a_rotation_of_the_strained_body(law, order):
    body = _loose(law, order)
    positions = _bent(body, 7)
    turn = Rotation.from_rotvec([-0.4, 1.1, 2.0]).as_matrix()
    assert body.energy(positions @ turn.T) / body.energy(positions) == pytest.approx(1.0, abs=1e-12)


@EVERY
def test_inverted_element_has_infinite_energy(law, order):
    body = _loose(law, order)
    assert body.energy(body.nodes * np.array([1.0, 1.0, -1.0])) == np.inf


@EACH
def test_small_strain_of_each_law_is_that_of_hooke(law, order):
    body = _loose(law, order, 0.3, spread=0.0)
    strain = 1e-6 * np.array([[1.0, 0.4, 0.0], [0.4, -0.5, 0.2], [0.0, 0.2, 0.3]])
    mu, lam = 0.5 / 1.3, 0.3 / (1.3 * 0.4)
    volume = 0.05 * 0.03 * 0.02
    wanted = volume * (mu * (strain**2).sum() + lam / 2 * np.trace(strain) ** 2)
    assert body.energy(body.nodes @ (np.eye(3) + strain).T) / wanted == pytest.approx(1.0, rel=1e-3)


@ORDERS
@pytest.mark.parametrize("law", [NEO_HOOKE, GENT], ids=["neo_hooke", "gent"])
@pytest.mark.parametrize("stretch", [0.7, 0.9, 1.3, 1.8])
@pytest.mark.parametrize("poisson_ratio", [0.3, 0.45])
def test_bar_force_is_that_of_the_closed_form(stretch, poisson_ratio, law, order):
    mu, kappa = lame(law, poisson_ratio)

    def stress(across: float) -> tuple[float, float]:
        volume, square = stretch * across**2, stretch**2 + 2 * across**2
        pressure = kappa / 2 * (volume - 1 / volume)
        harder = mu * volume ** (-2 / 3) / (1 - law.stiffening * (volume ** (-2 / 3) * square - 3))
        along, aside = (
            harder * (one - square / (3 * one)) + pressure * volume / one
            for one in (stretch, across)
        )
        return along, aside

    across = brentq(
        lambda value: stress(value)[1], 0.8 * stretch**-0.5, 1.2 * stretch**-0.3, xtol=1e-14
    )
    pull, measured = stretched_bar(law, order, poisson_ratio, stretch)
    assert measured == pytest.approx(across, rel=1e-9)
    assert pull == pytest.approx(stress(across)[0], rel=1e-9)


@ORDERS
def test_corotational_bar_is_linear_in_its_stretch(order):
    pull, across = stretched_bar(COROTATIONAL, order, 0.3, 1.4)
    assert pull == pytest.approx(0.4, rel=1e-9)
    assert across == pytest.approx(1 - 0.3 * 0.4, rel=1e-9)


def _line_weights(at: np.ndarray, length: float, order: int) -> np.ndarray:
    """Share of an even load on nodes at these coordinates of a line: by the trapezium rule, or
    Simpson's.
    """
    number = np.round((at + length / 2) / (length / 4)).astype(int)
    ends = np.abs(at) > length / 2 - 1e-9
    if order == 1:
        return np.where(ends, 0.5, 1.0)
    return np.where(ends, 1.0, np.where(number % 2 == 1, 4.0, 2.0))


def _tip_ratio(
    law: Law, poisson_ratio: float, along: int, across: int = 4, order: int = 1
) -> float:
    """Deflection of a cantilever, length over height 8, over Timoshenko's."""
    length, height = 0.08, 0.01
    mesh = grid((length, height, height), (along + 1, across + 1, across + 1), order)
    nodes = mesh.nodes - np.array([mesh.nodes[:, 0].min(), 0.0, height / 2])
    root = nodes[:, 0] < 1e-9
    held = np.zeros(nodes.shape, dtype=bool)
    held[root, 0] = True  # free to contract sideways, as beam theory has it
    held[root & (np.abs(nodes[:, 1]) < 1e-9), 1] = True
    held[root & (np.abs(nodes[:, 2]) < 1e-9), 2] = True
    body = FreeBody(mesh, nodes, law, poisson_ratio, held)
    tip = np.flatnonzero(nodes[:, 0] > length - 1e-9)
    weight = np.prod([_line_weights(nodes[tip, a], height, order) for a in (1, 2)], axis=0)
    load = np.zeros(nodes.shape)
    load[tip, 2] = 3e-9 * weight / weight.sum()
    positions, _ = body.equilibrium(nodes, load, tolerance=1e-6)
    inertia, area, shear = height**4 / 12, height**2, 0.5 / (1 + poisson_ratio)
    coefficient = 10 * (1 + poisson_ratio) / (12 + 11 * poisson_ratio)
    theory = 3e-9 * (length**3 / (3 * inertia) + length / (coefficient * shear * area))
    return float((positions - nodes)[tip, 2].mean() / theory)


@EACH
def test_cantilever_deflection_is_timoshenkos(law, order):
    along, within = (48, 0.03) if order == 1 else (16, 0.005)
    assert _tip_ratio(law, 0.3, along, order=order) == pytest.approx(1.0, abs=within)


def test_cantilever_converges_with_refinement_along_it():
    errors = [1 - _tip_ratio(NEO_HOOKE, 0.3, along, 6) for along in (12, 24, 48)]
    assert errors[0] > 2.5 * errors[1] > 5 * errors[2] > 0


@ORDERS
def test_bending_does_not_lock_towards_incompressibility(order):
    along = 48 if order == 1 else 16
    assert _tip_ratio(NEO_HOOKE, 0.4999, along, order=order) > 0.97 * _tip_ratio(
        NEO_HOOKE, 0.3, along, order=order
    )


def test_gent_material_cannot_be_stretched_past_its_limit():
    body = _loose(Law(stiffening=2.0), 1)  # J_m = 0.5
    assert np.isfinite(body.energy(body.nodes * np.array([1.3, 1.3**-0.5, 1.3**-0.5])))
    assert body.energy(body.nodes * np.array([1.7, 1.7**-0.5, 1.7**-0.5])) == np.inf


def test_gent_material_with_a_far_limit_is_neo_hookean():
    bodies = [_loose(law, 2) for law in (NEO_HOOKE, Law(stiffening=1e-9))]
    positions = _bent(bodies[0], 3)
    (plain, _), (far, _) = (body.assemble(positions) for body in bodies)
    assert np.allclose(far, plain, rtol=1e-7, atol=1e-9 * np.abs(plain).max())


def _of(material: Material, geometry: Box, rule: Quadrature) -> np.ndarray:
    return log_stiffness(material, rule, geometry)


@ORDERS
@pytest.mark.parametrize("log_ratio", [0.0, 2.0])
def test_column_of_uneven_stiffness_deforms_as_springs_in_series(log_ratio, order):
    height, layer = 0.02, Layer(thickness=0.005, stiffness_ratio=4.0)
    mesh = grid((6e-4, 6e-4, height), (3, 3, 65), order)
    sides, top = np.abs(mesh.nodes[:, 2]) < 1e-9, mesh.nodes[:, 2] > height - 1e-9
    held = np.zeros(mesh.nodes.shape, dtype=bool)
    held[sides | top, 2] = True
    held[:, :2] = True  # with nu = 0 nothing pushes sideways
    material = Material(poisson_ratio=0.0, layer=layer, log_ratio=log_ratio)
    uneven = partial(_of, material, Box(size=(0.04, 0.04, height)))
    body = FreeBody(mesh, mesh.nodes, NEO_HOOKE, 0.0, held, log_stiffness=uneven)
    pressed = mesh.nodes + np.where(top, -1e-6, 0.0)[:, None] * (0, 0, 1)
    _, force = body.equilibrium(pressed, tolerance=1e-7)
    z = np.linspace(0, height, 200_001)
    stiffness = np.exp(log_ratio * (z / height - 0.5)) * np.where(
        z > height - layer.thickness, 4.0, 1.0
    )
    wanted = -1e-6 * 6e-4**2 / np.trapezoid(1 / stiffness, z)
    assert force[top, 2].sum() / wanted == pytest.approx(1.0, rel=5e-3)
