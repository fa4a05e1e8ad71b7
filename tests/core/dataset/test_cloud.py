"""PLY clouds in all the layouts that cameras and programs write."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import open3d
import pytest
from small_dataset import ply_bytes

from palpate.dataset.cloud import read_cloud, read_header
from palpate.foundation.errors import DatasetError

POINTS = np.random.default_rng(0).uniform(-0.3, 0.3, (57, 3))


def write(folder: Path, header: str, body: bytes, newline: str = "\n") -> None:
    lines = ["ply", *header.split("|"), "end_header", ""]
    (folder / "cloud.ply").write_bytes(newline.join(lines).encode() + body)


@pytest.mark.parametrize(("order", "sign"), [("little", "<"), ("big", ">")])
@pytest.mark.parametrize(("kind", "code"), [("float", "f4"), ("float64", "f8")])
def test_binary_clouds_of_either_byte_order_and_precision(
    order: str, sign: str, kind: str, code: str, tmp_path: Path
) -> None:
    header = (
        f"format binary_{order}_endian 1.0|element vertex 57|property {kind} x|property "
        f"{kind} y|property {kind} z"
    )
    write(tmp_path, header, POINTS.astype(sign + code).tobytes())
    found = read_cloud(tmp_path, "cloud.ply")
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, POINTS, atol=1e-7)


def test_coordinates_are_found_by_name_among_other_properties(tmp_path: Path) -> None:
    layout = np.dtype([("red", "u1"), ("z", "<f4"), ("x", "<f8"), ("quality", "<u2"), ("y", "<f4")])
    records = np.zeros(57, layout)
    for axis, name in enumerate("xyz"):
        records[name] = POINTS[:, axis]
    kinds = (
        "property uchar red|property float z|property double x|property ushort "
        "quality|property float y"
    )
    write(
        tmp_path,
        f"format binary_little_endian 1.0|comment by a camera|element vertex 57|{kinds}",
        records.tobytes(),
    )
    np.testing.assert_allclose(read_cloud(tmp_path, "cloud.ply"), POINTS, atol=1e-7)


def test_ascii_with_other_properties_and_other_line_ends(tmp_path: Path) -> None:
    body = "".join(f"{x:.9f} {y:.9f} {z:.9f} 200\r\n" for x, y, z in POINTS).encode()
    header = (
        "format ascii 1.0|element vertex 57|property float x|property float y|property float "
        "z|property uchar red"
    )
    write(tmp_path, header, body, newline="\r\n")
    np.testing.assert_allclose(read_cloud(tmp_path, "cloud.ply"), POINTS, atol=1e-8)


def test_elements_before_and_after_the_points_are_stepped_over(tmp_path: Path) -> None:
    camera, faces = (
        np.arange(4, dtype="<f4").tobytes(),
        b"\x03" + np.arange(3, dtype="<i4").tobytes(),
    )
    header = (
        "format binary_little_endian 1.0|element camera 2|property float a|property float "
        "b|element vertex 57|property float x"
        "|property float y|property float z|element face 1|property list uchar int vertex_indices"
    )
    write(tmp_path, header, camera + POINTS.astype("<f4").tobytes() + faces)
    np.testing.assert_allclose(read_cloud(tmp_path, "cloud.ply"), POINTS, atol=1e-7)


def test_what_open3d_writes_is_read(tmp_path: Path) -> None:
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(POINTS))
    cloud.paint_uniform_color([0.1, 0.5, 0.9])
    for ascii_text in (False, True):
        open3d.io.write_point_cloud(tmp_path / "cloud.ply", cloud, write_ascii=ascii_text)
        np.testing.assert_allclose(read_cloud(tmp_path, "cloud.ply"), POINTS, atol=1e-6)


def test_a_header_of_ten_gigabytes_is_refused_before_memory_is_taken(tmp_path: Path) -> None:
    (tmp_path / "cloud.ply").write_bytes(
        ply_bytes(POINTS).replace(b"vertex 57", b"vertex 900000000")
    )
    tracemalloc.start()
    with pytest.raises(DatasetError, match="10800000000 bytes"):
        read_cloud(tmp_path, "cloud.ply")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e6


def test_the_header_tells_the_count_without_the_points(tmp_path: Path) -> None:
    (tmp_path / "cloud.ply").write_bytes(ply_bytes(POINTS))
    header = read_header(tmp_path, "cloud.ply")
    assert (header.count, header.order, header.layout.itemsize) == (57, "<", 12)


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("element vertex 57|property float x|property float y|property float z", "no format line"),
        ("format binary_little_endian 1.0|element face 3|property float x", "no element vertex"),
        ("format binary_little_endian 2.0|element vertex 57", "'format binary_little_endian 2.0'"),
        ("format ascii 1.0|element vertex 1|property float x|property float x", "comes twice"),
        ("format binary_little_endian 1.0|property float x", "'property float x'"),
        (
            "format binary_little_endian 1.0|element face 1|property list uchar int i|element "
            "vertex 1|property float x",
            "vertex first",
        ),
    ],
)
def test_headers_that_are_none_are_quoted(header: str, words: str, tmp_path: Path) -> None:
    if "face 1" in header:
        header += "|property float y|property float z"
    write(tmp_path, header, b"\0" * 684)
    with pytest.raises(DatasetError) as caught:
        read_cloud(tmp_path, "cloud.ply")
    assert words in caught.value.message
    assert caught.value.where["file"] == "cloud.ply"


@pytest.mark.parametrize(
    ("count", "kinds", "told"),
    [
        (6_000_001, "float", "has 6000001 points; expected at most 6000000"),
        (
            5_000_000,
            "double double double double double double",
            "has 286 MiB; expected at most 256",
        ),
    ],
)
def test_clouds_larger_than_any_camera_gives_are_refused(
    count: int, kinds: str, told: str, tmp_path: Path
) -> None:
    names = [
        "float x",
        "float y",
        "float z",
        *(f"{kind} c{n}" for n, kind in enumerate(kinds.split())),
    ]
    header = "|".join(f"property {name}" for name in names)
    write(tmp_path, f"format binary_little_endian 1.0|element vertex {count}|{header}", b"")
    with (tmp_path / "cloud.ply").open("ab") as sink:
        width = sum(4 if name.startswith("float") else 8 for name in names)
        sink.truncate(sink.tell() + count * width)
    tracemalloc.start()
    with pytest.raises(DatasetError, match=told):
        read_cloud(tmp_path, "cloud.ply")
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert taken < 2**20
