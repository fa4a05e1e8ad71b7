"""The phantom and the cloud that a person registers by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.app.storage.dataset_library import Library
from palpate.app.storage.registration_store import refuse_unregistrable
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.camera.levelling import as_seen, levelled
from palpate.registration.faces import IndexArray

__all__ = ["Phantom", "open_phantom"]


@dataclass(frozen=True, eq=False)
class Phantom:
    """A phantom and its rest cloud.

    Attributes:
        cloud: (n, 3) rest cloud [m], camera frame.
        size: edge lengths of the block [m].
        landmarks: places by name [m], phantom frame.
        stated: initial guess of phantom_from_camera in dataset.toml; None where there is none.
    """

    cloud: FloatArray
    size: tuple[float, float, float]
    landmarks: dict[str, tuple[float, float, float]]
    stated: Transform | None

    @property
    def vertices(self) -> FloatArray:
        """(8, 3) corners of the block [m]."""
        x, y, z = self.size
        return np.array(
            [[i * x / 2, j * y / 2, k * z] for i in (-1, 1) for j in (-1, 1) for k in (0, 1)]
        )

    @property
    def faces(self) -> IndexArray:
        """(12, 3) triangles of the block with outward normals."""
        quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return np.array(
            [[a, b, c] for q in quads for a, b, c in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))],
            dtype=np.int64,
        )

    def start(self, kind: str) -> Transform:
        """phantom_from_camera for drawing the cloud before any pair is clicked."""
        if kind == "stated" and self.stated is not None:
            return self.stated
        return as_seen(self.cloud) if kind == "camera" else levelled(self.cloud)


def open_phantom(library: Library, name: str) -> Phantom:
    """Read rest cloud and block of one dataset; RegistrationError where it cannot be registered."""
    dataset = library.open(name)
    refuse_unregistrable(dataset)
    config = dataset.config
    return Phantom(dataset.rest_cloud(), config.size, dict(config.landmarks), config.to_phantom)
