"""Clouds and depth images in messages agree with the points they were made of."""

from __future__ import annotations

import io
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image
from recorded_bags import BagKind, written_bag

from palpate.foundation.errors import DatasetError
from palpate.importing.messages.depth_messages import compressed_depth, raw_depth
from palpate.importing.messages.pinhole_camera import PinholeCamera
from palpate.importing.messages.point_cloud import cloud_points
from palpate.importing.recording import opened_recording

SIZE = (48, 64)
MATRIX = np.array([[60.0, 0, 31.2], [0, 61.0, 23.9], [0, 0, 1]])
BENT = np.array([0.05, -0.02, 0.001, -0.0005, 0.003])


def depth_image() -> np.ndarray:
    """A tilted plane at 0.4 m with a step, and a corner that was not measured."""
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    depth = 0.4 + 0.001 * rows - 0.0005 * columns + 0.03 * (columns > 30)
    depth[:5, :5] = 0
    return np.asarray(depth)


def cloud_message(points: np.ndarray, order: str, kind: str, gap: int, **changes: Any) -> Any:
    """A PointCloud2 of points (rows, columns, 3), each behind a gap of bytes."""
    rows, columns = points.shape[:2]
    numbers = np.dtype(order + kind)
    step = gap + 3 * numbers.itemsize + 2
    stride = step * columns + 6
    data = np.zeros(rows * stride, dtype=np.uint8)
    view = np.ndarray((rows, columns, 3), numbers, data.data, gap, (stride, step, numbers.itemsize))
    view[...] = points
    code = 7 if kind == "f4" else 8
    fields = [
        SimpleNamespace(name=axis, offset=gap + at * numbers.itemsize, datatype=code)
        for at, axis in enumerate("xyz")
    ]
    values = {
        "fields": fields, "is_bigendian": order == ">", "height": rows, "width": columns,
        "point_step": step, "row_step": stride, "data": data, **changes,
    }  # fmt: skip
    return SimpleNamespace(**values)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", ["f4", "f8"])
@pytest.mark.parametrize("gap", [0, 3])
def test_points_of_any_layout_are_read(order: str, kind: str, gap: int) -> None:
    points = np.random.default_rng(1).normal(size=(4, 5, 3))
    points[1, 2] = np.nan
    read = cloud_points(cloud_message(points, order, kind, gap))
    assert read.shape == (4, 5, 3)
    np.testing.assert_allclose(read, points, atol=1e-6)


def test_zeros_count_as_not_measured_and_single_rows_are_no_image() -> None:
    points = np.ones((1, 6, 3))
    points[0, 2] = 0
    read = cloud_points(cloud_message(points, "<", "f4", 0))
    assert read.shape == (6, 3)
    assert np.isnan(read[2]).all() and np.isfinite(read[[0, 1, 3, 4, 5]]).all()


def test_a_cloud_with_too_few_bytes_is_refused() -> None:
    message = cloud_message(np.ones((4, 5, 3)), "<", "f4", 0)
    message.data = message.data[:-40]
    with pytest.raises(DatasetError, match="4 x 5 points needs"):
        cloud_points(message)


def test_a_cloud_without_heights_is_refused_by_its_fields() -> None:
    message = cloud_message(np.ones((4, 5, 3)), "<", "f4", 0)
    message.fields = message.fields[:2]
    with pytest.raises(DatasetError, match="no field z, only x, y"):
        cloud_points(message)


def test_distorted_pixels_lead_back_to_the_points_that_made_them() -> None:
    camera = PinholeCamera.from_numbers(SIZE, MATRIX, BENT)
    points = camera.points(np.full(SIZE, 0.5))
    bent = camera.distorted(points[..., :2] / points[..., 2:])
    pixels = bent * camera.focal + camera.centre
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    np.testing.assert_allclose(pixels[..., 0], columns, atol=1e-4)
    np.testing.assert_allclose(pixels[..., 1], rows, atol=1e-4)
    straight = PinholeCamera.from_numbers(SIZE, MATRIX, np.zeros(0)).points(np.full(SIZE, 0.5))
    assert np.abs(points - straight).max() > 1e-3


