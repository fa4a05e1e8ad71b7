"""Figures around the models: touched landmarks, fixed base, lumps, tubes, a cast's offset, and the
tool's path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from palpate.app.drawing import colours
from palpate.app.drawing.figures import Figure, LinesFigure, SurfaceFigure, float32
from palpate.app.drawing.free_surface import FreeSurface
from palpate.app.drawing.surface_bands import IntArray, lattice
from palpate.app.scene.model_layer import ModelLayer
from palpate.app.scene.stiffness_surface import StiffnessSurface, stiffness_surface_of
from palpate.app.storage.run_store import Run
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RunError

__all__ = [
    "Annotations",
    "CastOffset",
    "Lump",
    "TubeAlong",
    "annotations_of",
    "path_lines",
    "swept",
]

CROSS, TOUCH = 2.5e-3, 7e-4
"""Size of a landmark's cross and radius of a touch's bead [m]."""
OFFSET = 6e-4
"""Radius of a bead of a cast's offset [m]."""
TICK, TICKS_APART = 2.6e-3, 3.2e-3
"""Length and spacing of the hatching [m]."""
RAISED = 2e-4
"""Height of the hatching over the border, so that the table does not hide it [m]."""
LEVEL = 0.2
"""Least horizontal part of a normal along which the hatching is level [1]."""
AHEAD = (196, 201, 208)
"""Colour of the tool's path after the current frame."""


@dataclass(frozen=True)
class Lump:
    """A stiff inclusion: centre (x, y, z) and radius, each as low, value, high [m]."""

    centre: tuple[tuple[float, float, float], ...]
    radius: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class TubeAlong:
    """A stiff tube: axis (k, 3) [m], its radius as low, value, high [m], and half the width of the
    interval of its place across [m].
    """

    axis: FloatArray
    radius: tuple[float, float, float]
    unsure: float


@dataclass(frozen=True, eq=False)
class CastOffset:
    """Offset (k,) [m] of a cast from its drawing, at places (k, 3) [m] of the drawing's surface."""

    places: FloatArray
    offset: FloatArray

    def figures(self, layer: ModelLayer, frame: int, opacity: float) -> dict[str, Figure]:
        """A bead at each place, in the colour of its offset."""
        moved = layer.moved(frame, self.places)
        at = self.places if moved is None else moved
        bands = colours.band_of(self.offset, colours.nice_limit(self.offset))
        ball, faces = sphere(6, 4)
        figures: dict[str, Figure] = {}
        for band in np.unique(bands):
            own = at[bands == band]
            beads = (own[:, None] + OFFSET * ball).reshape(-1, 3)
            turns = (faces + len(ball) * np.arange(len(own))[:, None, None]).reshape(-1, 3)
            figures[f"cast-{band:02d}"] = SurfaceFigure(
                float32(beads), turns, colours.SIGNED[band], opacity
            )
        return figures


