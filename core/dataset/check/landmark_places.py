"""Landmarks off the stated surface, and which turn, mirror, scale or shift puts them on it.

The touches agree with landmarks that were moved or turned as a whole, so that only the surface
shows it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from palpate.dataset.schema import DatasetConfig
from palpate.foundation.arrays import FloatArray
from palpate.setup.phantom_geometry import Geometry

__all__ = ["off_surface"]

OFF_SURFACE = 3e-3
"""Largest distance of a landmark from the phantom's surface [m]: picked on a scan they are within
two."""
FITS = 1e-3
"""Largest distance of all landmarks by which another place of them explains the others [m]."""
_ALIKE = 1e-8
"""Sum of squared distances [m^2] that counts as no difference: a tenth of a millimetre."""
_SCALES = (1e-3, 1e-2, 1e-1, 10.0, 100.0, 1e3)
"""Factors between metres and other units [1]."""


def off_surface(config: DatasetConfig, body: Geometry) -> list[str]:
    """Return a sentence where landmarks are off the surface, with the change that puts them on it.

    Args:
        config: of the dataset.
        body: the phantom.
    """
    names = list(config.landmarks)
    places = np.array([config.landmarks[name] for name in names]).reshape(-1, 3)
    if not names:
        return []
    apart = np.abs(body.facing(places)[0])
    if apart.max() <= OFF_SURFACE:
        return []
    worst = int(apart.argmax())
    told = (
        f"landmarks.{names[worst]} lies {1e3 * apart[worst]:.3g} mm from the phantom's surface, as "
        f"{(apart > OFF_SURFACE).sum()} of {len(names)} landmarks do by more than "
        f"{1e3 * OFF_SURFACE:g} mm"
    )
    bound = min(FITS, 0.3 * float(apart.max()))
    for words, other in _others(places, body) if len(names) > 2 else ():
        left = float(np.abs(body.facing(other)[0]).max())
        if left < bound:
            near = max(1e3 * left, 0.01)
            return [f"{told}, and all within {near:.2g} mm if they are {words}: correct them"]
    return [f"{told}: are they in the phantom's frame, in metres, and of this surface?"]


def _others(places: FloatArray, body: Geometry) -> Iterator[tuple[str, FloatArray]]:
    """Other places (n, 3) [m] of the landmarks, the likelier ones first, with words for each."""
    for degrees in (90, -90, 180):
        angle = np.radians(degrees)
        turn = np.array(
            [
                [np.cos(angle), -np.sin(angle), 0.0],
                [np.sin(angle), np.cos(angle), 0.0],
                [0.0, 0.0, 1.0],
            ]
        )
        words = f"turned by {degrees} degrees about z (or [phantom] size has x and y swapped)"
        yield words, places @ turn.T
    yield "mirrored in x", places * np.array([-1.0, 1.0, 1.0])
    yield "read as x, z, y", places[:, [0, 2, 1]]
    for scale in _SCALES:
        yield f"multiplied by {scale:g}, as of another unit", scale * places
    shift = _best_shift(places, body)
    shown = ", ".join(f"{1e3 * value:+.1f}" for value in shift + 0.0)
    yield f"moved by ({shown}) mm along x, y, z", places + shift
    scale = _best_scale(places, body)
    yield f"multiplied by {scale:.3f}", scale * places


def _best_scale(places: FloatArray, body: Geometry) -> float:
    """Factor by which the landmarks come nearest to the surface [1]."""
    scales = np.geomspace(0.6, 1.6, 99)
    left = [float((body.facing(scale * places)[0] ** 2).sum()) for scale in scales]
    best = float(scales[int(np.argmin(left))])
    close = best * np.geomspace(0.99, 1.01, 41)
    left = [float((body.facing(scale * places)[0] ** 2).sum()) for scale in close]
    return float(close[int(np.argmin(left))])


def _best_shift(places: FloatArray, body: Geometry) -> FloatArray:
    """Shortest shift (3,) [m] along one axis by which the landmarks come nearest to the surface."""
    found, best = np.zeros(3), np.inf
    for length in np.arange(0.5e-3, 40.1e-3, 0.5e-3):
        for way in (*np.eye(3), *-np.eye(3)):
            left = float((body.facing(places + length * way)[0] ** 2).sum())
            if left < best - _ALIKE:
                found, best = length * way, left
    return found
