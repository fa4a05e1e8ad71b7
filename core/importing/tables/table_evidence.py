"""Statements beside a table that tell in which unit and frame its columns can be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.importing.tables.table_text import read_table
from palpate.registration.robot.robot_fit import rigid_fits

__all__ = ["TableEvidence"]

FLAT = 0.1
"""Least second singular value of the touches over the first by which they span a plane [1]."""


@dataclass(frozen=True, eq=False)
class TableEvidence:
    """Statements of a user beside the recordings.

    Attributes:
        size: largest extent of the phantom [m]; None where it is not stated.
        touches: (n, 3) touched places [m], robot frame.
        inward: (3,) direction from above into the phantom, robot frame; None where nothing
            relates both.
        seconds: durations [s] of streams whose times are surely in seconds.
    """

    size: float | None = None
    touches: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    inward: FloatArray | None = None
    seconds: tuple[float, ...] = ()

    @classmethod
    def of(
        cls, setup: Mapping[str, Any], touches: str, seconds: tuple[float, ...] = ()
    ) -> TableEvidence:
        """Read what tables of dataset.toml and the file of touches state.

        What is not stated or cannot be read is left out: the import tells of it later.
        """
        landmarks = {
            name: place
            for name, place in _table(setup, "landmarks").items()
            if isinstance(place, list) and len(place) == 3
        }
        try:
            names, places = _touched(touches)
        except (DatasetError, OSError):
            names, places = (), np.zeros((0, 3))
        extent = _table(setup, "phantom").get("size")
        spread = np.array(extent if isinstance(extent, list) else [], dtype=float)
        if not len(spread) and len(landmarks) > 1:
            spread = np.ptp(np.array(list(landmarks.values()), dtype=float), axis=0)
        size = float(spread.max()) if len(spread) else None
        return cls(size, places, _inward(setup, landmarks, names, places), seconds)


def _table(setup: Mapping[str, Any], name: str) -> dict[str, Any]:
    found = setup.get(name, {})
    return found if isinstance(found, dict) else {}


def _touched(file: str) -> tuple[tuple[str, ...], FloatArray]:
    """Names and places (n, 3) [m] of touches.csv; none without a file."""
    if not file:
        return (), np.zeros((0, 3))
    table = read_table(Path(file))
    places = np.stack([table.numbers(axis) for axis in "xyz"], axis=-1)
    return tuple(table.texts("landmark")), places


def _inward(
    setup: Mapping[str, Any],
    landmarks: Mapping[str, list[float]],
    names: tuple[str, ...],
    places: FloatArray,
) -> FloatArray | None:
    """Direction against `up` in the robot frame, by a stated pose or by the touched landmarks."""
    up = np.array(_table(setup, "phantom").get("up", [0.0, 0.0, 1.0]), dtype=float)
    stated = _table(setup, "robot").get("phantom_from_robot")
    if stated is not None:
        rotation = np.array(stated, dtype=float)[:3, :3]
    else:
        known = [at for at, name in enumerate(names) if name in landmarks]
        if len(known) < 4:
            return None
        source = places[known]
        spread = np.linalg.svd(source - source.mean(axis=0), compute_uv=False)
        if spread[1] < FLAT * spread[0]:
            return None
        targets = np.array([landmarks[names[at]] for at in known], dtype=float)
        rotation = rigid_fits(source, targets[None])[0][0]
    return np.asarray(-rotation.T @ up / np.linalg.norm(up))
