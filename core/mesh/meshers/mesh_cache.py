"""Meshes of shapes on disk, so that a second run of the same body meshes nothing."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
import zipfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.meshers.mesher_choice import TetMesher
from palpate.mesh.meshers.size_field import SizeField
from palpate.setup.free_form.shape import Shape

__all__ = ["FOLDER", "cached_tetrahedra"]

FOLDER = "PALPATE_MESHES"
"""Environment variable that names the folder of the meshes; without it none are stored."""
_FORMAT = 1
"""Changes whenever the same input is meshed in another way."""


def cached_tetrahedra(
    shape: Shape, size: SizeField, mesher: TetMesher
) -> tuple[FloatArray, IntArray]:
    """Corners (c, 3) [m] and tetrahedra (e, 4) by a mesher, or as it made them before.

    A mesh is found by the surface, the held region, the length of the edges, and the mesher with
    its version. A file that cannot be read is made anew; a folder that cannot be written is left
    alone.
    """
    folder = os.environ.get(FOLDER, "")
    if not folder:
        return mesher.tetrahedra(shape, size)
    file = Path(folder) / f"{_key(shape, size, mesher)}.npz"
    found = _read(file)
    if found is None:
        found = mesher.tetrahedra(shape, size)
        with contextlib.suppress(OSError):
            _write(file, *found)
    return found


def _key(shape: Shape, size: SizeField, mesher: TetMesher) -> str:
    try:
        made_by = version(mesher.package)
    except PackageNotFoundError:
        made_by = "unknown"
    lengths = (size.radius, size.finest, size.coarsest, size.growth)
    said = repr((_FORMAT, mesher.name, made_by, lengths)).encode()
    places = np.ascontiguousarray(size.places, float).tobytes()
    return hashlib.sha256(shape.digest + said + places).hexdigest()[:40]


def _read(file: Path) -> tuple[FloatArray, IntArray] | None:
    """The mesh of a file, whose time of use is noted; None where there is none."""
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as stored:
            corners, tetrahedra = stored["corners"], stored["tetrahedra"]
        os.utime(file)
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile):
        return None
    whole = corners.ndim == 2 and tetrahedra.ndim == 2 and tetrahedra.shape[1] == 4
    if not whole or not len(tetrahedra) or tetrahedra.max() >= len(corners):
        return None
    return corners, tetrahedra


def _write(file: Path, corners: FloatArray, tetrahedra: IntArray) -> None:
    """Write a mesh; the file appears whole or not at all."""
    file.parent.mkdir(parents=True, exist_ok=True)
    handle, aside = tempfile.mkstemp(prefix=".part-", suffix=".npz", dir=file.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            np.savez_compressed(stream, corners=corners, tetrahedra=tetrahedra)
        os.replace(aside, file)
    finally:
        Path(aside).unlink(missing_ok=True)
