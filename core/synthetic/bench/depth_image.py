"""Depth images of the virtual camera, and clouds with the nuisances of a scenario."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.bench.depth_camera import CameraScene, DepthCamera
from palpate.synthetic.nuisances.nuisance import DepthImage, ImageSource, Nuisance
from palpate.synthetic.nuisances.nuisance_chain import seen_through
from palpate.synthetic.scenario.disturbance import rippled

__all__ = ["nuisance_cloud", "shown", "take_image"]

_STRAY, _STRAY_RANGE = 0.006, (0.75, 1.3)
"""Share of stray points [1], and the range of their depth over the true one [1]."""


def take_image(camera: DepthCamera, scene: CameraScene) -> DepthImage:
    """The depth image of a scene as the camera misreads it, without any nuisance."""
    hit = camera.cast(scene)
    shape = camera.shape
    what = hit["geometry_ids"].numpy().astype(np.int32)
    met = hit["t_hit"].numpy().astype(float)
    true = np.where(np.isfinite(met), met, np.nan)
    depth = rippled(camera.disturbances, camera.reading(true))
    _, faces = scene.block
    corners = np.asarray(faces)[np.where(what == 0, hit["primitive_ids"].numpy(), 0).astype(int)]
    u, v = hit["primitive_uvs"].numpy().astype(float).T
    rest = scene.block[0] if scene.rest is None else scene.rest
    weights = np.stack([1 - u - v, u, v], axis=1)
    places = np.einsum("nk,nki->ni", weights, rest[corners])
    return DepthImage(
        depth.reshape(shape),
        what.reshape(shape),
        camera.rays.reshape(*shape, 3),
        hit["primitive_normals"].numpy().astype(float).reshape(*shape, 3),
        np.where(what[:, None] == 0, places, np.nan).reshape(*shape, 3),
    )


def _cloud_of(camera: DepthCamera, image: DepthImage, rng: np.random.Generator) -> FloatArray:
    """Draw one raw cloud (k, 3) [m], camera frame, from an image: thinned, with stray points."""
    on_block = image.what == 0
    block = min(1.0, camera.density / max(int(on_block.sum()), 1))
    table = min(1.0, 0.45 * camera.density / max(int((~on_block).sum()), 1))
    keep = rng.random(image.depth.shape) < np.where(image.what == 1, table, block)
    seen = keep & np.isfinite(image.depth)
    depth = image.depth[seen]
    stray = rng.random(len(depth)) < _STRAY
    depth[stray] *= rng.uniform(*_STRAY_RANGE, stray.sum())
    return image.rays[seen] * depth[:, None]


def nuisance_cloud(
    nuisances: Sequence[Nuisance],
    camera: DepthCamera,
    source: ImageSource,
    instant: float,
    rng: np.random.Generator,
) -> FloatArray:
    """Draw the cloud (k, 3) [m], camera frame, of an instant [s], as the nuisances leave it."""
    return _cloud_of(camera, seen_through(nuisances, source, rng)(instant), rng)


def shown(camera: DepthCamera, scene: CameraScene) -> ImageSource:
    """A source of images of a scene that does not change."""
    image = take_image(camera, scene)
    return lambda instant: image
