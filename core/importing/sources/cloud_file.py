"""Clouds in single files: PLY, PCD, XYZ, NPY and NPZ, and depth images as PNG."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from palpate.dataset.cloud import read_points
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.importing.messages.depth_messages import depth_from_png
from palpate.importing.messages.pinhole_camera import PinholeCamera
from palpate.importing.messages.point_cloud import unmeasured

__all__ = ["CLOUD_SUFFIXES", "read_cloud_file"]

_INTRINSICS = "intrinsics.json"
"""File beside depth images with width, height, fx, fy, ppx (or cx), ppy (or cy), coeffs."""


def read_cloud_file(path: Path) -> FloatArray:
    """Read a cloud [m], camera frame, by the suffix of its file.

    Returns:
        (n, 3), or (rows, columns, 3) of a depth image; NaN where nothing was measured.

    Raises DatasetError for a file that is damaged or holds something else.
    """
    try:
        points = CLOUD_SUFFIXES[path.suffix.lower()](path)
    except OSError as error:
        raise DatasetError(
            f"{path.name} cannot be read ({error.strerror or error}); copy it again", file=path.name
        ) from None
    if points.shape[-1] != 3 or points.ndim not in (2, 3):
        raise DatasetError(
            f"{path.name} holds numbers of shape {points.shape}; expected (n, 3) points",
            file=path.name,
        )
    points = points.astype(float)
    points[unmeasured(points)] = np.nan
    return points


def _ply(path: Path) -> FloatArray:
    """By the reader of datasets, which finds damage; a header with umlauts is written anew."""
    try:
        return np.array(read_points(path.parent, path.name))
    except DatasetError:
        data = path.read_bytes()
        head, end, body = data.partition(b"end_header")
        if not end or head.isascii():
            raise
        with TemporaryDirectory() as folder:
            plain = head.decode("latin-1").encode("ascii", "replace")
            (Path(folder) / path.name).write_bytes(plain + end + body)
            return np.array(read_points(Path(folder), path.name))


def _pcd(path: Path) -> FloatArray:
    head = path.read_bytes()[: 2**12].decode("latin-1").splitlines()
    stated = next((int(line.split()[1]) for line in head if line.startswith("POINTS ")), -1)
    points = _by_open3d(path)
    if len(points) != stated:
        raise DatasetError(
            f"{path.name} states {stated} points, {len(points)} can be read; expected all of them: "
            "export it again",
            file=path.name,
            value=stated,
        )
    return points


def _by_open3d(path: Path) -> FloatArray:
    import open3d

    with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
        cloud = open3d.io.read_point_cloud(
            path, format=path.suffix[1:].lower(), remove_nan_points=False,
            remove_infinite_points=False,
        )  # fmt: skip
    return np.array(cloud.points)


def _xyz(path: Path) -> FloatArray:
    text = path.read_text(encoding="utf-8-sig", errors="replace").replace(",", " ")
    rows = [line.split()[:3] for line in text.splitlines() if line.strip() and line[0] not in "#/"]
    try:
        return np.array(rows, dtype=float).reshape(-1, 3)
    except ValueError as error:
        raise DatasetError(
            f"{path.name}: a row is not three numbers ({error}); export it again", file=path.name
        ) from None


def _npy(path: Path) -> FloatArray:
    return _placed(path, _loaded(path))


def _npz(path: Path) -> FloatArray:
    with _loaded(path) as archive:
        for name in ("points", "cloud", "xyz", "depth", *archive.files):
            if name in archive.files:
                return _placed(path, archive[name])
    raise DatasetError(f"{path.name} holds no array; expected points", file=path.name)


def _loaded(path: Path) -> Any:
    try:
        return np.load(path, allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise DatasetError(
            f"{path.name} is no array of NumPy ({error}); save it again", file=path.name
        ) from None


def _png(path: Path) -> FloatArray:
    return _camera(path.parent).points(depth_from_png(path.read_bytes()))


def _placed(path: Path, numbers: Any) -> FloatArray:
    """Points as they are; a depth image (rows, columns) by the intrinsics beside it."""
    if numbers.ndim == 2 and numbers.shape[1] != 3:
        depth = numbers.astype(float) * (1e-3 if numbers.dtype.kind in "ui" else 1.0)
        depth[~(depth > 0)] = np.nan
        return _camera(path.parent).points(depth)
    return np.asarray(numbers)


@cache
def _camera(folder: Path) -> PinholeCamera:
    """The camera by intrinsics.json of a folder, or of the one around it."""
    for place in (folder / _INTRINSICS, folder.parent / _INTRINSICS):
        if not place.is_file():
            continue
        try:
            stated = json.loads(place.read_text())
            matrix = np.eye(3)
            matrix[0, 0], matrix[1, 1] = stated["fx"], stated["fy"]
            matrix[0, 2] = stated.get("ppx", stated.get("cx"))
            matrix[1, 2] = stated.get("ppy", stated.get("cy"))
            size = (int(stated["height"]), int(stated["width"]))
            bent = np.array(stated.get("coeffs", []), dtype=float)
        except (ValueError, KeyError, TypeError) as error:
            raise DatasetError(
                f"{place.name} lacks or misstates {error}; expected width, height, fx, fy, ppx, "
                "ppy [pixels]",
                file=place.name,
            ) from None
        return PinholeCamera.from_numbers(size, matrix, bent)
    raise DatasetError(
        f"depth images in {folder.name} have no {_INTRINSICS} beside them; expected width, height, "
        "fx, fy, ppx, ppy [pixels]: write it",
        file=_INTRINSICS,
    )


CLOUD_SUFFIXES: dict[str, Callable[[Path], FloatArray]] = {
    ".ply": _ply,
    ".pcd": _pcd,
    ".xyz": _xyz,
    ".npy": _npy,
    ".npz": _npz,
    ".png": _png,
}
"""Readers by suffix."""
