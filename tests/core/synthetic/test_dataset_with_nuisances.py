"""A whole dataset with every nuisance of the virtual bench at once."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from made_datasets import copy_dataset

from palpate.dataset import Dataset, open_dataset
from palpate.synthetic import NUISANCES, Scenario, make_dataset, truth_path
from palpate.synthetic.bench.depth_camera import CameraScene, place_camera
from palpate.synthetic.bench.depth_image import take_image
from palpate.synthetic.bench.formed_surface import FormedSurface
from palpate.synthetic.bench.virtual_experiment import rest_surface
from palpate.synthetic.nuisances.phantom_form import RoundedEdges
from palpate.synthetic.scenario.disturbance import Disturbance

PLAIN = Scenario(sequences=("poke-top-01",), fine=4.5e-3, density=900, rate=1.0, robot_rate=200.0)


def drawn(seed: int) -> Scenario:
    """The scenario with all nuisances."""
    rng = np.random.default_rng(seed)
    return replace(PLAIN, nuisances=tuple(kind.draw(rng) for kind in NUISANCES))


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder = tmp_path_factory.mktemp("bench") / "real"
    copy_dataset(folder, drawn(4), 11)
    return open_dataset(folder)


def test_dataset_reads_back(dataset: Dataset) -> None:
    sequence = dataset.sequence("poke-top-01")
    assert len(sequence) > 8
    points = np.array([sequence.count(number) for number in range(len(sequence))])
    assert points.min() > 100
    assert np.isfinite(dataset.rest_cloud()).all()


def test_truth_lists_the_nuisances_and_keeps_its_verdict(dataset: Dataset) -> None:
    truth = json.loads(truth_path(dataset.path).read_text())
    assert truth["verdict"] == "none"
    assert [one["name"] for one in truth["nuisances"]] == [kind.__name__ for kind in NUISANCES]
    (edges,) = [one for one in truth["nuisances"] if one["name"] == "RoundedEdges"]
    assert 1e-3 < edges["parameters"]["radius"] < 3e-3


@pytest.mark.more
def test_same_seed_gives_the_same_files(dataset: Dataset, tmp_path: Path) -> None:
    make_dataset(tmp_path / "real", drawn(4), seed=11)
    for name in ("rest.ply", "sequences/poke-top-01/clouds/000005.ply", "touches.csv"):
        assert (tmp_path / "real" / name).read_bytes() == (dataset.path / name).read_bytes()


def test_drawn_surface_is_fine_where_edges_are_round() -> None:
    rest, settled, faces = rest_surface(PLAIN)
    form = FormedSurface(rest, faces, PLAIN.size, [RoundedEdges(3e-3)])
    vertices = form.displaced(settled)
    corner = np.array([PLAIN.size[0] / 2, PLAIN.size[1] / 2, PLAIN.size[2]])
    lost = 3e-3 * (np.sqrt(3) - 1)
    assert np.linalg.norm(rest - corner, axis=1).min() < 1e-9
    assert np.linalg.norm(vertices - corner, axis=1).min() == pytest.approx(lost, abs=0.1e-3)
    sharp, round_ = (
        trimesh.Trimesh(points, triangles, process=False).area
        for points, triangles in ((rest, faces), (vertices, form.faces))
    )
    x, y, z = PLAIN.size
    edges = 2 * (x + y) + 4 * z  # each loses (2 - pi / 2) times the radius of its area
    assert sharp - round_ == pytest.approx((2 - np.pi / 2) * 3e-3 * edges, rel=0.1)


def test_rippled_depth_is_seen_through_nuisances() -> None:
    rest, settled, faces = rest_surface(PLAIN)
    rng, seen = np.random.default_rng(2), np.array([1.0, 1.0])
    block = (rest + settled, faces)
    camera = place_camera(rng, PLAIN.size, block, seen, 900, 1e-4)
    scene = CameraScene(block, None, np.array([0.0, 0.0, -1.0]), 1.0)
    ripple = Disturbance("depth_ripple", {"amplitude": 0.002, "period": 0.02})
    plain = take_image(camera, scene).depth
    waved = take_image(replace(camera, disturbances=(ripple,)), scene).depth
    known = np.isfinite(plain)
    assert np.array_equal(known, np.isfinite(waved))
    ratio = waved[known] / plain[known] - 1
    assert ratio == pytest.approx(0.002 * np.sin(2 * np.pi * plain[known] / 0.02), abs=1e-9)
