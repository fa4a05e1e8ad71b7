"""The field behind a map of the stiffness, from quadratic forms that are made by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import Block
from palpate.diagnosis.report.stiffness.felt_pushes import FeltPush
from palpate.diagnosis.report.stiffness.map_cells import MapCells, cells_near
from palpate.diagnosis.report.stiffness.map_figure import draw_map, finely_divided
from palpate.diagnosis.report.stiffness.map_posterior import FieldPosterior, field_posterior
from palpate.diagnosis.report.stiffness.map_report import map_to_json
from palpate.diagnosis.report.stiffness.stiffness_map import StiffnessMap
from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Box

RADIUS, BOX = 5e-3, Box(size=(0.06, 0.03, 0.02))
UP = np.array([0.0, 0.0, 1.0])
TOUCHED = np.array([(x, 0.0, 0.02) for x in (-0.02, -0.01, 0.0, 0.01)])
PRECISION = np.eye(1)


def felt(cells: MapCells) -> FloatArray:
    """Change (k, m) of the force of each push, over noise, by the contrast of each cell."""
    apart = np.linalg.norm(TOUCHED[:, None] - cells.centres, axis=2)
    return np.asarray(40.0 * np.exp(-0.5 * (apart / RADIUS) ** 2))


def posterior(cells: MapCells, contrast: FloatArray, seed: int = 0) -> FieldPosterior:
    """The field of a body of these contrasts (m,), whose pushes are made five times."""
    blocks, columns = [], felt(cells)
    random = np.random.default_rng(seed)
    for number in range(5):
        residual = -columns @ contrast + random.standard_normal(len(columns))
        whole = np.column_stack([residual, columns.sum(axis=1), columns])
        blocks.append(Block(f"felt-{number}", whole.T @ whole, float(len(columns))))
    own = range(1, 1 + len(cells.centres))
    return field_posterior(blocks, [0], PRECISION, own, cells.centres, RADIUS, 0)


@pytest.fixture(scope="module")
def cells() -> MapCells:
    return cells_near(TOUCHED, BOX, RADIUS)


@pytest.fixture(scope="module")
def made(cells: MapCells) -> StiffnessMap:
    """A map of a body that is stiffer at one end."""
    field = posterior(cells, np.where(cells.centres[:, 0] < -8e-3, 0.3, 0.0))
    pushes = tuple(
        FeltPush(number, "felt", place, UP, signal)
        for number, (place, signal) in enumerate(zip(TOUCHED, felt(cells), strict=True), start=1)
    )
    usual = (cells.centres[:, 0] > 0) / (cells.centres[:, 0] > 0).sum()
    surface = np.concatenate([TOUCHED, [(0.029, 0.0, 0.02)]])
    apart = np.linalg.norm(surface[:, None] - cells.centres, axis=2)
    spread = np.where(apart < RADIUS, 1.0, 0.0)
    spread /= np.maximum(spread.sum(axis=1, keepdims=True), 1.0)
    return StiffnessMap(cells, field, pushes, usual, surface, spread, ("+x",))


def test_cells_tile_what_is_near_the_pushes_and_are_not_too_many(cells: MapCells) -> None:
    reach = CRITERIA.stiffness_map.reach * RADIUS
    apart = np.linalg.norm(cells.centres[:, None] - TOUCHED, axis=2).min(axis=1)
    assert apart.max() < reach and (BOX.outside(cells.centres) < 0).all()
    assert np.round(np.array(BOX.size) / cells.edges, 9) == pytest.approx((12, 6, 4))
    ball = cells.balls[0]
    assert 4 / 3 * np.pi * ball.radius**3 == pytest.approx(np.prod(cells.edges))
    crowded = cells_near(TOUCHED, BOX, RADIUS / 3)
    assert 0 < len(crowded.centres) <= CRITERIA.stiffness_map.most_cells


def test_field_finds_stiffer_cells_and_knows_what_pushes_hardly_feel(cells: MapCells) -> None:
    truth = np.where(cells.centres[:, 0] < -8e-3, 0.3, 0.0)
    found = posterior(cells, truth)
    assert found.gain > found.bound + 20
    under = np.linalg.norm(cells.centres[:, None] - TOUCHED, axis=2).argmin(axis=0)
    assert found.mean[under[0]] > found.mean[under[3]] + 0.1
    share = np.sqrt(np.diag(found.covariance) / np.diag(found.prior))
    weak = felt(cells).max(axis=0) < 2.0
    assert weak.any() and share[under].max() < share[weak].min() < share[weak].max() < 1.0


def test_uniform_bodies_gain_more_than_the_bound_as_rarely_as_stated(cells: MapCells) -> None:
    nothing = np.zeros(len(cells.centres))
    found = [posterior(cells, nothing, seed) for seed in range(1, 9)]
    assert sum(one.gain > one.bound for one in found) <= 1
    for one in found:
        assert (np.abs(one.mean) < 2.5 * np.sqrt(np.diag(one.covariance))).all()


def test_report_says_which_pushes_feel_what_and_where_nothing_is_told(made: StiffnessMap) -> None:
    report = map_to_json(made)
    assert report["structured"] and len(report["points"]) == len(made.cells.centres)
    assert [row["number"] for row in report["pushes"]] == [1, 2, 3, 4]
    assert report["pushes"][0]["ratio"] > report["pushes"][3]["high"]
    assert report["surface"][0]["trusted"] and not report["surface"][-1]["trusted"]
    (part,) = report["parts"]
    assert part["low"] > 1.0 and 1 in part["pushes"] and 4 not in part["pushes"]


def test_picture_is_drawn_in_small_pieces(made: StiffnessMap, tmp_path: Path) -> None:
    vertices, triangles = finely_divided(*BOX.closed_surface, 4e-3)
    corners = vertices[triangles]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() <= 4e-3
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    x, y, z = BOX.size
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(2 * (x * y + y * z + z * x))
    draw_map(tmp_path / "stiffness.png", BOX, made)
    assert (tmp_path / "stiffness.png").stat().st_size > 10_000