def test_a_camera_that_was_never_calibrated_is_refused() -> None:
    with pytest.raises(DatasetError, match="focal lengths are 0 and 0"):
        PinholeCamera.from_numbers(SIZE, np.zeros((3, 3)), np.zeros(5))


def test_an_image_of_another_size_than_its_camera_is_refused() -> None:
    camera = PinholeCamera.from_numbers((24, 32), MATRIX, np.zeros(5))
    with pytest.raises(DatasetError, match=r"48 x 64 pixels, its camera_info 24 x 32"):
        camera.points(depth_image())


def png(levels: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(levels).save(stream, format="PNG")
    return stream.getvalue()


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_all_kinds_of_depth_agree_with_the_cloud(tmp_path: Path, kind: BagKind) -> None:
    depth = depth_image()
    levels = np.round(1000 * depth).astype(np.uint16)
    camera = PinholeCamera.from_numbers(SIZE, MATRIX, BENT)
    seen = np.where(depth > 0, depth, np.nan)
    points = camera.points(seen)
    path = tmp_path / ("bag" if kind == "mcap" else "one.bag")
    with written_bag(path, kind) as bag:
        bag.camera_info("/camera/depth/camera_info", 10**9, 10**9, SIZE, MATRIX, BENT)
        bag.cloud("/points", 10**9, 10**9, points, "camera")
        bag.image("/camera/depth/image_m", 10**9, 10**9, depth.astype(np.float32), "camera")
        bag.image("/camera/depth/image_mm", 10**9, 10**9, levels, "camera")
        packed = b"\0" * 12 + png(levels)
        bag.compressed("/camera/depth/packed", 10**9, 10**9, packed, "16UC1; compressedDepth png")
    recording = opened_recording("one", (path,), {})
    read = {one.name: list(recording.samples(one.name)) for one in recording.streams()}
    kinds = {one.name: one.kind for one in recording.streams()}
    recording.close()
    assert kinds["/camera/depth/packed"] == kinds["/camera/depth/image_mm"] == "depth"
    cloud = read["/points"][0].value()
    raw = camera.points(read["/camera/depth/image_m"][0].value())
    np.testing.assert_allclose(raw, cloud, atol=1e-6)
    np.testing.assert_array_equal(np.isnan(raw), np.isnan(points))
    coarse = read["/camera/depth/image_mm"][0].value()
    np.testing.assert_allclose(coarse, seen, atol=0.00051)
    np.testing.assert_array_equal(read["/camera/depth/packed"][0].value(), coarse)
    numbers = read["/camera/depth/camera_info"][0].value()
    np.testing.assert_allclose(numbers, [*SIZE, *MATRIX.ravel(), *BENT])


def test_inverse_depths_in_a_png_are_turned_back() -> None:
    depth = depth_image()
    scale, shift = 500.0, 3.0
    levels = np.where(depth > 0, scale / np.maximum(depth, 0.1) + shift, 0).round()
    header = np.array([0], "<i4").tobytes() + np.array([scale, shift], "<f4").tobytes()
    message = SimpleNamespace(
        format="32FC1; compressedDepth",
        data=np.frombuffer(header + png(levels.astype(np.uint16)), dtype=np.uint8),
    )
    read = compressed_depth(message)
    assert np.isnan(read[:5, :5]).all()
    np.testing.assert_allclose(read[5:, 5:], depth[5:, 5:], atol=3e-4)


@pytest.mark.parametrize("coding", ["rgb8", "mono8"])
def test_colour_is_no_depth(coding: str) -> None:
    message = SimpleNamespace(encoding=coding)
    with pytest.raises(DatasetError, match=f"encoding {coding} is no depth image"):
        raw_depth(message)


def test_depth_packed_as_rvl_is_refused_by_name() -> None:
    message = SimpleNamespace(format="16UC1; compressedDepth rvl", data=np.ones(90, np.uint8))
    with pytest.raises(DatasetError, match="not as RVL"):
        compressed_depth(message)