@dataclass(frozen=True, eq=False)
class Annotations:
    """Annotations of one run, phantom frame.

    Attributes:
        landmarks: (n, 3) stated places [m].
        touches: (n, 3) places of the tool when it touched them [m].
        loose: edge (as "-x") and extent [m] of each strip of the base that is detached in the
            extended model.
        lumps: balls among the causes.
        tubes: tubes among them.
        stiffness: free map of the stiffness; None without one.
        casts: offsets of the cast among them.
    """

    landmarks: FloatArray
    touches: FloatArray
    loose: tuple[tuple[str, float], ...] = ()
    lumps: tuple[Lump, ...] = ()
    tubes: tuple[TubeAlong, ...] = ()
    stiffness: StiffnessSurface | None = None
    casts: tuple[CastOffset, ...] = ()

    @property
    def inclusions(self) -> int:
        """Number of lumps, tubes and offsets of the cast."""
        return len(self.lumps) + len(self.tubes) + len(self.casts)

    def landmark_figures(self) -> dict[str, Figure]:
        """A cross at each landmark, a bead where it was touched, and a line between them."""
        if not len(self.landmarks):
            return {}
        arms = CROSS / 2 * np.stack([-np.eye(3), np.eye(3)], axis=1)
        crosses = (self.landmarks[:, None, None] + arms).reshape(-1, 2, 3)
        misses = np.stack([self.landmarks, self.touches], axis=1)
        ball, faces = sphere(8, 6)
        beads = (self.touches[:, None] + TOUCH * ball).reshape(-1, 3)
        turns = (faces + len(ball) * np.arange(len(self.touches))[:, None, None]).reshape(-1, 3)
        return {
            "landmarks-crosses": LinesFigure(float32(crosses), colours.LANDMARK, 1.8),
            "landmarks-misses": LinesFigure(float32(misses), colours.TOOL, 1.0),
            "landmarks-touches": SurfaceFigure(float32(beads), turns, colours.TOOL),
        }

    def base_figures(self, body: FreeSurface, extended: bool) -> dict[str, Figure]:
        """Hatching along the border of the free surface, beyond which the body is held.

        Args:
            body: the free surface at rest.
            extended: whether the extended model is shown, whose base may be loose.
        """
        edges, normals = body.border
        if not len(edges):
            return {}
        low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
        outline = body.vertices[edges] + np.array([0.0, 0.0, RAISED])
        along, outwards = _beside(outline, normals)
        ends = np.cumsum(np.linalg.norm(outline[:, 1] - outline[:, 0], axis=1))
        ways = np.arange(0.5 * TICKS_APART, ends[-1], TICKS_APART)
        edge = np.searchsorted(ends, ways)
        at = outline[edge, 1] - (ends[edge] - ways)[:, None] * along[edge]
        tips = at + TICK * (outwards[edge] - along[edge]) / np.sqrt(2)
        held = [not (extended and self._is_loose(place, low, high)) for place in at]
        ticks = np.stack([at, tips], axis=1)[held]
        segments = float32(np.concatenate([outline, ticks]))
        return {"base": LinesFigure(segments, colours.SUPPORT, 1.6)}

    def _is_loose(self, at: FloatArray, low: FloatArray, high: FloatArray) -> bool:
        for edge, extent in self.loose:
            axis = "xy".index(edge[1])
            away = at[axis] - low[axis] if edge[0] == "-" else high[axis] - at[axis]
            if away <= extent:
                return True
        return False

    def lump_figures(self, layer: ModelLayer, frame: int, opacity: float) -> dict[str, Figure]:
        """Each lump as a ball, inside the ellipsoid of all its places within the intervals; each
        tube as a circle swept along its axis, inside a wider one; an offset of the cast as beads.
        """
        figures: dict[str, Figure] = {}
        for cast in self.casts:
            figures.update(cast.figures(layer, frame, opacity))
        ball, faces = sphere(28, 18)
        for number, lump in enumerate(self.lumps):
            centre = np.array([value for _, value, _ in lump.centre])
            moved = layer.moved(frame, centre[None])
            at = centre if moved is None else moved[0]
            figures[f"lump-{number}"] = SurfaceFigure(
                float32(at + lump.radius[1] * ball), faces, colours.EXTENDED, 0.55 * opacity
            )
            middle = at - centre + np.array([(low + high) / 2 for low, _, high in lump.centre])
            reach = lump.radius[2] + np.array([(high - low) / 2 for low, _, high in lump.centre])
            figures[f"lump-{number}-interval"] = SurfaceFigure(
                float32(middle + reach * ball), faces, colours.EXTENDED, 0.2 * opacity
            )
        for number, tube in enumerate(self.tubes, start=len(self.lumps)):
            moved = layer.moved(frame, tube.axis)
            at = tube.axis if moved is None else moved
            for name, radius, share in (
                (f"lump-{number}", tube.radius[1], 0.55),
                (f"lump-{number}-interval", tube.radius[2] + tube.unsure, 0.2),
            ):
                points, faces = swept(at, radius)
                figures[name] = SurfaceFigure(
                    float32(points), faces, colours.EXTENDED, share * opacity
                )
        return figures


