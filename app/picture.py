"""One moment of a run as arrays to draw, in the phantom frame [m]; nothing here knows how it is drawn."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from app import colours
from app.runs import Replay
from app.surface import FineSurface, IntArray, grid_edges, refine
from core.frames import FloatArray

if TYPE_CHECKING:
    from core.whatif import Moment

__all__ = ["Ball", "Colouring", "Layer", "Mesh", "Picture", "PointArray", "Reel"]

Layer = Literal["measured", "raw", "extended", "tool"]
Colouring = Literal["plain", "raw", "extended"]
PointArray = np.ndarray[Any, np.dtype[np.float32]]
Rgb = tuple[int, int, int]
MARGIN = 0.008
MOST_POINTS = 20_000
MOST_TRIANGLES = 25_000


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of one colour: vertices (n, 3) [m], faces (m, 3)."""

    vertices: PointArray
    faces: IntArray
    colour: Rgb


@dataclass(frozen=True, eq=False)
class Ball:
    """The tool: a sphere with a short shaft upwards; centre (3,) and radius [m]."""

    centre: FloatArray
    radius: float


@dataclass(frozen=True, eq=False)
class Picture:
    """What is to be seen.

    Attributes:
        frame: index in the sequence.
        cloud: (n, 3) measured points; None when hidden or when there are none. The same n for a whole sequence: what is not
            needed repeats the first point.
        points: how many of them were measured.
        meshes: name and surface; the bands of an error map are `band-00`... and `band-unseen`.
        wire: (k, 2, 3) grid lines of the model that is not drawn as a surface, and their colour.
        limit: the error map reaches from -limit to limit [m]; None when nothing is coloured by error.
    """

    frame: int
    cloud: PointArray | None
    points: int
    meshes: dict[str, Mesh]
    wire: tuple[FloatArray, Rgb] | None
    tool: Ball | None
    limit: float | None

    def checksum(self) -> str:
        """A short digest of all arrays, for comparing what two places hold."""
        digest = hashlib.sha256(str(self.frame).encode())
        for array in (self.cloud, *(mesh.vertices for mesh in self.meshes.values()), self.wire and self.wire[0]):
            digest.update(b"-" if array is None else np.ascontiguousarray(array, dtype=np.float32).tobytes())
        return digest.hexdigest()[:16]

    def summary(self) -> dict[str, Any]:
        """Counts of what is drawn."""
        return {
            "points": self.points,
            "triangles": {name: len(mesh.faces) for name, mesh in self.meshes.items()},
            "lines": 0 if self.wire is None else len(self.wire[0]),
            "tool": None if self.tool is None else [round(float(x), 6) for x in self.tool.centre],
            "limit": self.limit,
            "checksum": self.checksum(),
        }


class Reel:
    """One replayed sequence ready to be drawn; `clouds(i)` gives the raw cloud i in the camera frame, or is None."""

    def __init__(self, replay: Replay, clouds: Callable[[int], FloatArray] | None) -> None:
        self.replay = replay
        self._clouds = clouds
        self._coarse: FineSurface = refine(replay["rest"], replay["faces"], 1)
        self._fine: FineSurface = refine(replay["rest"], replay["faces"], _parts(len(replay["faces"])))
        self._edges = grid_edges(replay["rest"], replay["faces"])
        self._points = 0
        self.limit = colours.nice_limit(replay["error_raw"])

    def instead(self, frame: int, moment: Moment) -> Reel:
        """The same reel with another solution of one frame in place of the extended model's."""
        changed = {name: self.replay[name].copy() for name in ("extended", "error_extended", "tool_extended")}
        found = {"extended": moment.surface, "error_extended": moment.error, "tool_extended": moment.tool}
        for name, values in found.items():
            changed[name][frame] = values
        other = copy(self)
        single = {"tool_radius_extended": moment.radius, "camera_extended": moment.camera}
        other.replay = Replay(self.replay.name, {**self.replay.arrays, **changed, **single})
        return other

    def picture(self, frame: int, layers: frozenset[Layer], colouring: Colouring, limit: float | None, crop: bool) -> Picture:
        """The moment `frame`: the coloured model (or, plain, the extended one) as a surface, the other one as grid lines."""
        models: list[Literal["raw", "extended"]] = [name for name in ("extended", "raw") if name in layers]
        solid = colouring if colouring != "plain" and colouring in models else (models[0] if models else None)
        scale = (limit or self.limit) if solid and colouring == solid else None
        other = next((name for name in models if name != solid), None)
        seen_by = solid or "raw"
        cloud, points = self._cloud(frame, seen_by, crop) if "measured" in layers else (None, 0)
        return Picture(
            frame=frame,
            cloud=cloud,
            points=points,
            meshes={} if solid is None else self._bands(frame, solid, scale) if scale else self._plain(frame, solid),
            wire=None if other is None else (self.replay[other][frame][self._edges], getattr(colours, other.upper())),
            tool=self._tool(frame, seen_by) if "tool" in layers else None,
            limit=scale,
        )

    def _plain(self, frame: int, model: str) -> dict[str, Mesh]:
        vertices = self._coarse.spread(self.replay[model][frame])
        return {model: Mesh(vertices.astype(np.float32), self._coarse.faces, getattr(colours, model.upper()))}

    def _bands(self, frame: int, model: str, limit: float) -> dict[str, Mesh]:
        vertices = self._fine.spread(self.replay[model][frame]).astype(np.float32)
        errors = self._fine.spread(self.replay[f"error_{model}"][frame])
        band = colours.band_of(errors[self._fine.faces].mean(axis=1), limit)
        meshes = {}
        for number in np.unique(band):
            used, faces = np.unique(self._fine.faces[band == number], return_inverse=True)
            unseen = number == colours.BANDS
            name = "band-unseen" if unseen else f"band-{number:02d}"
            meshes[name] = Mesh(vertices[used], faces.reshape(-1, 3), colours.UNSEEN if unseen else colours.SIGNED[number])
        return meshes

    def _cloud(self, frame: int, model: str, crop: bool) -> tuple[PointArray | None, int]:
        if self._clouds is None:
            return None, 0
        points = self.replay.camera(model).apply(self._clouds(int(self.replay["cloud_index"][frame])))
        if crop:
            points = points[_near_box(points, self.replay.size)]
        kept = points[:: len(points) // MOST_POINTS + 1]
        if not len(kept):
            return None, 0
        self._points = max(self._points, 1000 * (len(kept) // 800 + 1))
        padded = np.tile(kept[:1], (self._points, 1)).astype(np.float32)
        padded[: len(kept)] = kept
        return padded, len(kept)

    def _tool(self, frame: int, model: str) -> Ball:
        return Ball(np.asarray(self.replay[f"tool_{model}"][frame], dtype=float), float(self.replay[f"tool_radius_{model}"]))


def _parts(faces: int) -> int:
    """How finely each triangle is cut for smooth bands: as many triangles as a browser draws with ease."""
    return int(np.clip(np.sqrt(MOST_TRIANGLES / faces), 1, 10))


def _near_box(points: FloatArray, size: FloatArray) -> Any:
    """Which points lie within the box or not far from it, and above the table."""
    low = np.array([-size[0] / 2, -size[1] / 2, 0.0]) - MARGIN * np.array([1.0, 1.0, -0.1])
    high = np.array([size[0] / 2, size[1] / 2, size[2]]) + MARGIN
    return np.all((points > low) & (points < high), axis=1)
