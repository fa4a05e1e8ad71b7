"""The phantom and the cloud that a person registers by hand."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

import numpy as np

from palpate.app.drawing.free_surface import creases
from palpate.app.storage.dataset_library import Library
from palpate.app.storage.registration_store import refuse_unregistrable
from palpate.dataset.accepted_registration import rest_digest
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.camera.levelling import as_seen, levelled
from palpate.registration.faces import IndexArray
from palpate.setup.phantom_geometry import Geometry

if TYPE_CHECKING:
    from palpate.dataset import Dataset

__all__ = ["Phantom", "Phantoms"]

MOST_DRAWN = 500_000
"""Points of a rest cloud that a page draws and picks from: of a larger cloud every second, every
third and so on. ICP uses all points."""
SHARP = np.radians(40.0)
"""Triangles that meet at a larger angle than this have an edge between them [rad]."""


@dataclass(frozen=True, eq=False)
class Phantom:
    """A phantom and its rest cloud.

    Attributes:
        cloud: (n, 3) rest cloud as it is drawn [m], camera frame.
        geometry: of the phantom.
        landmarks: places by name [m], phantom frame.
        stated: initial guess of phantom_from_camera in dataset.toml; None where there is none.
    """

    cloud: FloatArray
    geometry: Geometry
    landmarks: dict[str, tuple[float, float, float]]
    stated: Transform | None

    @property
    def vertices(self) -> FloatArray:
        """(v, 3) vertices of the phantom's whole surface [m]."""
        return self.geometry.closed_surface[0]

    @property
    def faces(self) -> IndexArray:
        """(t, 3) triangles with outward normals."""
        return self.geometry.closed_surface[1].astype(np.int64)

    @cached_property
    def edges(self) -> FloatArray:
        """Ends (e, 2, 3) of the surface's sharp edges [m]."""
        return creases(self.vertices, self.faces, SHARP)

    def start(self, kind: str) -> Transform:
        """phantom_from_camera for drawing the cloud before any pair is clicked."""
        if kind == "stated" and self.stated is not None:
            return self.stated
        return as_seen(self.cloud) if kind == "camera" else levelled(self.cloud)


class Phantoms:
    """Reads phantoms, one at a time. Pages that register the same phantom share one in memory."""

    def __init__(self, library: Library) -> None:
        self._library = library
        self._lock = threading.Lock()
        self._shared: WeakValueDictionary[tuple[str, bytes, str], Phantom] = WeakValueDictionary()

    def open(self, name: str) -> Phantom:
        """Phantom and rest cloud of one dataset; RegistrationError where there is no such cloud."""
        with self._lock:
            folder = self._library.path(name)
            dataset = self._library.open(name)
            refuse_unregistrable(dataset)
            files = (name, (folder / "dataset.toml").read_bytes(), rest_digest(folder))
            phantom = self._shared.get(files)
            if phantom is None:
                phantom = self._shared[files] = _read(dataset)
            return phantom


def _read(dataset: Dataset) -> Phantom:
    cloud, config = dataset.rest_cloud(), dataset.config
    drawn = cloud[:: 1 + (len(cloud) - 1) // MOST_DRAWN].copy() if len(cloud) else cloud
    return Phantom(drawn, dataset.geometry, dict(config.landmarks), config.to_phantom)
