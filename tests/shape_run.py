"""A run of a liver-like phantom in the format of a real one, and its dataset, for tests."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from shapes import write_felt_shape
from small_dataset import ply_bytes

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.recording.interior_fields import InteriorFields
from palpate.setup.setup import Shape
from palpate.synthetic.bench.depth_camera import CameraScene, DepthCamera, place_camera
from palpate.synthetic.bodies.shape_families import draw_shape

__all__ = ["LIVER", "LUMP", "camera_over", "liver", "write_shape_dataset", "write_shape_run"]

LIVER = "liver-1"
FRAMES, RADIUS, DEEPEST = 5, 5e-3, 4e-3
LUMP = np.array([0.01, 0.0, 0.012])
OFF_CENTRE = np.array([0.03, -0.02, 0.0])
"""Place of the body's middle in the phantom frame [m]: no frame is bound to be in the middle."""


@lru_cache(maxsize=1)
def liver() -> Shape:
    """A liver whose phantom frame is not in its middle."""
    drawn = draw_shape("liver", 3)
    return Shape(drawn.vertices + OFF_CENTRE, drawn.triangles, name="phantom.stl")


@lru_cache(maxsize=1)
def camera_over() -> DepthCamera:
    """A depth camera that sees the liver from the side of +x and -y."""
    body = liver()
    surface = (body.vertices - OFF_CENTRE, body.triangles)
    signs = np.array([1.0, -1.0])
    camera = place_camera(np.random.default_rng(5), body.size, surface, signs, 2600, 0.5e-3)
    pose = Transform(np.eye(3), OFF_CENTRE) @ camera.phantom_from_camera
    return DepthCamera(**{**vars(camera), "phantom_from_camera": pose})


def write_shape_dataset(folder: Path) -> Path:
    """Write a dataset of the liver with one felt push, of which all clouds are the one at rest."""
    body, camera = liver(), camera_over()
    folder.mkdir(parents=True)
    write_felt_shape(folder, body.vertices, body.triangles)
    surface = (body.vertices, body.triangles)
    scene = CameraScene(surface, None, np.array([0.0, 0.0, -1.0]), 1.0)
    cloud = camera.cloud(scene, np.random.default_rng(6))
    (folder / "rest.ply").write_bytes(ply_bytes(cloud))
    with (folder / "dataset.toml").open("a") as text:
        text.write('[camera]\nname = "virtual"\ndepth_sigma = 0.002\n')
    recorded = folder / "sequences" / "p1"
    (recorded / "clouds").mkdir()
    rows = ["t,file"]
    for number in range(FRAMES):
        rows.append(f"{0.2 * number:.1f},clouds/{number}.ply")
        (recorded / "clouds" / f"{number}.ply").write_bytes(ply_bytes(cloud))
    (recorded / "clouds.csv").write_text("\n".join(rows) + "\n")
    return folder


def write_shape_run(folder: Path, dataset: Path) -> None:
    """Write a run by its contract: a liver pushed in at its highest point, over a lump."""
    (folder / "replays").mkdir(parents=True)
    (folder / "pictures").mkdir()
    cause = {
        "effect": "stiff_inclusion",
        "probability": 0.97,
        "parameters": {
            name: {"value": value, "unit": "m", "low": value - 1e-3, "high": value + 1e-3}
            for name, value in (*zip("xyz", OFF_CENTRE + LUMP, strict=True), ("radius", 7e-3))
        },
        "in_file_frame": {"centre": [0.0123, -0.0456, 0.0789]},
    }
    report = {"format": 1, "dataset": "liver", "verdict": "found", "causes": [cause], "ranking": []}
    (folder / "report.json").write_text(json.dumps(report))
    (folder / "model.json").write_text(json.dumps({"format": 1}))
    origin = {"dataset": str(dataset), "created": 1.0, "seconds": 60.0, "splits": {"p1": "test"}}
    (folder / "origin.json").write_text(json.dumps(origin))
    surface = liver().surface()
    np.savez(
        folder / "patterns.npz",
        centres=surface.patch_centres,
        normals=surface.patch_normals,
        measured=np.full(surface.patches, 1e-4),
        predicted=np.full(surface.patches, 9e-5),
    )
    np.savez(folder / "replays" / "p1.npz", **_arrays(liver()))


def _arrays(body: Shape) -> dict[str, Any]:
    surface = body.surface(2.5e-3)
    rest = surface.vertices
    top = rest[rest[:, 2].argmax()]
    depth = DEEPEST * np.sin(np.pi * np.linspace(0.1, 0.9, FRAMES))
    tool = top + np.column_stack([np.zeros(FRAMES), np.zeros(FRAMES), RADIUS - depth])
    models: dict[str, Any] = {}
    for name, share in (("raw", 1.0), ("extended", 0.8)):
        moved = rest + np.stack([_pushed(rest, top, share * one) for one in depth])
        error = share * np.outer(depth, 0.1 * np.sin(100 * rest[:, 0]))
        models |= {
            name: moved.astype(np.float32),
            f"tool_{name}": tool,
            f"tool_radius_{name}": RADIUS,
            f"error_{name}": error.astype(np.float32),
            f"distance_{name}": 0.1 * share * depth,
            f"paper_{name}": share * depth,
            f"camera_{name}": camera_over().phantom_from_camera.matrix,
            **_inside(body, top, share * depth).arrays(name),
        }
    return {
        "time": 0.2 * np.arange(FRAMES),
        "cloud_index": np.arange(FRAMES),
        "rest": rest,
        "faces": surface.faces,
        "noise_floor": 1e-5,
        "outcome": np.zeros(FRAMES, np.int8),
        **models,
    }


def _inside(body: Shape, top: FloatArray, depth: FloatArray) -> InteriorFields:
    axes = [np.linspace(low, high, 12) for low, high in zip(body.low, body.high, strict=True)]
    z, y, x = (part.ravel() for part in np.meshgrid(*axes[::-1], indexing="ij"))
    places = np.column_stack([x, y, z])
    return InteriorFields(
        np.full((len(depth), 3), 12),
        np.tile(np.concatenate(axes), len(depth)),
        np.concatenate([_pushed(places, top, one) for one in depth]),
        np.zeros(len(depth) * len(places)),
        5e3,
    )


def _pushed(places: FloatArray, top: FloatArray, depth: float) -> FloatArray:
    """Displacement (n, 3) [m] of places under a push, fading to the side and to the base."""
    near = np.exp(-((np.linalg.norm(places[:, :2] - top[:2], axis=1) / 0.01) ** 2))
    return np.outer(depth * near * places[:, 2] / top[2], [0.0, 0.0, -1.0])
