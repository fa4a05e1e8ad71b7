"""Bias of the phantom's points that segmentation keeps, by distance from tool, table and rims.

A selection by noisy places keeps points whose noise points one way. The scene is known, so that the
error of each kept point along its line of sight is known, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import open3d as o3d
import trimesh
from rich.table import Table
from scipy.spatial.transform import Rotation

from benchmarks.cpu_time import timed
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.segmentation import Cleaner
from palpate.measurement.tool_pose import ToolPose, ToolShaft
from palpate.setup.box import Box

__all__ = ["run"]

SIZE = (0.0687, 0.0393, 0.0358)
BLOCK = Box(size=SIZE)
BALL, DEPTH = 5e-3, 4e-3
"""Radius of the tool and depth of the push [m]."""
SHAFTS = {
    "thin": (3e-3, 0.0),
    "thick": (6.5e-3, 0.0),
    "thin, tilted": (3e-3, 25.0),
    "thick, tilted": (6.5e-3, 25.0),
}
"""Radius of the shaft [m] and its angle to the vertical [degree]."""
SIGMAS = (0.5e-3, 1e-3, 2e-3, 3e-3)
PIXELS, POOLED, FRAMES = 240, 15_000, 60
"""Pixels along each side of the image, points that are enough in a bin, most frames of a case."""
FAR, LARGEST = 6e-3, 0.05e-3
"""Distance from the shaft's axis beyond which the bias is bounded, and the bound [m]."""
BINS = {
    "shaft axis": (4e-3, 6e-3, 8e-3, 10e-3, 12e-3, 20e-3),
    "ball": (0.0, 2e-3, 4e-3, 8e-3),
    "table": (8e-3, 12e-3, 20e-3, 30e-3),
    "rim": (0.0, 2e-3, 4e-3, 8e-3),
}
"""Ends of the bins of distance [m]."""


@dataclass(frozen=True, eq=False)
class _Kept:
    """Phantom points that were kept: true places (n, 3) and errors along the ray (n,) [m]."""

    places: FloatArray
    errors: FloatArray


def _camera() -> Transform:
    """phantom_from_camera of a camera 38 cm from the block that sees its top and two sides."""
    eye, target = np.array([-0.19, -0.21, 0.26]), np.array([0.0, 0.0, SIZE[2] / 2])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return Transform(np.stack([right, np.cross(forward, right), forward], axis=1), eye)


def _block(centre: FloatArray) -> trimesh.Trimesh:
    """The block, its top pressed in so that it touches the ball and runs out flat around it."""
    box = trimesh.creation.box(SIZE).subdivide_to_size(1e-3)
    box.apply_translation([0.0, 0.0, SIZE[2] / 2])
    away = np.linalg.norm(box.vertices[:, :2] - centre[:2], axis=1)
    dent = DEPTH / (1 + (away / 6e-3) ** 2)
    ball = centre[2] - np.sqrt(np.maximum(BALL**2 - away**2, 0.0))
    height = np.where(away < BALL, np.minimum(SIZE[2] - dent, ball), SIZE[2] - dent)
    box.vertices[:, 2] *= height / SIZE[2]
    return box


def _scene(centre: FloatArray, shaft: FloatArray, radius: float) -> Any:
    """Ray casting scene of block 0, table 1, ball 2 and shaft 3."""
    table = trimesh.creation.box((0.4, 0.4, 0.002))
    table.apply_translation([0.0, 0.0, -0.001])
    ball = trimesh.creation.icosphere(4, BALL)
    ball.apply_translation(centre)
    rod = trimesh.creation.cylinder(radius, segment=[centre, centre + 0.15 * shaft], sections=64)
    cast = o3d.t.geometry.RaycastingScene(nthreads=1)
    for mesh in (_block(centre), table, ball, rod):
        cast.add_triangles(
            o3d.core.Tensor.from_numpy(np.asarray(mesh.vertices, dtype=np.float32)),
            o3d.core.Tensor.from_numpy(np.asarray(mesh.faces, dtype=np.uint32)),
        )
    return cast


def _frame(
    pose: Transform, radius: float, tilt: float, sigma: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, Any, ToolPose]:
    """Draw a place of the tool; return the cloud (n, 3), camera frame, the true depths (n,) [m],
    what each point belongs to (n,), and the tool.
    """
    half = np.array(SIZE[:2]) / 2 - 8e-3
    centre = np.append(rng.uniform(-half, half), SIZE[2] - DEPTH + BALL)
    turn = Rotation.from_euler("zyz", [rng.uniform(0, 360), tilt, 0], degrees=True)
    shaft = turn.apply([0.0, 0.0, 1.0])
    tangent = np.tan(np.radians(9.0)) * np.linspace(-1, 1, PIXELS)
    u, v = (grid.ravel() for grid in np.meshgrid(tangent, tangent))
    u, v = u + rng.uniform(-2e-4, 2e-4), v + rng.uniform(-2e-4, 2e-4)
    rays = np.column_stack([u, v, np.ones_like(u)])
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    sight = pose.rotate(rays)
    origin = np.broadcast_to(pose.translation, sight.shape)
    hit = _scene(centre, shaft, radius).cast_rays(
        o3d.core.Tensor.from_numpy(np.hstack([origin, sight]).astype(np.float32)), nthreads=1
    )
    depth, what = hit["t_hit"].numpy().astype(float), hit["geometry_ids"].numpy()
    seen = np.isfinite(depth)
    depth, what, rays = depth[seen], what[seen].astype(int), rays[seen]
    noisy = depth + sigma * rng.standard_normal(len(depth))
    return rays * noisy[:, None], depth, what, ToolPose(centre, ToolShaft(shaft, radius))