def _beside(edges: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (e, 3) along edges (e, 2, 3) [m], and across them, away from the body: level
    unless the surface with these normals (e, 3) lies flat there.
    """
    along = edges[:, 1] - edges[:, 0]
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    level = normals * np.array([1.0, 1.0, 0.0])
    steep = np.linalg.norm(level, axis=1, keepdims=True) > LEVEL
    across = np.where(steep, level, normals)
    across = across - np.einsum("ei,ei->e", across, along)[:, None] * along
    return along, across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)


def annotations_of(run: Run) -> Annotations:
    """Annotations from a run's model and causes; missing data give no figures."""
    try:
        setup = run.model.get("setup", {})
    except RunError:
        setup = {}
    landmarks = np.array(setup.get("landmarks") or np.zeros((0, 3)), dtype=float).reshape(-1, 3)
    touching = setup.get("touching") or {}
    misses = np.array(touching.get("misses") or np.zeros_like(landmarks), dtype=float).reshape(
        -1, 3
    )
    lifts = np.array(touching.get("normals") or [[0.0, 0.0, 1.0]], dtype=float)
    touches = (
        landmarks + misses + float(touching.get("lift", 0.0)) * lifts
        if len(misses) == len(landmarks)
        else landmarks
    )
    strips = (setup.get("support") or {}).get("detached") or []
    loose = tuple((str(strip["edge"]), float(strip["extent"])) for strip in strips)
    causes = run.report.get("causes", [])
    inside = tuple(_lumps(causes)), tuple(_tubes(causes))
    stiffness, casts = stiffness_surface_of(run.report), tuple(_casts(causes))
    return Annotations(landmarks, touches, loose, *inside, stiffness, casts)


def _lumps(causes: Sequence[dict[str, Any]]) -> list[Lump]:
    lumps = []
    for cause in causes:
        parameters = cause.get("parameters", {})
        if cause.get("effect") != "stiff_inclusion" or not {"x", "y", "z", "radius"} <= set(
            parameters
        ):
            continue
        spans = {name: _span(parameters[name]) for name in ("x", "y", "z", "radius")}
        lumps.append(Lump((spans["x"], spans["y"], spans["z"]), spans["radius"]))
    return lumps


def _tubes(causes: Sequence[dict[str, Any]]) -> list[TubeAlong]:
    """Tubes of the causes that state their `polyline`."""
    tubes = []
    for cause in causes:
        line, parameters = cause.get("polyline") or [], cause.get("parameters", {})
        if len(line) > 1 and "radius" in parameters:
            low, _, high = _span(parameters.get("aside", {"value": 0.0}))
            axis = np.array(line, dtype=float)
            tubes.append(TubeAlong(axis, _span(parameters["radius"]), (high - low) / 2))
    return tubes


def _casts(causes: Sequence[dict[str, Any]]) -> list[CastOffset]:
    """Offsets of the causes that state their `field`."""
    return [
        CastOffset(np.array(field["places"], dtype=float), np.array(field["offset"], dtype=float))
        for field in (cause.get("field") for cause in causes)
        if field and field["places"]
    ]


def _span(parameter: dict[str, Any]) -> tuple[float, float, float]:
    value = float(parameter["value"])
    low, high = (
        value if parameter.get(end) is None else float(parameter[end]) for end in ("low", "high")
    )
    return low, value, high


def path_lines(places: FloatArray, reached: int) -> dict[str, Figure]:
    """Path of the tool's centre through places (n, 3) [m]: dark up to the segment that is reached,
    light after it.
    """
    if len(places) < 2:
        return {}
    segments = np.stack([places[:-1], places[1:]], axis=1)
    shades = np.where((np.arange(len(segments)) < reached)[:, None, None], colours.TOOL, AHEAD)
    return {
        "path": LinesFigure(
            float32(segments), np.broadcast_to(shades, segments.shape).astype(np.uint8), 1.8
        )
    }


def swept(axis: FloatArray, radius: float, around: int = 20) -> tuple[FloatArray, IntArray]:
    """Vertices (n, 3) [m] and triangles of a circle swept along a line, with closed ends.

    Args:
        axis: points (k, 3) [m], no two neighbours alike.
        radius: of the circle [m].
        around: number of corners of the circle.
    """
    along = np.gradient(axis, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    least = np.eye(3)[int(np.abs(along).max(axis=0).argmin())]
    across = np.cross(along, least)
    across /= np.linalg.norm(across, axis=1)[:, None]
    turn = np.linspace(0, 2 * np.pi, around + 1)[:, None]
    rings = np.cos(turn) * across[:, None] - np.sin(turn) * np.cross(along, across)[:, None]
    rings = axis[:, None] + radius * rings
    ends = [np.broadcast_to(end, (1, *rings.shape[1:])) for end in (axis[0], axis[-1])]
    rows = np.concatenate([ends[0], rings, ends[1]])
    return rows.reshape(-1, 3), lattice(len(rows), around + 1)


@lru_cache(maxsize=4)
def sphere(around: int, down: int) -> tuple[FloatArray, IntArray]:
    """Vertices (n, 3) and triangles of a unit sphere."""
    turn, fall = np.meshgrid(np.linspace(0, 2 * np.pi, around + 1), np.linspace(0, np.pi, down + 1))
    points = np.stack(
        [np.sin(fall) * np.cos(turn), np.sin(fall) * np.sin(turn), np.cos(fall)], axis=-1
    )
    return points.reshape(-1, 3), lattice(down + 1, around + 1)
