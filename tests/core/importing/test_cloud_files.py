"""Clouds in files of all kinds agree; damaged ones are refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import open3d
import pytest
from PIL import Image
from small_dataset import ply_bytes

from palpate.foundation.errors import DatasetError
from palpate.importing.sources.cloud_file import read_cloud_file
from palpate.importing.sources.cloud_folder_source import CloudFolderSource
from palpate.importing.sources.table_source import TableSource

POINTS = np.random.default_rng(5).normal(size=(50, 3)) * 0.1


def by_open3d(path: Path, write_ascii: bool = False, compressed: bool = False) -> None:
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(POINTS))
    assert open3d.io.write_point_cloud(path, cloud, write_ascii=write_ascii, compressed=compressed)


@pytest.mark.parametrize(
    ("suffix", "options"),
    [
        (".pcd", {"write_ascii": True}),
        (".pcd", {}),
        (".pcd", {"compressed": True}),
        (".ply", {"write_ascii": True}),
        (".ply", {}),
        (".xyz", {}),
    ],
)
def test_files_of_open3d_are_read(tmp_path: Path, suffix: str, options: dict[str, bool]) -> None:
    path = tmp_path / f"cloud{suffix}"
    by_open3d(path, **options)
    np.testing.assert_allclose(read_cloud_file(path), POINTS, atol=1e-6)


def test_arrays_of_numpy_are_read(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", POINTS)
    np.savez(tmp_path / "b.npz", other=np.zeros(3), points=POINTS)
    np.testing.assert_array_equal(read_cloud_file(tmp_path / "a.npy"), POINTS)
    np.testing.assert_array_equal(read_cloud_file(tmp_path / "b.npz"), POINTS)


def test_a_ply_with_an_umlaut_in_its_comment_is_read(tmp_path: Path) -> None:
    path = tmp_path / "cloud.ply"
    data = ply_bytes(POINTS).replace(b"element", "comment Prüfstand\nelement".encode(), 1)
    path.write_bytes(data)
    np.testing.assert_allclose(read_cloud_file(path), POINTS, atol=1e-6)


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_a_file_that_is_cut_off_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"cloud{suffix}"
    by_open3d(path)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(DatasetError, match=f"cloud{suffix}"):
        read_cloud_file(path)


def test_depth_images_are_placed_by_the_intrinsics_beside_them(tmp_path: Path) -> None:
    levels = np.full((12, 16), 400, dtype=np.uint16)
    levels[0, 0] = 0
    Image.fromarray(levels).save(tmp_path / "depth.png")
    with pytest.raises(DatasetError, match=r"no intrinsics.json"):
        read_cloud_file(tmp_path / "depth.png")
    (tmp_path / "other").mkdir()
    Image.fromarray(levels).save(tmp_path / "other" / "depth.png")
    stated = {"width": 16, "height": 12, "fx": 20.0, "fy": 20.0, "ppx": 8.0, "ppy": 6.0}
    (tmp_path / "other" / "intrinsics.json").write_text(json.dumps(stated))
    points = read_cloud_file(tmp_path / "other" / "depth.png")
    assert np.isnan(points[0, 0]).all()
    np.testing.assert_allclose(points[6, 8], [0, 0, 0.4], atol=1e-12)
    np.testing.assert_allclose(points[10, 12], [0.08, 0.08, 0.4], atol=1e-12)


@pytest.mark.parametrize("unit", [1, 10**3, 10**6, 10**9])
def test_names_of_a_folder_are_stamps(tmp_path: Path, unit: int) -> None:
    stamps = [1_700_000_000 * 10**9 + at * 2 * 10**9 for at in (2, 0, 1)]
    for stamp in stamps:
        (tmp_path / f"cloud_{stamp // unit}.ply").write_bytes(ply_bytes(POINTS))
    (tmp_path / ".hidden.ply").write_bytes(b"")
    source = CloudFolderSource(tmp_path)
    assert [one.stamped for one in source.samples({tmp_path.name})] == sorted(stamps)


def test_names_without_stamps_ask_for_a_table(tmp_path: Path) -> None:
    folder = tmp_path / "clouds"
    folder.mkdir()
    (folder / "000000.ply").write_bytes(ply_bytes(POINTS))
    with pytest.raises(DatasetError, match="a table beside it with columns t and file"):
        CloudFolderSource(folder)
    (tmp_path / "clouds.csv").write_text("t,file\n5.5,clouds\\000000.ply\n")
    source = TableSource(tmp_path / "clouds.csv")
    (sample,) = source.samples({"clouds.csv#cloud"})
    assert sample.stamped == 5_500_000_000
    np.testing.assert_allclose(sample.value(), POINTS, atol=1e-6)


def test_points_without_a_measurement_or_far_off_refuse_no_cloud(tmp_path: Path) -> None:
    points = POINTS.copy()
    points[3], points[7], points[9] = np.nan, 0, 65.535
    (tmp_path / "cloud.ply").write_bytes(ply_bytes(points))
    read = read_cloud_file(tmp_path / "cloud.ply")
    assert np.flatnonzero(np.isnan(read).any(axis=1)).tolist() == [3, 7]
    np.testing.assert_allclose(read[9], 65.535, rtol=1e-6)