def _distances(places: FloatArray, tool: ToolPose) -> dict[str, FloatArray]:
    """Distances (n,) [m] of true places (n, 3) from what removes points."""
    away = places - tool.centre
    assert tool.shaft is not None
    height = away @ tool.shaft.axis
    axis = np.linalg.norm(away - np.maximum(height, 0.0)[:, None] * tool.shaft.axis, axis=1)
    half = np.array(SIZE[:2]) / 2
    sides = np.sort(np.column_stack([half - np.abs(places[:, :2]), SIZE[2] - places[:, 2:]]))
    return {
        "shaft axis": axis,
        "ball": np.linalg.norm(away, axis=1) - BALL,
        "table": places[:, 2],
        # The nearest face is the point's own: the second nearest tells how far its edge is.
        "rim": sides[:, 1],
    }


def _case(name: str, sigma: float) -> tuple[dict[str, list[FloatArray]], float, float, float]:
    """Pool frames of one shaft and noise.

    Returns:
        errors of the kept points by bin, shares of phantom kept and of others among the kept, and
        CPU seconds a cloud.
    """
    rng, pose = np.random.default_rng([7, int(1e6 * sigma), *name.encode()]), _camera()
    radius, tilt = SHAFTS[name]
    cleaner = Cleaner(geometry=BLOCK, phantom_from_camera=pose, tool_radius=BALL, noise=sigma)
    pooled: dict[str, list[list[FloatArray]]] = {
        key: [[] for _ in ends[1:]] for key, ends in BINS.items()
    }
    phantom = kept_phantom = kept = 0
    spent = 0.0
    for _ in range(FRAMES):
        cloud, depth, what, tool = _frame(pose, radius, tilt, sigma, rng)
        clean, seconds = timed(partial(cleaner.clean, cloud, tool))
        spent += seconds
        rows = clean.indices[what[clean.indices] == 0]
        phantom, kept_phantom = phantom + int((what == 0).sum()), kept_phantom + len(rows)
        kept += len(clean.indices)
        length = np.linalg.norm(cloud[rows], axis=1)
        places = pose.apply(cloud[rows] * (depth[rows] / length)[:, None])
        errors, far = length - depth[rows], _distances(places, tool)
        good = places[:, 2] > cleaner.lowest
        for key, ends in BINS.items():
            use = good if key == "shaft axis" else good & (far["shaft axis"] > FAR)
            for place, (low, high) in enumerate(pairwise(ends)):
                inside = use & (far[key] >= low) & (far[key] < high)
                pooled[key][place].append(errors[inside])
        if all(sum(map(len, own)) >= POOLED for bins in pooled.values() for own in bins):
            break
    errors_by_bin = {key: [np.concatenate(own) for own in bins] for key, bins in pooled.items()}
    frames = max(len(own) for bins in pooled.values() for own in bins)
    return errors_by_bin, kept_phantom / phantom, 1 - kept_phantom / kept, spent / frames


def _text(errors: FloatArray, sigma: float, bounded: bool) -> tuple[str, bool]:
    """Mean of the errors and their spread over the noise, and whether the mean is within bounds."""
    if len(errors) < 100:
        return "–", True
    mean, error = float(errors.mean()), float(errors.std() / np.sqrt(len(errors)))
    good = not bounded or abs(mean) < LARGEST + 2 * error
    text = f"{1e3 * mean:+.3f} ({errors.std() / sigma:.2f})"
    return (text if good else f"[red]{text}[/]"), good


def run() -> list[Table]:
    """Print the bias; RuntimeError where it exceeds the bound beyond 6 mm from the shaft's axis."""
    tables = {
        key: Table(
            "shaft",
            "noise",
            *(f"{1e3 * low:.0f}–{1e3 * high:.0f} mm" for low, high in pairwise(ends)),
            title=f"Mean error [mm] (spread / noise) of kept points, by distance from the {key}",
        )
        for key, ends in BINS.items()
    }
    whole = Table("shaft", "noise", "phantom kept", "others kept", "ms a cloud", title="Cleaning")
    wrong: list[str] = []
    for name in SHAFTS:
        for sigma in SIGMAS:
            pooled, share, others, seconds = _case(name, sigma)
            noise = f"{1e3 * sigma:.1f} mm"
            whole.add_row(name, noise, f"{share:.1%}", f"{others:.2%}", f"{1e3 * seconds:.1f}")
            for key, bins in pooled.items():
                texts = []
                for low, errors in zip(BINS[key], bins, strict=False):
                    text, good = _text(errors, sigma, key != "shaft axis" or low >= FAR)
                    texts.append(text)
                    if not good:
                        wrong.append(
                            f"{name} shaft, {noise}, {1e3 * low:.0f} mm from {key}: {text}"
                        )
                tables[key].add_row(name, noise, *texts)
    if wrong:
        raise RuntimeError("; ".join(wrong))
    return [whole, *tables.values()]
