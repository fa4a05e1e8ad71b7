from __future__ import annotations

import numpy as np
import pytest

from palpate.fem.constitutive.elastic import elastic_energy
from palpate.fem.energy_density import energy_density, nodal_density
from palpate.fem.model import BlockModel
from palpate.mesh.box_mesh import GridSpec
from palpate.setup.setup import Box, Fibres, Inclusion, Material, Setup, Tool

SIZE = (0.05, 0.03, 0.02)
STRAIN = np.array([[1.10, 0.10, -0.05], [0.03, 0.92, 0.12], [-0.08, 0.02, 1.04]])
LUMP = Inclusion(x=0.0, y=0.0, z=0.012, radius=0.006, stiffness_ratio=5.0)
MATERIALS = {
    "neo_hooke": Material(),
    "gent": Material(stretch_limit=4.0),
    "corotational": Material(law="corotational"),
    "fibres": Material(fibres=Fibres(direction=0.6, stiffness_ratio=3.0)),
    "lump": Material(inclusions=(LUMP,)),
}


def bent(material: Material, order: int) -> tuple[BlockModel, np.ndarray]:
    setup = Setup(geometry=Box(size=SIZE), material=material, tool=Tool(radius=5e-3))
    mesh = GridSpec(nodes=(7, 5, 5), order=order).mesh(setup, np.zeros(3))
    noise = np.random.default_rng(3).normal(0, 2e-4, mesh.nodes.shape)
    return BlockModel(setup, mesh), mesh.nodes @ STRAIN.T + noise


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", MATERIALS)
def test_density_integrates_to_the_minimised_energy(name, order):
    model, positions = bent(MATERIALS[name], order)
    whole = elastic_energy(
        model.law, model.rule, model.topology.elements, model.mu, model.bulk, positions
    )
    assert np.vdot(model.rule.weights, energy_density(model, positions)) == pytest.approx(
        whole, rel=1e-9
    )


def test_density_of_an_even_strain_is_the_same_at_every_node():
    model, _ = bent(Material(), 2)
    density = nodal_density(model, model.mesh.nodes @ STRAIN.T)
    assert density.min() > 0.0
    assert density == pytest.approx(density[0], rel=1e-9)


def test_a_stiff_lump_holds_more_energy_at_the_same_strain():
    (plain, _), (lumped, _) = bent(Material(), 2), bent(MATERIALS["lump"], 2)
    positions = plain.mesh.nodes @ STRAIN.T
    ratio = energy_density(lumped, positions) / energy_density(plain, positions)
    assert ratio.max() > 3.0 and ratio.min() == pytest.approx(1.0, abs=0.05)
