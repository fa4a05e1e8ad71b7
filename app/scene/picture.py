"""One moment of a run as figures to draw, in the phantom frame [m]; nothing here knows how they are
drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from palpate.app.scene import colours
from palpate.app.scene.annotations import Annotations, path_lines
from palpate.app.scene.cut_section import clipped, cut_face, depth_inside
from palpate.app.scene.figures import (
    CloudFigure,
    Figure,
    LabelFigure,
    LinesFigure,
    PointArray,
    SurfaceFigure,
    ToolFigure,
    checksum,
)
from palpate.app.scene.model_layer import FrameSolution, ModelLayer, end_of_scale, model_layers
from palpate.app.scene.surface_bands import FineSurface, IntArray, grid_edges, refine
from palpate.app.scene.view import Model, Quantity, Section, View
from palpate.app.storage.run_store import RecordedReplay
from palpate.foundation.arrays import FloatArray

__all__ = ["Picture", "SequenceRenderer"]

NAMES = {"raw": "Raw model", "extended": "Extended model", "corrected": "Corrected model"}
MARGIN, APART = 0.008, 0.016
MOST_POINTS = 50_000
MOST_TRIANGLES = 25_000
WIRE = 1.2


@dataclass(frozen=True, eq=False)
class Picture:
    """What is to be seen.

    Attributes:
        frame: index in the sequence.
        figures: by name; what is coloured is `MODEL-QUANTITY-07`, one figure for each colour.
        points: how many measured points there are.
        quantity: that the colours show; None where nothing is coloured.
        limit: errors reach from -limit to limit [m], the other quantities from 0 to limit; None
            where nothing is coloured.
        columns: how far each model stands aside (n, 3) [m].
    """

    frame: int
    figures: dict[str, Figure]
    points: int
    quantity: Quantity | None
    limit: float | None
    columns: tuple[tuple[float, float, float], ...]

    def of(self, kind: type[Any]) -> dict[str, Any]:
        """The figures of one kind."""
        return {name: figure for name, figure in self.figures.items() if isinstance(figure, kind)}

    def scale(self) -> dict[str, Any]:
        """What the colours mean."""
        return {"quantity": self.quantity, "limit": self.limit}

    def checksum(self) -> str:
        """A short digest of all arrays, for comparing what two places hold."""
        return checksum(self.frame, self.figures)

    def summary(self) -> dict[str, Any]:
        """Counts of what is drawn."""
        tool = next(iter(self.of(ToolFigure).values()), None)
        return {
            "points": self.points,
            "triangles": {name: len(mesh.faces) for name, mesh in self.of(SurfaceFigure).items()},
            "lines": sum(
                len(lines.segments)
                for name, lines in self.of(LinesFigure).items()
                if name.endswith("-lines")
            ),
            "figures": sorted(self.figures),
            "tool": None if tool is None else [round(float(x), 6) for x in tool.centre],
            **self.scale(),
            "checksum": self.checksum(),
        }


class SequenceRenderer:
    """One replayed sequence ready to be drawn; `clouds(i)` gives the raw cloud i in the camera
    frame, or is None.
    """

    def __init__(
        self,
        replay: RecordedReplay,
        clouds: Callable[[int], FloatArray] | None,
        annotations: Annotations | None = None,
    ) -> None:
        self.replay, self._clouds = replay, clouds
        self.layers = model_layers(replay)
        self._annotations = annotations or Annotations(np.zeros((0, 3)), np.zeros((0, 3)))
        self._rest = np.asarray(replay["rest"], dtype=float)
        self._surfaces = {
            parts: refine(self._rest, replay["faces"], parts)
            for parts in (1, _parts(len(replay["faces"])))
        }
        self._edges = grid_edges(self._rest, replay["faces"])
        self._cut: tuple[Section, dict[int, FineSurface], IntArray] | None = None
        self._points = 0
        self._ends: dict[Quantity, float | None] = {}

    @cached_property
    def corners(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner of the block at rest (3,) [m]."""
        low, high = self._rest.min(axis=0), self._rest.max(axis=0)
        return np.array([low[0], low[1], 0.0]), high

    @property
    def limit(self) -> float:
        """The robust end of the scale of errors [m]."""
        return self.end("error") or 1e-3

    @property
    def lumps(self) -> int:
        """How many lumps can be shown."""
        return len(self._annotations.lumps)

    @property
    def landmarks(self) -> int:
        """How many touched landmarks can be shown."""
        return len(self._annotations.landmarks)

    def end(self, quantity: Quantity) -> float | None:
        """The robust end of a scale; None where the run does not hold the quantity."""
        if quantity not in self._ends:
            self._ends[quantity] = end_of_scale(self.replay, quantity)
        return self._ends[quantity]

    def instead(
        self, frame: int, found: FrameSolution, model: Model = "extended"
    ) -> SequenceRenderer:
        """The same reel with another solution of one frame in place of a model's."""
        other = copy(self)
        other.layers = {
            **self.layers,
            model: replace(self.layers[model], instead=frame, found=found),
        }
        return other

    def picture(self, view: View, end: float | None = None) -> Picture:
        """The moment that a view asks for; `end` of the scale where the view names none and it is
        not the robust one.
        """
        models = tuple(model for model in view.models() if model in self.layers)
        front = view.front(models)
        limit = view.limit or end or self.end(view.quantity)
        figures: dict[str, Figure] = {}
        columns = self._columns(view, models)
        points, coloured = 0, False
        for model, at in zip(models, columns, strict=False):
            drawn, shown = self._model(view, model, models, limit)
            coloured = coloured or shown
            alone = view.side_by_side and len(models) > 1
            if alone or model == front:
                around, points = self._around(
                    view, self.layers[model], f"-{model}" if alone else ""
                )
                drawn = {**drawn, **around}
            if alone:
                drawn[f"name-{model}"] = LabelFigure(
                    NAMES[model], np.array([0.0, 0.0, self.corners[1][2] + 0.03])
                )
            figures.update({name: replace(figure, at=at) for name, figure in drawn.items()})
        if not models:
            figures, points = self._around(view, self.layers["raw"], "")
        quantity, limit = (view.quantity, limit) if coloured else (None, None)
        return Picture(view.frame, figures, points, quantity, limit, columns)

    def _columns(
        self, view: View, models: tuple[Model, ...]
    ) -> tuple[tuple[float, float, float], ...]:
        """Where each model stands: side by side across the line of sight from the depth camera, the
        stated one first.
        """
        if not view.side_by_side or len(models) < 2:
            return ((0.0, 0.0, 0.0),) * max(1, len(models))
        eye = self.layers["raw"].camera(-1).translation
        around = np.arctan2(eye[1], eye[0])
        right = np.array([-np.sin(around), np.cos(around)])
        size = self.corners[1] - self.corners[0]
        apart = float(np.abs(right) @ size[:2]) + APART
        places = [apart * (len(models) - 1 - number) * right for number in range(len(models))]
        return tuple((float(x), float(y), 0.0) for x, y in places)

    def _model(
        self, view: View, model: Model, models: tuple[Model, ...], limit: float | None
    ) -> tuple[dict[str, Figure], bool]:
        """The figures of one model, and whether it shows the quantity."""
        layer, opacity, colour = (
            self.layers[model],
            view.opacity(model),
            getattr(colours, model.upper()),
        )
        if view.lines(model, models):
            lines = layer.surface(view.frame)[self._edges_left(view.section)]
            return {f"{model}-lines": LinesFigure(_single(lines), colour, WIRE)}, False
        values = (
            layer.values(view.quantity, view.frame)
            if view.coloured(model, models) and limit
            else None
        )
        surface = self._surface(view.section, fine=values is not None)
        vertices = surface.spread(layer.surface(view.frame))
        cap = self._cap(view, layer)
        if values is None or limit is None:
            plain: dict[str, Figure] = {
                model: SurfaceFigure(_single(vertices), surface.faces, colour, opacity)
            }
            if cap is not None:
                plain[f"{model}-cut"] = _plain(cap[1], cap[2], colour, opacity)
            return plain, False
        name = f"{model}-{view.quantity}"
        drawn = banded(
            name, vertices, surface.faces, surface.spread(values), view.quantity, limit, opacity
        )
        if cap is not None:
            places, moved, faces = cap
            inner = layer.within(view.quantity, view.frame, places)
            if inner is None:
                drawn[f"{model}-cut"] = _plain(moved, faces, colour, opacity)
            else:
                drawn.update(
                    banded(f"{name}-cut", moved, faces, inner, view.quantity, limit, opacity)
                )
        return drawn, True

    def _around(self, view: View, layer: ModelLayer, suffix: str) -> tuple[dict[str, Figure], int]:
        """Cloud, tool, path, base, landmarks and lump beside a model."""
        figures: dict[str, Figure] = {}
        points = 0
        if "measured" in view.layers:
            cloud, points = self._cloud(view, layer)
            if cloud is not None:
                figures["cloud"] = CloudFigure(cloud, colours.MEASURED)
        if "tool" in view.layers:
            figures["tool"] = ToolFigure(*layer.tool(view.frame), view.opacity("tool"))
        if "path" in view.layers:
            figures.update(path_lines(layer, view.frame))
        if "landmarks" in view.layers:
            figures.update(self._annotations.touched())
        if "base" in view.layers:
            figures.update(self._annotations.base(*self.corners, extended=layer.model != "raw"))
        if "lump" in view.layers and not (suffix and layer.model == "raw"):
            figures.update(self._annotations.found(layer, view.frame, view.opacity("lump")))
        return {f"{name}{suffix}": figure for name, figure in figures.items()}, points

    def _surface(self, section: Section | None, *, fine: bool) -> FineSurface:
        parts = (max if fine else min)(self._surfaces)
        return self._surfaces[parts] if section is None else self._cut_by(section)[1][parts]

    def _edges_left(self, section: Section | None) -> IntArray:
        return self._edges if section is None else self._cut_by(section)[2]

    def _cut_by(self, section: Section) -> tuple[Section, dict[int, FineSurface], IntArray]:
        """What a section leaves of the surfaces and edges; the last one is kept."""
        cut = self._cut
        if cut is None or cut[0] != section:
            surfaces = {
                parts: clipped(surface, self._rest, section)
                for parts, surface in self._surfaces.items()
            }
            edges = self._edges[
                np.all(depth_inside(section, self._rest)[self._edges] >= -1e-9, axis=1)
            ]
            self._cut = cut = (section, surfaces, edges)
        return cut

    def _cap(self, view: View, layer: ModelLayer) -> tuple[FloatArray, FloatArray, IntArray] | None:
        """The face that a section opens: places at rest and where they are (n, 3) [m], triangles;
        None where there is none.
        """
        if view.section is None:
            return None
        face = cut_face(*self.corners, view.section)
        moved = None if face is None else layer.moved(view.frame, face[0])
        return None if face is None or moved is None else (face[0], moved, face[1])

    def _cloud(self, view: View, layer: ModelLayer) -> tuple[PointArray | None, int]:
        if self._clouds is None:
            return None, 0
        points = layer.camera(view.frame).apply(
            self._clouds(int(self.replay["cloud_index"][view.frame]))
        )
        if view.crop:
            points = points[_near_box(points, self.corners[1] - self.corners[0])]
        if view.section is not None:
            points = points[depth_inside(view.section, points) >= 0]
        count = min(MOST_POINTS, int(np.ceil(len(points) * view.opacity("measured"))))
        points = (
            points[np.linspace(0, len(points) - 1, count).astype(int)]
            if 0 < count < len(points)
            else points
        )
        if not len(points):
            return None, 0
        self._points = max(self._points, 1000 * (len(points) // 800 + 1))
        padded = np.tile(points[:1], (self._points, 1)).astype(np.float32)
        padded[: len(points)] = points
        return padded, len(points)


def banded(
    name: str,
    vertices: FloatArray,
    faces: IntArray,
    values: FloatArray,
    quantity: Quantity,
    limit: float,
    opacity: float,
) -> dict[str, Figure]:
    """One mesh for each colour that occurs: values (n,) at vertices (n, 3), their mean over each
    triangle (m, 3) counts.
    """
    signed = quantity == "error"
    shades = colours.SIGNED if signed else colours.SEQUENTIAL
    means = values[faces].mean(axis=1)
    band = colours.band_of(means, limit) if signed else colours.step_of(means, limit)
    meshes: dict[str, Figure] = {}
    for number in np.unique(band):
        used, turned = np.unique(faces[band == number], return_inverse=True)
        unseen = number == len(shades)
        label = f"{name}-unseen" if unseen else f"{name}-{number:02d}"
        shade = colours.UNSEEN if unseen else shades[number]
        meshes[label] = SurfaceFigure(
            _single(vertices[used]), turned.reshape(-1, 3), shade, opacity
        )
    return meshes


def _plain(
    vertices: FloatArray, faces: IntArray, colour: tuple[int, int, int], opacity: float
) -> SurfaceFigure:
    """A cut face in a model's colour, lighter, so that it is told from the outside."""
    light = tuple(round(0.45 * part + 0.55 * 255) for part in colour)
    return SurfaceFigure(_single(vertices), faces, (light[0], light[1], light[2]), opacity)


def _single(values: Any) -> PointArray:
    return np.ascontiguousarray(values, dtype=np.float32)


def _parts(faces: int) -> int:
    """How finely each triangle is cut for smooth bands: as many triangles as a browser draws with
    ease.
    """
    return int(np.clip(np.sqrt(MOST_TRIANGLES / faces), 1, 10))


def _near_box(points: FloatArray, size: FloatArray) -> Any:
    """Which points lie within the box or not far from it, and above the table."""
    low = np.array([-size[0] / 2, -size[1] / 2, 0.0]) - MARGIN * np.array([1.0, 1.0, -0.1])
    high = np.array([size[0] / 2, size[1] / 2, size[2]]) + MARGIN
    return np.all((points > low) & (points < high), axis=1)
