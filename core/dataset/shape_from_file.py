"""Phantoms of any shape: the surface from a file, checked, with its fixed base."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.dataset.files import open_inside, problem
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import MeshError
from palpate.setup.free_form.fixed_region import Plane
from palpate.setup.free_form.surface_file import FORMATS, read_surface
from palpate.setup.setup import Shape

__all__ = ["read_shape"]

_SMALLEST, _LARGEST = 1e-3, 2.0
"""Least and largest extent of a phantom along any axis [m], as for a box."""
_BASE_TOLERANCE = 0.02
"""Height over the lowest point up to which triangles belong to the base, over the total height
[1]."""
_OFF_ORIGIN = 2e-3
"""Largest height of the base from z = 0 [m]."""


def read_shape(root: Path, file: str) -> Shape:
    """Read the body within the surface `file` of a dataset, fixed at its base; DatasetError where
    it cannot be meshed.
    """
    open_inside(root, file).close()
    if Path(file).suffix.lower() not in FORMATS:
        raise problem(
            file,
            f"is no surface that can be read; expected one of {', '.join(FORMATS)}: export it as "
            "STL",
        )
    try:
        vertices, triangles = read_surface(root / file)
        if len(triangles) and np.isfinite(vertices).all():
            _check_units(file, vertices)
        return Shape(vertices, triangles, _base(vertices), Path(file).name)
    except MeshError as error:
        raise problem(file, error.message.removeprefix(f"{Path(file).name}: ")) from error


def _check_units(file: str, vertices: FloatArray) -> None:
    size = np.ptp(vertices, axis=0)
    shown = " x ".join(f"{length:.4g}" for length in size)
    if size.max() > _LARGEST or size.min() < _SMALLEST:
        fits = size.max() * 1e-3 <= _LARGEST and size.min() * 1e-3 >= _SMALLEST
        hint = "it seems to be in millimetres, export it in metres" if fits else "correct its unit"
        text = f"measures {shown} m along x, y, z; expected {_SMALLEST:g} to {_LARGEST:g} m: {hint}"
        raise problem(file, text, value=shown)
    low = float(vertices[:, 2].min())
    if abs(low) > _OFF_ORIGIN:
        text = (
            f"its lowest point lies at z = {low:.4g} m; expected the base at z = 0, where the "
            "phantom frame begins: move it there"
        )
        raise problem(file, text, value=f"{low:.4g}")


def _base(vertices: FloatArray) -> Plane:
    """The lowest plane with a tolerance, since scanned bases are not flat."""
    if not len(vertices):
        return Plane()
    low, height = float(vertices[:, 2].min()), float(np.ptp(vertices[:, 2]))
    return Plane(height=low, tolerance=max(1e-4, _BASE_TOLERANCE * height))
