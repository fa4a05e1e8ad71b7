"""Surfaces as CT and scanners give them: defects are counted and mended, changes measured."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from shapes import box_surface

from palpate.foundation.errors import MeshError
from palpate.setup.free_form.surface_file import check_surface
from palpate.setup.free_form.triangle_crossings import crossing_pairs
from palpate.setup.surface_repair.cleaning import Clean, KeepBody
from palpate.setup.surface_repair.closing import CloseBase, FillHoles
from palpate.setup.surface_repair.decimation import Decimate
from palpate.setup.surface_repair.placing import Orient, PutOnTable, TurnUp
from palpate.setup.surface_repair.planar_cap import cap_rims, signed_area
from palpate.setup.surface_repair.rebuilding import Rebuild
from palpate.setup.surface_repair.repair_surface import load_surface, remedies, repair
from palpate.setup.surface_repair.surface_summary import summarize
from palpate.setup.surface_repair.triangle_surface import TriangleSurface

SIZE = (0.06, 0.04, 0.03)


def _ball(radius: float = 0.02, fineness: int = 3, at=(0.0, 0.0, 0.02)) -> TriangleSurface:
    ball = trimesh.creation.icosphere(fineness, radius)
    return TriangleSurface(np.array(ball.vertices) + at, np.array(ball.faces, np.int64), "ball")


def _both(one: TriangleSurface, other: TriangleSurface) -> TriangleSurface:
    return TriangleSurface(
        np.concatenate([one.vertices, other.vertices]),
        np.concatenate([one.triangles, other.triangles + len(one.vertices)]),
        "both",
    )


def _bowl(ragged: float = 0.0, level: float = 0.01) -> TriangleSurface:
    """A ball without its bottom, whose rim is uneven by so much [m]."""
    ball = _ball(fineness=4)
    middles = ball.corners.mean(axis=1)
    rim = level + ragged * np.sin(9 * np.arctan2(middles[:, 1], middles[:, 0]))
    return ball.of(ball.triangles[middles[:, 2] > rim])


def _passes(surface: TriangleSurface) -> None:
    check_surface(surface.name, surface.vertices, surface.triangles)


@pytest.mark.parametrize("ragged", [0.0, 1.5e-3])
def test_open_bottom_is_closed_by_walls_down_to_its_lowest_point(ragged: float) -> None:
    bowl = _bowl(ragged)
    assert summarize(bowl).holes == 1 and remedies(summarize(bowl))[0] == "--close-base"
    closed, said = CloseBase()(bowl)
    _passes(closed)
    low = bowl.vertices[:, 2].min()
    base = closed.corners[(closed.corners[..., 2] == low).all(axis=1)]
    assert len(base) and closed.vertices[:, 2].min() == low
    assert "walls up to" in said and "cut off 0 mm" in said


def test_cut_above_the_rim_takes_off_what_it_says() -> None:
    bowl = _bowl(1.5e-3)
    low = bowl.vertices[:, 2].min()
    made, (record,) = repair(bowl, [CloseBase(5e-3)])
    _passes(made)
    assert made.vertices[:, 2].min() == low + 5e-3
    assert record.deviation is not None
    assert record.deviation.old_largest == pytest.approx(5e-3, abs=1e-5)
    height = 0.02 + 0.02 - (low + 5e-3)  # a cap of the ball
    assert made.volume == pytest.approx(np.pi * height**2 * (0.02 - height / 3), rel=0.01)


def test_plane_that_meets_no_rim_is_refused_with_the_height_of_the_lowest() -> None:
    ball = _ball()
    top = ball.of(ball.triangles[ball.corners[..., 2].mean(axis=1) < 0.035])
    with pytest.raises(MeshError, match=r"no rim reaches the plane .* begins at 3\d"):
        CloseBase()(top)
    filled, said = FillHoles(0.05)(top)
    _passes(filled)
    assert said.startswith("filled 1 hole")
    assert "left 1" in FillHoles(1e-3)(top)[1]


def test_ring_is_closed_with_its_hole_left_open() -> None:
    torus = trimesh.creation.torus(0.03, 0.01)
    ring = TriangleSurface(np.array(torus.vertices), np.array(torus.faces, np.int64), "ring")
    half, _ = CloseBase(0.01)(ring)
    _passes(half)
    assert half.volume == pytest.approx(ring.volume / 2, rel=1e-3)


def test_rims_within_rims_are_covered_once() -> None:
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    outer = circle * (1 + 0.3 * np.cos(5 * turn))[:, None]
    hole, island = 0.2 * circle[::-1] + (0.3, 0.0), 0.05 * circle + (0.3, 0.0)
    places = np.concatenate([outer, hole, island])
    rims = [np.arange(40) + 40 * number for number in range(3)]
    for seen in (places, places * (-1.0, 1.0)):
        a, b, c = seen[cap_rims(seen, rims)].transpose(1, 0, 2)
        areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
        wanted = sum(signed_area(seen[rim]) for rim in rims)
        assert areas.sum() == pytest.approx(-wanted) and (areas * wanted < 0).all()


def test_doubles_fins_and_flat_triangles_are_removed_and_nothing_else() -> None:
    vertices, triangles = box_surface(SIZE)
    fin = np.concatenate([vertices, [[0.0, 0.0, 0.05]]])
    a, b, c = triangles[0]
    split = np.concatenate([fin, [0.5 * (vertices[a] + vertices[b])]])
    # The edge from a to b got a vertex on one side only, and a triangle without an area there.
    flat = [(a, 9, c), (9, b, c), (a, b, 9)]
    broken = np.concatenate([triangles[1:], flat, triangles[3:6], [(*triangles[4, :2], 8)]])
    surface = TriangleSurface(split, broken.astype(np.int64), "box")
    found = summarize(surface)
    assert (found.collapsed, found.doubled) == (1, 3) and found.shared_edges
    clean, said = Clean(1e-6)(surface)
    _passes(clean)
    assert clean.volume == pytest.approx(np.prod(SIZE))
    assert "3 doubled triangles and 1 of fins, turned 1 edges" in said


def test_near_vertices_are_merged_within_the_stated_distance_only() -> None:
    vertices, triangles = box_surface(SIZE)
    torn = vertices[triangles].reshape(-1, 3)
    torn = torn + np.random.default_rng(0).uniform(-2e-6, 2e-6, torn.shape)
    surface = TriangleSurface(torn, np.arange(len(torn)).reshape(-1, 3), "torn")
    assert summarize(surface).open_edges == 36
    assert summarize(Clean(1e-9)(surface)[0]).open_edges == 36
    clean, said = Clean(1e-5)(surface)
    _passes(clean)
    assert len(clean.vertices) == 8 and "merged 28 vertices" in said


def test_body_is_chosen_by_size() -> None:
    two = _both(_ball(0.005, 2, (0.1, 0.0, 0.0)), _ball())
    assert summarize(two).bodies == 2
    kept, said = KeepBody(1)(two)
    assert np.ptp(kept.vertices[:, 0]) == pytest.approx(0.04, rel=0.01)
    assert "1 of 2" in said and "removed 320" in said
    assert np.ptp(KeepBody(2)(two)[0].vertices[:, 0]) == pytest.approx(0.01, rel=0.02)
    with pytest.raises(MeshError, match="holds 2 bodies, number 3 was asked for"):
        KeepBody(3)(two)


def test_mixed_triangles_are_turned_outwards() -> None:
    ball = _ball()
    mixed = ball.triangles.copy()
    mixed[::3] = mixed[::3][:, ::-1]
    surface = ball.of(mixed)
    assert summarize(surface).orientation == f"mixed, {len(mixed[::3])} against the rest"
    made, said = Orient()(surface)
    _passes(made)
    assert said == f"turned {len(mixed[::3])} of {len(mixed)} triangles"
    assert summarize(ball.of(ball.triangles[:, ::-1])).orientation == "inwards"
    _passes(Orient()(ball.of(ball.triangles[:, ::-1]))[0])


def test_surface_of_one_side_is_refused() -> None:
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    way = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    out = np.cos(turn / 2)[:, None] * way + np.sin(turn / 2)[:, None] * (0.0, 0.0, 1.0)
    vertices = np.concatenate([0.03 * way + 0.01 * out, 0.03 * way - 0.01 * out])
    strip = [((i, i + 1, i + 13), (i, i + 13, i + 12)) for i in range(11)]
    triangles = np.array([*np.array(strip).reshape(-1, 3), (11, 12, 0), (11, 0, 23)])
    with pytest.raises(MeshError, match="one side only"):
        Orient()(TriangleSurface(vertices, triangles, "strip"))


def test_overlapping_bodies_become_one_without_crossings() -> None:
    two = _both(_ball(), _ball(at=(0.02, 0.002, 0.021)))
    assert summarize(two).crossings
    made, (record,) = repair(two, [Rebuild(1e-3)])
    _passes(made)
    # Two balls of 20 mm whose middles are 20.1 mm apart.
    apart = float(np.linalg.norm((0.02, 0.002, 0.001)))
    lens = np.pi * (4 * 0.02 + apart) * (2 * 0.02 - apart) ** 2 / 12
    assert made.volume == pytest.approx(2 * 4 / 3 * np.pi * 0.02**3 - lens, rel=0.02)
    assert record.deviation is not None and record.deviation.new_largest < 1e-3


def test_grid_beyond_the_memory_is_refused_with_one_that_fits() -> None:
    with pytest.raises(MeshError, match=r"a grid of 0.001 mm .* --rebuild 0\.\d+ or more"):
        Rebuild(1e-6)(_ball())


def test_decimated_surface_stays_within_the_tolerance() -> None:
    fine = _ball(fineness=6)
    made, (record,) = repair(fine, [Decimate(1e-4)])
    _passes(made)
    assert len(made.triangles) < len(fine.triangles) / 10
    assert record.deviation is not None and 2e-5 < record.deviation.largest <= 1e-4
    same, said = Decimate(1e-9)(fine)
    assert same is fine and said.startswith(f"kept all {len(fine.triangles)}")


def test_direction_becomes_z_and_the_lowest_point_zero() -> None:
    lying = TriangleSurface(_ball().vertices[:, [0, 2, 1]] * (1, 1, -1), _ball().triangles, "b")
    made, records = repair(lying, [TurnUp("y"), PutOnTable()])
    assert np.allclose(np.ptp(made.vertices, axis=0), np.ptp(_ball().vertices, axis=0))
    assert made.vertices[:, 2].min() == 0 and records[0].unmoved == "moved as a whole"
    for way in ("-z", "-x", "0.3,-0.4,0.5"):
        _passes(TurnUp(way)(_ball())[0])
    with pytest.raises(MeshError, match="up is 'upwards'; expected x, y, z"):
        TurnUp("upwards")(lying)


def test_crossings_are_those_that_open3d_finds_by_trying_all_pairs() -> None:
    import open3d as o3d

    random = np.random.default_rng(1)
    two = _both(_ball(fineness=3), _ball(fineness=3, at=(0.015, 0.003, 0.022)))
    vertices = two.vertices + random.normal(size=two.vertices.shape) * 2e-4
    spread = vertices / np.ptp(vertices, axis=0).max()
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(spread), o3d.utility.Vector3iVector(two.triangles)
    )
    every = np.asarray(mesh.get_self_intersecting_triangles())
    found = crossing_pairs(vertices, two.triangles)
    assert len(found) > 50
    assert np.array_equal(found, np.unique(np.sort(every, axis=1), axis=0))


def test_file_is_read_in_its_unit_with_its_doubled_vertices(tmp_path) -> None:
    vertices, triangles = box_surface(SIZE)
    trimesh.Trimesh(1e3 * vertices, triangles).export(tmp_path / "box.stl")
    surface, repeated = load_surface(tmp_path / "box.stl", "mm")
    assert repeated == 28 and np.ptp(surface.vertices, axis=0) == pytest.approx(SIZE)
    _passes(surface)
    with (tmp_path / "huge.stl").open("wb") as file:
        file.truncate(2**27 + 1)
    with pytest.raises(MeshError, match="has 128 MiB, at most 128 are read"):
        load_surface(tmp_path / "huge.stl", "m")
