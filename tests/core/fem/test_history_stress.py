"""A material with history at prescribed deformations, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.fem.constitutive.elastic import Law
from palpate.fem.history.history_stress import ConstantStress, constant_stress_force, shear_stress
from palpate.fem.history.material_points import CellPoints, QuadraturePoints
from palpate.fem.model import BlockModel, ToolSphere
from palpate.fem.newton import Outcome, solve
from palpate.fem.strain_tensors import cauchy_green
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import MeshError
from palpate.mesh.box_mesh import GridSpec, box_mesh
from palpate.replay.equilibrium import Equilibrium
from palpate.replay.material_history import MaterialHistory
from palpate.setup.setup import (
    Box,
    Fibres,
    Inclusion,
    Layer,
    Material,
    Relaxation,
    Setup,
    Support,
    Tool,
)

SIZE = (0.04, 0.03, 0.02)
ORDERS = pytest.mark.parametrize("order", [1, 2])
ONE, TWO = (
    (Relaxation(fraction=0.6, time_constant=2.0),),
    (Relaxation(fraction=0.3, time_constant=0.5), Relaxation(fraction=0.4, time_constant=10.0)),
)
MADE_OF = {
    "neo_hooke": Material(relaxation=ONE),
    "two terms": Material(relaxation=TWO),
    "gent": Material(relaxation=ONE, stretch_limit=3.0),
    "fibres": Material(relaxation=ONE, fibres=Fibres(direction=0.5, stiffness_ratio=3.0)),
    "lump and skin": Material(
        relaxation=ONE,
        inclusions=(Inclusion(x=0.0, y=0.0, z=0.01, radius=6e-3, stiffness_ratio=5.0),),
        layer=Layer(thickness=3e-3, stiffness_ratio=2.0),
    ),
}
MATERIALS = pytest.mark.parametrize("material", MADE_OF.values(), ids=MADE_OF)
SHEAR = np.array([[1.0, 0.0, 0.4], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
"""Keeps the volume, so that all stress is shear stress."""


class PrescribedBlock:
    """A block with prescribed node positions at given times."""

    def __init__(
        self,
        material: Material,
        order: int = 1,
        cells: bool = False,
        support: Support | None = None,
    ) -> None:
        self.setup = Setup(
            geometry=Box(size=SIZE),
            tool=Tool(radius=5e-3),
            material=material,
            support=support or Support(),
        )
        self.mesh = box_mesh(SIZE, GridSpec(nodes=(5, 5, 3), order=order))
        self.model = BlockModel(self.setup, self.mesh)
        self.material_history = MaterialHistory(
            self.setup,
            CellPoints(SIZE, (8, 6, 4)) if cells else QuadraturePoints(self.mesh),
            self.mesh,
        )
        self.material_history.start(self._frame(self.mesh.nodes, Outcome.CONVERGED))

    def _frame(self, positions: FloatArray, outcome: Outcome) -> Equilibrium:
        tool, nothing = ToolSphere(np.zeros(3), 5e-3), np.zeros(3)
        return Equilibrium(
            self.mesh,
            positions - self.mesh.nodes,
            np.zeros(2),
            tool,
            nothing,
            outcome,
            0,
            0.0,
            0.0,
            in_contact=True,
        )

    def force(
        self, positions: FloatArray, time: float, outcome: Outcome = Outcome.CONVERGED
    ) -> FloatArray:
        """Force on the unknowns (u,) over E [m^2]; the state is stored."""
        self.material_history.begin(time)
        self.material_history.apply_to(self.model, positions)
        found = self.model.assemble(positions, None, tangent=False).residual
        self.material_history.end(self._frame(positions, outcome))
        return found


def _sheared(held: PrescribedBlock, amount: float) -> FloatArray:
    return np.asarray(held.mesh.nodes @ (np.eye(3) + amount * (SHEAR - np.eye(3))).T)


def _elastic(held: PrescribedBlock, positions: FloatArray) -> FloatArray:
    return BlockModel(held.setup, held.mesh).assemble(positions, None, tangent=False).residual


def _bent(held: PrescribedBlock, seed: int) -> FloatArray:
    noise = np.array(4e-4 * np.random.default_rng(seed).standard_normal(held.mesh.nodes.shape))
    noise[held.mesh.base_nodes] = 0.0
    return np.asarray(_sheared(held, 0.5) + noise)


@pytest.mark.parametrize(
    "law",
    [Law(), Law(stiffening=0.2), Law(gamma=1.5, angle=0.6)],
    ids=["neo_hooke", "gent", "fibres"],
)
def test_shear_stress_is_the_derivative_of_the_energy(law):
    """S = 2 dW/dC of W = -1/(2 k) ln(1 - k x) + gamma/2 (I4 - 1)^2."""
    random = np.random.default_rng(0)
    tangents = np.eye(3) + 0.15 * random.standard_normal((20, 3, 3))
    c: FloatArray = cauchy_green(tangents)
    a = law.direction

    def energy(c: FloatArray) -> FloatArray:
        volume = np.linalg.det(c[:, [[0, 5, 4], [5, 1, 3], [4, 3, 2]]])
        x, fibre = (
            c[:, :3].sum(axis=1) / np.cbrt(volume) - 3,
            c[:, 0] * a[0] ** 2 + c[:, 1] * a[1] ** 2 + 2 * c[:, 5] * a[0] * a[1] - 1,
        )
        strained = (
            x / 2 if not law.stiffening else -np.log(1 - law.stiffening * x) / (2 * law.stiffening)
        )
        return np.asarray(strained + law.gamma / 2 * fibre**2)

    for k in range(6):
        step = 1e-6 * np.eye(6)[k]
        slope = (energy(c + step) - energy(c - step)) / 2e-6
        assert shear_stress(law, c)[:, k] == pytest.approx(
            (2 if k < 3 else 1) * slope, rel=1e-6, abs=1e-8
        )


@ORDERS
def test_force_and_tangent_are_derivatives_of_the_energy(order):
    held = PrescribedBlock(MADE_OF["lump and skin"], order)
    model, free = held.model, held.model.topology.free
    positions = _bent(held, 1)
    way = np.array(np.random.default_rng(2).standard_normal(held.mesh.nodes.shape))
    way[held.mesh.base_nodes] = 0.0
    held.force(_bent(held, 3), 0.0)
    held.material_history.begin(1.0)
    held.material_history.apply_to(model)
    assert model.added_potential is not None
    step = 1e-7
    ahead, behind = positions + step * way, positions - step * way
    wanted = (model.energy(ahead, None) - model.energy(behind, None)) / (2 * step)
    state = model.assemble(positions, None)
    assert state.residual @ way[free] == pytest.approx(wanted, rel=1e-6)
    upper = model.topology.pattern.copy()
    upper.data = state.data
    turned = upper @ way[free] + upper.T @ way[free] - upper.diagonal() * way[free]
    change = (
        model.assemble(ahead, None, tangent=False).residual
        - model.assemble(behind, None, tangent=False).residual
    )
    assert turned == pytest.approx(change / (2 * step), rel=1e-5, abs=1e-6 * np.abs(turned).max())


@ORDERS
def test_constant_stress_does_the_work_of_its_strain(order):
    """Energy of a uniform H under a uniform deformation: H : (C - I) / 2 times the volume."""
    held = PrescribedBlock(MADE_OF["neo_hooke"], order)
    h: FloatArray = np.array([0.3, -0.1, 0.2, 0.05, -0.15, 0.1])
    c: FloatArray = cauchy_green(SHEAR.T[None])[0]
    carried = ConstantStress.of(held.model, np.tile(h, (*held.model.mu.shape, 1)))
    moved = (_sheared(held, 1.0) - held.mesh.nodes)[held.model.topology.free]
    wanted = 0.5 * float(h @ ((c - [1, 1, 1, 0, 0, 0]) * [1, 1, 1, 2, 2, 2])) * np.prod(SIZE)
    assert carried.energy(moved) == pytest.approx(wanted, rel=1e-12)


@ORDERS
def test_force_of_a_stress_is_that_of_its_quadratic_form(order):
    held = PrescribedBlock(MADE_OF["neo_hooke"], order)
    random = np.random.default_rng(4)
    stress = random.normal(size=(*held.model.mu.shape, 6))
    moved = _bent(held, 5) - held.mesh.nodes
    moved[held.mesh.base_nodes] = 0.0
    found = constant_stress_force(held.model, stress, moved)
    wanted = ConstantStress.of(held.model, stress).force(moved[held.model.topology.free])
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-12 * np.abs(wanted).max())


@ORDERS
@MATERIALS
def test_stress_at_constant_strain_follows_the_prony_series(material, order):
    held = PrescribedBlock(material, order)
    positions = _sheared(held, 1.0)
    at_once = _elastic(held, positions)
    for time in (0.0, 0.1, 3.0, 3.5, 20.0, 1e4):
        found = held.force(positions, time)
        left = 1 - sum(
            term.fraction * (1 - np.exp(-time / term.time_constant)) for term in material.relaxation
        )
        assert found == pytest.approx(left * at_once, rel=1e-9, abs=1e-9 * np.abs(at_once).max())


def test_pressure_does_not_relax():
    held = PrescribedBlock(MADE_OF["neo_hooke"])
    swollen = 1.05 * held.mesh.nodes
    at_once = held.force(swollen, 0.0)
    assert held.force(swollen, 50.0) == pytest.approx(at_once, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("rate", [1e-3, 0.3, 1e3])
def test_stress_at_constant_strain_rate_is_the_convolution(rate):
    """Small shear at a constant rate, from 1 - g (slow) to 1 (fast): 1 - g + g (1 - e^-s) / s, s =
    t / tau, for any steps.
    """
    (term,) = ONE
    for steps in (1, 7):
        held = PrescribedBlock(MADE_OF["neo_hooke"])
        held.force(held.mesh.nodes, 0.0)
        for share in np.arange(1, steps + 1) / steps:
            positions = _sheared(held, 1e-5 * share)
            found = held.force(positions, share / rate)
        s = 1 / rate / term.time_constant
        wanted = 1 - term.fraction + term.fraction * -np.expm1(-s) / s
        at_once = _elastic(held, positions)
        assert found == pytest.approx(wanted * at_once, rel=1e-4, abs=1e-4 * np.abs(at_once).max())


def test_history_is_invariant_under_rotation():
    held, turned = PrescribedBlock(MADE_OF["fibres"]), PrescribedBlock(MADE_OF["fibres"])
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for number in range(3):
        held.force(_bent(held, number), float(number))
        turned.force(_bent(turned, number) @ (turn.T if number else np.eye(3)), float(number))
    here, there = held.material_history.history, turned.material_history.history
    assert (
        there.delayed == pytest.approx(here.delayed, abs=1e-12) and np.abs(here.delayed).max() > 0.1
    )


@ORDERS
def test_cells_reproduce_an_affine_strain(order):
    """A field that is linear in space is exact at all quadrature points, up to the boundary."""
    held = PrescribedBlock(MADE_OF["neo_hooke"], order)
    cells = CellPoints(SIZE, (8, 6, 4))
    tangents = cells.tangents(held.mesh, _sheared(held, 1.0))
    assert tangents == pytest.approx(np.broadcast_to(SHEAR.T, tangents.shape), abs=1e-12)
    x, y, z = ((np.arange(n) + 0.5) / n * edge for n, edge in zip((8, 6, 4), SIZE, strict=True))
    middles = np.stack(np.meshgrid(z, y, x, indexing="ij"), axis=-1).reshape(-1, 3)[:, ::-1] - [
        SIZE[0] / 2,
        SIZE[1] / 2,
        0,
    ]
    slopes = np.array([[1.0, -2.0], [0.5, 0.0], [3.0, 1.0]])
    assert cells.read(held.mesh, middles @ slopes) == pytest.approx(
        held.model.rule.places @ slopes, abs=1e-12
    )


def test_history_in_cells_equals_that_at_quadrature_points_for_uniform_strain():
    exact, cells = (
        PrescribedBlock(MADE_OF["two terms"]),
        PrescribedBlock(MADE_OF["two terms"], cells=True),
    )
    for amount, time in ((0.5, 0.0), (1.0, 1.0), (0.2, 1.5)):
        wanted = exact.force(_sheared(exact, amount), time)
        assert cells.force(_sheared(cells, amount), time) == pytest.approx(
            wanted, rel=1e-9, abs=1e-12
        )


def test_frame_without_equilibrium_is_not_stored():
    held = PrescribedBlock(replace(MADE_OF["two terms"], retained_fraction=0.2))
    held.force(_bent(held, 1), 0.0)
    before = held.material_history.history
    held.force(_bent(held, 2), 1.0, Outcome.ITERATIONS)
    assert held.material_history.history is before
    held.force(_bent(held, 2), 1.0)
    assert held.material_history.history.time == 1.0


@ORDERS
@pytest.mark.parametrize("share", [0.2, 0.6])
@pytest.mark.parametrize("relaxation", [(), ONE], ids=["elastic", "relaxing"])
def test_stretched_bar_keeps_the_retained_share_of_its_log_strain(order, share, relaxation):
    """The bar stands on springs too soft to matter, and is stretched to l at constant volume, at
    once or in steps.
    """
    material, loose = (
        Material(retained_fraction=share, relaxation=relaxation),
        Support(stiffness_over_E=1e-2),
    )
    for stretches in ([1.4], [1.1, 1.2, 1.4, 1.3]):
        held = PrescribedBlock(material, order, support=loose)
        for number, stretch in enumerate(stretches):
            positions = held.mesh.nodes * [stretch, stretch**-0.5, stretch**-0.5]
            held.force(positions, float(number))
        held.material_history.begin(1e4)  # whatever was to relax has
        held.material_history.apply_to(held.model)
        free = solve(held.model, None, positions)
        assert free.converged
        spans = np.ptp(free.positions, axis=0) / np.ptp(held.mesh.nodes, axis=0)
        assert spans == pytest.approx(np.array([1.4, 1.4**-0.5, 1.4**-0.5]) ** share, rel=2e-3)


def test_permanent_set_softens_the_first_push_only():
    held = PrescribedBlock(Material(retained_fraction=0.3))
    small = _sheared(held, 1e-4)
    whole = _elastic(held, small)

    def resists(amount: float, time: float) -> FloatArray:
        held.material_history.begin(time)
        held.material_history.apply_to(held.model, _sheared(held, amount))
        held.material_history.end(held._frame(_sheared(held, amount), Outcome.CONVERGED))
        return held.model.assemble(_sheared(held, amount), None, tangent=False).residual

    assert resists(1e-4, 0.0) == pytest.approx(
        0.7 * whole, rel=1e-3, abs=1e-3 * np.abs(whole).max()
    )
    kept = held.material_history.history.stored_strain
    assert resists(0.3e-4, 1.0) == pytest.approx(0.0 * whole, abs=1e-3 * np.abs(whole).max())
    assert resists(1e-4, 2.0) == pytest.approx(
        0.7 * whole, rel=1e-3, abs=1e-3 * np.abs(whole).max()
    )
    assert np.array_equal(held.material_history.history.stored_strain, kept)


def test_permanent_set_is_smooth_as_the_strain_turns_at_its_largest():
    """At the largest strain so far, in another direction, nothing jumps."""
    held = PrescribedBlock(Material(retained_fraction=0.5))
    held.force(_sheared(held, 0.5), 0.0)
    count, before = (
        len(held.material_history.history.stored_strain),
        held.material_history.history.free,
    )
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) @ (SHEAR - np.eye(3))
    less, more = (
        held.material_history._set(
            cauchy_green(np.tile((np.eye(3) + 0.5 * amount * turned).T, (count, 1, 1)))
        ).free
        for amount in (0.999, 1.001)
    )
    assert np.array_equal(less, before) and 1e-5 < np.abs(more - before).max() < 1e-3


def test_moving_grid_refuses_history_at_quadrature_points():
    held = PrescribedBlock(MADE_OF["neo_hooke"])
    other = box_mesh(SIZE, GridSpec(nodes=(5, 5, 3), spacing=2e-3), np.array([0.01, 0.0, 0.02]))
    with pytest.raises(MeshError, match="moves"):
        held.material_history.apply_to(BlockModel(held.setup, other))
